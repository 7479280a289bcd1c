"""A sequence of implicit steps that adapt to their error and to changes of contact."""
