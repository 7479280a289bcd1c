"""One contact point with all others held."""
