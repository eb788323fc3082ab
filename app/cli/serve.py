"""``geodesic serve``."""

import math
from types import FrameType
from typing import Annotated

import typer


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
            f"{variable_of(str(fault['loc'][0]))}: {fault['msg']}" if fault["loc"] else fault["msg"]
            for fault in error.errors()
        ]
        raise typer.BadParameter("; ".join(faults)) from error
    app = create_app(settings)

    class Server(uvicorn.Server):
        """Tells the service at once that it is to stop: uvicorn itself does so last of all."""

        def handle_exit(self, sig: int, frame: FrameType | None) -> None:
            app.state.service.drain()
            super().handle_exit(sig, frame)

    # uvicorn takes whole seconds.
    grace = math.ceil(settings.drain_s)
    server = Server(uvicorn.Config(app, host, port, timeout_graceful_shutdown=grace))
    server.run()
    if not server.started:
        raise typer.Exit(1)
