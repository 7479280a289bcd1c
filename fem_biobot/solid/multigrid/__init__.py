"""Two levels of quadratic and linear tetrahedra that precondition conjugate gradients on large meshes."""
