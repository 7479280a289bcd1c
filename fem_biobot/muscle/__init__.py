"""Muscle as tissue: fibres."""
