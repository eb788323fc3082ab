"""``geodesic serve``."""

import asyncio
import gc
import math
import os
import sys
from functools import partial
from signal import SIGHUP, SIGTERM, raise_signal, signal
from types import FrameType
from typing import Annotated, Any, cast

import typer

from app.access import is_loopback
from app.cli.cluster import Address, Store, joined_if_asked
from app.cli.configuration import read_settings
from app.cli.steps import Failure
from app.engine import fork_server


def serve(
    host: Annotated[str, typer.Option(help="Address to listen on.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port to listen on.")] = 8000,
    engine: Annotated[
        str | None,
        typer.Option(help="local, or ray for the hosts of a cluster; by default GEODESIC_ENGINE."),
    ] = None,
    address: Address = None,
    store: Store = None,
    state: Annotated[
        str | None, typer.Option(help="URL of a PostgreSQL database that several services share.")
    ] = None,
) -> None:
    """Serve geodesics over HTTP until interrupted; settings are GEODESIC_… variables."""
    if not sys.stderr.isatty():
        os.environ["GEODESIC_QUIET"] = "1"  # lines are objects then; the log says that it compiles
    if (engine or os.environ.get("GEODESIC_ENGINE", "local")) == "local":
        fork_server.start()  # imports for the workers while this process imports for itself

    gc.disable()  # imports leave no garbage, and to look for it takes 0.15 s
    import uvicorn

    from app import logs
    from app.http.connections import Connections
    from app.http.protocol import BoundedHttpProtocol
    from app.http.reading import PacedReading
    from app.main import create_app
    from app.state import StateError
    from app.store.layout import StoreError

    gc.enable()
    settings = read_settings(engine=engine, address=address, store=store, state=state)
    if not is_loopback(host) and not settings.api_keys and settings.auth == "on":
        raise typer.BadParameter(
            f"anybody who can reach {host} could use the service: set GEODESIC_API_KEYS, or set "
            "GEODESIC_AUTH=off if a proxy in front of it checks keys"
        )
    logs.install(settings.log_format)
    try:
        app = create_app(settings)
        with app.state.service.owning_store():
            pass  # the server itself would show a refusal as a traceback
    except (StoreError, StateError) as error:
        raise Failure(str(error)) from error

    usual_s = 0.0 if is_loopback(host) else 5.0  # time for a load balancer to notice
    delay_s = usual_s if settings.drain_delay_s is None else settings.drain_delay_s

    class Server(uvicorn.Server):
        """A server that drains the service as soon as it is to stop, where uvicorn does so last.

        For a while before, only `/readyz` says so. A second signal ends this time.
        """

        def handle_exit(self, sig: int, frame: FrameType | None) -> None:
            is_first = not app.state.service.is_leaving
            app.state.service.announce_end()
            if is_first and delay_s > 0:
                loop = asyncio.get_running_loop()
                loop.call_soon_threadsafe(partial(loop.call_later, delay_s, self.drain, sig, frame))
            else:
                self.drain(sig, frame)

        def drain(self, sig: int, frame: FrameType | None) -> None:
            app.state.service.drain()
            super().handle_exit(sig, frame)

    connections = Connections(settings)

    def connect(**arguments: Any) -> PacedReading:
        return PacedReading(BoundedHttpProtocol(connections=connections, **arguments))

    config = uvicorn.Config(
        app,
        host,
        port,
        http=cast(Any, connect),
        ws="none",
        timeout_graceful_shutdown=math.ceil(settings.drain_s),  # uvicorn takes whole seconds
        log_config=None,
        access_log=False,  # the application has its own
    )
    server = Server(config)
    # A closed terminal ends the service in the same order.
    signal(SIGHUP, lambda *_: raise_signal(SIGTERM))
    with joined_if_asked(settings):
        server.run()
    if not server.started:
        raise typer.Exit(1)
