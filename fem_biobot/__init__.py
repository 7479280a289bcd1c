"""fem_biobot: finite-element continuum model of muscle-driven hydrogel walking machines."""
