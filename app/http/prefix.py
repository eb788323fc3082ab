"""The prefix under which a proxy offers the service: `GEODESIC_ROOT_PATH`, ``root_path`` in ASGI.

The proxy cuts it off, uvicorn puts it back, and answers name addresses below it.
"""

from starlette.types import Scope


def prefix_of(scope: Scope) -> str:
    """Return the prefix, such as ``/geodesic``; empty where the service has a host of its own."""
    prefix: str = scope.get("app_root_path", scope.get("root_path", ""))
    return prefix


def path_in(scope: Scope) -> str:
    """Return the path of a request below the prefix."""
    path: str = scope["path"]
    return path.removeprefix(prefix_of(scope))
