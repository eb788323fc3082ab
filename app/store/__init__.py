"""The store on disk: meshes, results and distance fields."""
