"""Meshes: from a design (geometry), from a file (files), as checked data (body)."""
