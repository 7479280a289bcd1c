"""The skew part of the tangent, for laws without energy and pressures that follow an open surface."""
