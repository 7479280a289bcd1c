"""Motion of solids in time: inertia, viscosity, gravity, a frictional ground, and the book of energies."""
