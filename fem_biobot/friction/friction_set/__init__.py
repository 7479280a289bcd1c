"""The convex set of admissible friction."""
