"""Routes: a module for each kind of resource, and one for the service itself."""
