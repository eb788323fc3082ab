"""``geodesic serve``."""

from ipaddress import ip_address
from typing import Annotated

import typer

_DRAIN_S = 20
"""Granted to requests that run when the server is told to stop."""


def serve(
    host: Annotated[str, typer.Option(help="Address to listen on.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port to listen on.")] = 8000,
) -> None:
    """Serve geodesics over HTTP until interrupted; settings are GEODESIC_… variables."""
    import uvicorn
    from pydantic import ValidationError

    from app.main import create_app
    from app.settings import Settings, variable_of

    try:
        settings = Settings()
    except ValidationError as error:
        faults = [
            ": ".join([*(variable_of(str(name)) for name in fault["loc"][:1]), fault["msg"]])
            for fault in error.errors()
            if fault["type"] != "default_factory_not_called"  # for another fault's sake
        ]
        raise typer.BadParameter("; ".join(faults).replace("Value error, ", "")) from error
    if not _is_loopback(host) and not settings.api_keys and settings.auth == "on":
        raise typer.BadParameter(
            f"whoever reaches {host} could use the service: set GEODESIC_API_KEYS, or "
            f"GEODESIC_AUTH=off where something before it asks for keys"
        )
    uvicorn.run(create_app(settings), host=host, port=port, timeout_graceful_shutdown=_DRAIN_S)


def _is_loopback(host: str) -> bool:
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"
