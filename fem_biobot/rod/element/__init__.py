"""The two-node rod element: its arrays, strains, internal force and tangent."""
