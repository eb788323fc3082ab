"""Steps of commands: read a mesh, show progress, end at Ctrl-C."""

import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from time import perf_counter
from types import FrameType
from typing import TYPE_CHECKING, NamedTuple

import typer

from app.cli.arguments import STANDARD_STREAM, Merge

if TYPE_CHECKING:
    from app.store.meshes import OpenMesh


_LOG_INTERVAL_S = 60.0
"""Seconds between lines of progress where standard error is not a terminal"""


class Failure(Exception):  # noqa: N818 - not an error of this program
    """A failure that the user can do something about, told in one line."""


def show_help_without_command(context: typer.Context) -> None:
    """Print the help of a group of commands where none of them was named."""
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())


class MeshInput(NamedTuple):
    """A mesh as arguments name it."""

    file: Path
    """`STANDARD_STREAM` for standard input"""
    file_format: str | None
    """None to go by the name of the file"""
    merge: Merge


def read(mesh: MeshInput) -> "tuple[OpenMesh, float]":
    """Return a mesh, and the seconds of reading it once the kernels are loaded."""
    is_piped = mesh.file == STANDARD_STREAM
    if is_piped and mesh.file_format is None:
        raise typer.BadParameter("- reads standard input: name its format, as --format obj")
    with showing("Loading kernels (compiled on the first run)"):
        from app.store.meshes import OpenMesh
        from geodesic_core import load_mesh, warm_up

        warm_up(["exact", "paths"])
    with showing(f"Reading {'standard input' if is_piped else mesh.file.name}"):
        start = perf_counter()
        source = sys.stdin.buffer.read() if is_piped else mesh.file
        opened = OpenMesh.of(load_mesh(source, mesh.file_format, mesh.merge.value))
        seconds = perf_counter() - start
    return opened, seconds


class Step(NamedTuple):
    """The callbacks of a step: to report its progress, and to look for Ctrl-C."""

    progress: Callable[[float], None]
    cancel: Callable[[], bool]

    def check(self) -> None:
        """Raise KeyboardInterrupt after Ctrl-C."""
        if self.cancel():
            raise KeyboardInterrupt


@contextmanager
def showing(label: str) -> Iterator[Step]:
    """Show a bar on standard error until the step is over; in a log, a line each minute.

    Ctrl-C ends the step at its next checkpoint: a KeyboardInterrupt raised during an import or in
    compiled code gets lost, or becomes a SystemError. The second Ctrl-C works as usual.
    """
    from rich.console import Console
    from rich.progress import Progress

    pressed = False

    def note(_number: int, _frame: FrameType | None) -> None:
        nonlocal pressed
        pressed = True
        signal.signal(signal.SIGINT, usual)

    usual = signal.signal(signal.SIGINT, note)
    console = Console(stderr=True)
    told = perf_counter()

    def show(share: float) -> None:
        nonlocal told
        progress.update(task, total=1.0, completed=share)
        if progress.disable and perf_counter() - told >= _LOG_INTERVAL_S:
            told = perf_counter()
            typer.echo(f"{label}: {share:.0%}", err=True)

    try:
        with Progress(console=console, transient=True, disable=not console.is_terminal) as progress:
            task = progress.add_task(label, total=None)
            yield Step(progress=show, cancel=lambda: pressed)
    except Exception:
        if not pressed:
            raise  # else the step failed because it was cancelled
    finally:
        signal.signal(signal.SIGINT, usual)
    if pressed:
        raise KeyboardInterrupt
