"""The natural map of the contact problem and its Newton matrix."""
