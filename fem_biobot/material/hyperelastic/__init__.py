"""Compiled point stage of laws written in invariants."""
