"""Compiled point stage of active tension."""
