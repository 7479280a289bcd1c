"""Two parts of a body that are not bonded: unilateral contact with finite sliding and Coulomb friction, at rest."""
