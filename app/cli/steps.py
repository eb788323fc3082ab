"""What commands do before they answer: read a mesh, find points, and show that they are at it."""

import signal
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from time import perf_counter
from types import FrameType
from typing import TYPE_CHECKING, NamedTuple

from app.cli.arguments import Merge, Point, PointOrCurve

if TYPE_CHECKING:
    from geodesic_core import Curve, SurfacePoint, TriangleMesh


class Failure(Exception):  # noqa: N818 - not an error of this program
    """A one-line message for the user, who can do something about it."""


def read(
    mesh_file: Path, merge: Merge, barriers: Sequence[int] | None = None
) -> "tuple[TriangleMesh, float]":
    """Return the mesh of a file, with its barriers.

    Also the seconds that took once the kernels were there.
    """
    with showing("Loading kernels (compiled on the first run)"):
        from geodesic_core import load_mesh, warm_up

        warm_up()
    with showing(f"Reading {mesh_file.name}"):
        start = perf_counter()
        mesh = load_mesh(mesh_file, merge=merge.value).with_barriers(barriers or ())
        seconds = perf_counter() - start
    return mesh, seconds


def point_of(mesh: "TriangleMesh", option: str, written: Point) -> "SurfacePoint":
    """Return the point of the mesh that an option names."""
    from app.queries.points import resolve_point
    from geodesic_core.errors import InvalidPoint

    try:
        return resolve_point(mesh, written.point)
    except InvalidPoint as error:
        raise Failure(f"{option} {written.text}: {error}") from None


def origin_of(mesh: "TriangleMesh", option: str, written: PointOrCurve) -> "SurfacePoint | Curve":
    """Return the point or the curve that an option names."""
    points = [point_of(mesh, option, point) for point in written.points]
    if len(points) == 1:
        return points[0]
    from itertools import pairwise

    from geodesic_core import Curve, share_a_face

    for i, (start, end) in enumerate(pairwise(points)):
        if not share_a_face(mesh, start, end):
            raise Failure(
                f"{option} {written.text}: the points {i} and {i + 1} of the curve, {start} and "
                f"{end}, have no face in common"
            )
    return Curve(points)


class Step(NamedTuple):
    """How a step reports its progress, and learns that Ctrl-C was pressed."""

    progress: Callable[[float], None]
    cancel: Callable[[], bool]


@contextmanager
def showing(label: str) -> Iterator[Step]:
    """Show a bar on standard error, where that is a terminal, until the step is over.

    Ctrl-C ends the step at its next look-up: a KeyboardInterrupt that is raised in the midst of
    importing or of calling compiled code gets lost there, or becomes a SystemError. Pressed again,
    it works as usual.
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
    try:
        with Progress(console=console, transient=True, disable=not console.is_terminal) as progress:
            task = progress.add_task(label, total=None)
            yield Step(
                progress=lambda share: progress.update(task, total=1.0, completed=share),
                cancel=lambda: pressed,
            )
    except Exception:
        if not pressed:
            raise  # else it is what the step made of being cancelled
    finally:
        signal.signal(signal.SIGINT, usual)
    if pressed:
        raise KeyboardInterrupt
