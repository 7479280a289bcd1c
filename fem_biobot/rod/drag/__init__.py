"""Drag of rods and bodies in a viscous medium."""
