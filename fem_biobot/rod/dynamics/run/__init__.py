"""A sequence of implicit steps, divided where contact changes."""
