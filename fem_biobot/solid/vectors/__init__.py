"""Compiled products of the sparse matrix with vectors, and sums of vectors."""
