"""Contact between parts of an assembly."""
