"""Compiled functions called by their address."""
