"""``geodesic serve``."""

import errno
import gc
import os
import socket
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from signal import SIGHUP, SIGTERM, raise_signal, signal
from typing import TYPE_CHECKING, Annotated

import typer

from app.access import is_loopback
from app.cli.configuration import read_settings
from app.cli.steps import Failure
from app.engine import fork_server

if TYPE_CHECKING:
    from app.settings import Settings

_GIVE_WAY_S = 0.0005
"""Seconds after which a thread that checks a body gives way to the event loop, which waits so long
for each of its calls; 5 ms by default"""


def serve(
    host: Annotated[str, typer.Option(help="Address to listen on.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port to listen on.")] = 8000,
    engine: Annotated[
        str | None,
        typer.Option(help="local, or ray for the hosts of a cluster; by default GEODESIC_ENGINE."),
    ] = None,
    store: Annotated[
        str | None,
        typer.Option(
            help="Shared folder, or URL such as s3://bucket/x; by default GEODESIC_STORE."
        ),
    ] = None,
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
    from app import logs
    from app.http.server import server_of
    from app.main import create_app
    from app.state import StateError
    from app.store.layout import StoreError

    gc.enable()
    settings = read_settings(engine=engine, store=store, state=state)
    _refuse_without_keys(host, settings)
    _refuse_taken_port(host, port)
    logs.install(settings.log_format)
    try:
        app = create_app(settings)
        with app.state.service.owning_store():
            pass  # the server itself would show a refusal as a traceback
    except (StoreError, StateError) as error:
        raise Failure(str(error)) from error
    sys.setswitchinterval(_GIVE_WAY_S)
    server = server_of(app, host, port, settings)
    # A closed terminal ends the service in the same order.
    signal(SIGHUP, lambda *_: raise_signal(SIGTERM))
    with _in_cluster_if_asked(settings):
        server.run()
    if not server.started:
        raise typer.Exit(1)


@contextmanager
def _in_cluster_if_asked(settings: "Settings") -> Iterator[None]:
    """Be a client of the cluster inside the block, where the settings say so."""
    if settings.engine == "local":
        yield
        return
    from app.engine.ray_cluster import ClusterError, joined

    with ExitStack() as stack:
        try:
            stack.enter_context(joined())
        except ClusterError as error:
            raise Failure(str(error)) from error
        yield


def _refuse_taken_port(host: str, port: int) -> None:
    """Refuse a port that another server has: ours would find out after its workers have started."""
    try:
        addresses = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
        for family, kind, protocol, _, address in addresses:
            with socket.socket(family, kind, protocol) as probe:
                probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
                probe.bind(address)
    except OSError as error:
        if error.errno == errno.EADDRINUSE:
            raise Failure(f"port {port} of {host} is in use: choose another by --port") from error


def _refuse_without_keys(host: str, settings: "Settings") -> None:
    """Refuse an address that others can reach, where neither keys nor a proxy keep them out."""
    if not is_loopback(host) and not settings.api_keys and settings.auth == "on":
        raise typer.BadParameter(
            f"anybody who can reach {host} could use the service: set GEODESIC_API_KEYS, or set "
            "GEODESIC_AUTH=off if a proxy in front of it checks keys"
        )
