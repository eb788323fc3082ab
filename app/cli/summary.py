"""Lines of summaries that several commands print."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from app.cli.ask import Answered
from app.cli.output import Output

if TYPE_CHECKING:
    from geodesic_core import TriangleMesh


def print_size(output: Output, mesh: "TriangleMesh") -> None:
    """Print the size of the mesh."""
    output.say(f"mesh        {len(mesh.vertices)} vertices, {len(mesh.faces)} faces")


def print_bound(output: Output, bound: Mapping[str, Any]) -> None:
    """Print an error bound."""
    output.say(f"error bound {bound_in_words(bound)}")


def bound_in_words(bound: Mapping[str, Any]) -> str:
    """Return an error bound, as the lines of commands state it."""
    return f"{bound['value']!r} ({bound['type']}, {bound['kind']})"


def print_seconds(output: Output, answered: Answered) -> None:
    """Print the seconds that a query took."""
    read, solve = answered.read_seconds, answered.solve_seconds
    output.say(f"took        {read:.3f} s to read, {solve:.3f} s to solve")


def print_end(output: Output, answered: Answered) -> None:
    """Print the seconds that a query took, and where its answer is."""
    print_seconds(output, answered)
    output.say_written()
