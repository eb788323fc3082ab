"""Files of matrices between points from files: what is to be written, and what was."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from app.cli.output import Output, print_json
from app.cli.summary import print_bound, print_size

if TYPE_CHECKING:
    from app.cli.point_file import Points
    from geodesic_core import TriangleMesh


@dataclass(frozen=True)
class MatrixToWrite:
    """A matrix that is to be written."""

    out: Path
    mesh: "TriangleMesh"
    sources: "Points"
    targets: "Points | None"
    """None where they are the sources"""
    accuracy: Mapping[str, Any]
    """The method, and its allowed error or its effort"""
    max_distance: float | None
    barriers: Sequence[int]
    dtype: Literal["float64", "float32"]


class WrittenMatrix(NamedTuple):
    """A matrix that was written."""

    shape: tuple[int, int]
    error_bound: Mapping[str, Any]
    sha256: str
    continued: int | None = None
    """Sweeps that a stopped command had done before; None where a service does them"""


def write_facts(out: Path, facts: Mapping[str, Any]) -> None:
    """Write beside a matrix what it is, as the library does."""
    beside = out.with_name(f"{out.name}.json")
    beside.write_text(json.dumps(dict(facts), indent=1) + "\n")


def as_members(points: "Points") -> Any:
    """Return points as members of a request."""
    if isinstance(points, str):
        return points
    return [
        {"face": point.face_index, "barycentric": point.barycentric}
        if point.vertex_index is None
        else point.vertex_index
        for point in points
    ]


def print_written(
    output: Output, wanted: MatrixToWrite, written: WrittenMatrix, read_seconds: float
) -> None:
    """Print what was written, and how long the mesh took to read."""
    if output.as_json:
        facts = {name: fact for name, fact in written._asdict().items() if fact is not None}
        print_json({**facts, "written": str(wanted.out)})
    sources, targets = written.shape
    print_size(output, wanted.mesh)
    output.say(f"matrix      {sources} by {targets}")
    if written.continued:
        sweeps = min(sources, targets)
        output.say(f"continued   {written.continued} of {sweeps} sweeps were done before")
    print_bound(output, written.error_bound)
    output.say(f"sha256      {written.sha256}")
    output.say(f"took        {read_seconds:.3f} s to read")
    output.say(f"written     {wanted.out}")
