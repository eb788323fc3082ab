"""The HTTP layer: everything that knows Starlette and FastAPI."""
