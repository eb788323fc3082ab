"""``geodesic head`` and ``geodesic node``: the machines of a cluster."""

import signal
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Event
from types import FrameType
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.cli.configuration import read_settings
from app.cli.ray_folder import ray_folder
from app.cli.steps import Failure

Folder = Annotated[
    Path, typer.Option("--dir", help="Folder of Ray's sockets and logs, and of the head's records.")
]
Address = Annotated[
    str | None, typer.Option(help="Address of the head, as H:P; by default GEODESIC_ADDRESS.")
]
Store = Annotated[
    str | None,
    typer.Option(help="Shared folder, or URL such as s3://bucket/x; by default GEODESIC_STORE."),
]

if TYPE_CHECKING:
    from app.settings import Settings

_LOOK_S = 0.5
"""Between two looks whether Ray still runs"""


def head(
    host: Annotated[str, typer.Option(help="Address at which other machines reach this one.")],
    folder: Folder,
    port: Annotated[int, typer.Option(min=1024, max=65535, help="Port to listen on.")] = 6379,
    redis: Annotated[
        str | None,
        typer.Option(
            help="URL of a Redis or Valkey for the records, in place of the folder; by default "
            "GEODESIC_REDIS."
        ),
    ] = None,
) -> None:
    """Run the head of a cluster, which knows all machines, until interrupted."""
    settings = read_settings(redis=redis)
    from app.engine.ray_node import running_head

    with _failing_clearly(), running_head(host, port, folder, settings) as running:
        typer.echo(f"the head listens at {host}:{port}; {running.records.durability}")
        stopped = _stopped()
        while not stopped.wait(_LOOK_S):
            running.check()


def node(folder: Folder, address: Address = None, store: Store = None) -> None:
    """Make this machine a host of a cluster until interrupted; it then finishes running work."""
    settings = _with_whole_paths(read_settings(address=address, store=store), folder)
    from app.engine.ray_cluster import start_host
    from app.engine.ray_node import joined

    store_id = _identity_of_store(settings)
    with _failing_clearly(), joined(folder, settings) as processes:
        import ray

        host = start_host(settings, store_id)
        try:
            ray.get(host.beat.remote([]))
        except ray.exceptions.RayError as error:
            raise Failure(f"the host does not start: {error}; see its logs in {folder}") from error
        typer.echo(f"host of the cluster at {settings.address}, with {settings.workers} workers")
        stopped = _stopped()
        while not stopped.wait(_LOOK_S):
            processes.check()
        typer.echo("draining")
        stopped.clear()  # a second signal ends the time that running work gets
        _drain(host, settings.drain_s, stopped)


def _with_whole_paths(settings: "Settings", folder: Path) -> "Settings":
    """Return the settings of a node with paths that hold in any folder; copies go into its own."""
    if isinstance(settings.store, Path):
        return settings.model_copy(update={"store": settings.store.resolve()})
    return settings.model_copy(update={"copies": (folder / "copies").resolve()})


def _identity_of_store(settings: "Settings") -> str:
    from app.store.choice import store_of
    from app.store.layout import StoreError

    try:
        return store_of(settings).identity()
    except StoreError as error:
        raise Failure(str(error)) from error


def _drain(host: Any, seconds: float, stopped: Event) -> None:
    """Let a host finish its running work, for some seconds or until stopped, and end it."""
    import ray

    draining, end = host.drain.remote(), time.monotonic() + seconds
    while time.monotonic() < end and not stopped.is_set():
        if ray.wait([draining], timeout=_LOOK_S)[0]:
            break
    with suppress(ray.exceptions.RayError):  # it has ended by itself
        ray.get(host.close.remote())


@contextmanager
def joined_if_asked(settings: "Settings") -> Iterator[None]:
    """Be a member of the cluster inside the block, where the settings say so."""
    if settings.engine == "local":
        yield
        return
    from app.engine.ray_node import joined

    with ray_folder() as folder, _failing_clearly(), joined(folder, settings):
        yield


def _stopped() -> Event:
    """Return an event that a signal sets: to stop, or that the terminal is gone."""
    stopped = Event()

    def stop(_number: int, _frame: FrameType | None) -> None:
        stopped.set()

    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        signal.signal(number, stop)
    return stopped


@contextmanager
def _failing_clearly() -> Iterator[None]:
    from app.engine.cluster import ClusterError

    # Until the command has its own way to end: it ends what it has started of Ray.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    try:
        yield
    except ClusterError as error:
        raise Failure(str(error)) from error
