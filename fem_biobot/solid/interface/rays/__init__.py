"""Which point of one surface lies opposite to a point of the other."""
