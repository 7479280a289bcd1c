"""The contact problem of a step, condensed on the nodes that touch."""
