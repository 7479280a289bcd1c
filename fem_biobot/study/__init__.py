"""Studies: the main job on a design, its folder, its comparison with the paper."""
