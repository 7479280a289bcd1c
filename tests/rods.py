"""Rods by their stiffnesses, for tests."""

from __future__ import annotations

from fem_biobot.verification.rod_parts import arc, rod_of, stiff, straight

__all__ = ["arc", "rod_of", "stiff", "straight"]
