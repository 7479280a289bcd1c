"""Forces and stiffness of a whole assembly."""
