"""Inertia of the nodes and arrays of theirs."""
