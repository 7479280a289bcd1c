"""Finite rotations: exponential, logarithm and updates that stay orthonormal."""
