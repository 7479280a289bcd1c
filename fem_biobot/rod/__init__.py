"""Geometrically exact rods: sections, elements, joints, statics, dynamics and the ground they walk on."""
