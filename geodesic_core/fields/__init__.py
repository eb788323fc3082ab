"""Distance fields: sweeps over the mesh, and answers from their results."""
