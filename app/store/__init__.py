"""The store on disk: meshes, answers and distance fields."""
