"""Vectors and matrices of three as tuples of scalars, for compiled code."""
