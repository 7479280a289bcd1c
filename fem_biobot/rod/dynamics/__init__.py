"""Time integration of an assembly on a frictional ground."""
