"""The surface: validated triangle meshes, and points and curves on them."""
