"""The explicit integrator: an independent witness of the implicit one."""
