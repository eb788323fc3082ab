"""Queries asked in this process: the same answers as the service's, without its limits."""

from collections.abc import Mapping, Sequence
from time import perf_counter
from typing import TYPE_CHECKING, Any, NamedTuple

from app.cli.barriers import BlockedFaces
from app.cli.points import (
    Curves,
    Direction,
    Point,
    PointOrCurve,
    PointOrLabel,
    Position,
    WrittenCurve,
)
from app.cli.steps import Failure, MeshInput, read, showing
from app.cli.words import say_warning, words_of

if TYPE_CHECKING:
    from pydantic import ValidationError

    from app.encoding import Answer
    from app.errors import Problem
    from geodesic_core import TriangleMesh

Written = Point | PointOrCurve | WrittenCurve | Position | Direction
Several = PointOrLabel | Curves
"""What an option names at once"""
WrittenMembers = Mapping[str, Written | Sequence[Written] | Sequence[Several]]
"""Points by the member of the request that they become."""

_OPTIONS = {
    "sources": "--source",
    "targets": "--target",
    "waypoints": "--via",
    "candidates": "--candidate",
    "points": "--at",
    "levels": "--level",
    "starts": "--from",
    "weights": "--weight",
    "directions": "--direction",
    "lengths": "--length",
    "curves": "--along",
}
"""Options whose names differ from their members."""


class Answered(NamedTuple):
    """An answer, the mesh of the query, and the seconds of reading and of solving."""

    answer: "Answer"
    mesh: "TriangleMesh"
    read_seconds: float
    solve_seconds: float


def ask(
    kind: str,
    mesh: MeshInput,
    label: str,
    points: WrittenMembers,
    members: Mapping[str, Any],
) -> Answered:
    """Return the answer to a query of a kind, whose request has these points and other members.

    Shows a bar with the ``label`` while solving, and prints the warnings of the answer. Raises
    `Failure` where the service would refuse the query, and as the solver does.
    """
    opened, read_seconds = read(mesh)
    from pydantic import ValidationError

    from app.errors import ProblemError
    from app.queries import KINDS, ExecutionContext, MeshSize

    report = opened.mesh.report
    size = MeshSize(report.vertices, report.faces, report.mean_edge_length)
    query_class = KINDS[kind]
    written = {name: _on_mesh(value, opened.mesh) for name, value in points.items()}
    body = {name: _as_json(value) for name, value in written.items()} | dict(members)
    if isinstance(blocked := body.get("barriers"), BlockedFaces):
        body["barriers"] = blocked.of(opened.mesh)
    try:
        with showing(label) as step:
            start = perf_counter()
            request = query_class.model.model_validate(body)
            query = query_class.ask(opened.name[0], size, request)
            if len(query.barriers):
                opened = query.with_barriers(opened)
            answer = query.answer(opened, ExecutionContext(step.cancel, step.progress))
            solve_seconds = perf_counter() - start
    except ValidationError as error:
        raise Failure(_first_fault(error)) from None
    except ProblemError as error:
        raise Failure(_message(error.problem, written)) from None
    for warning in answer.members["warnings"]:
        say_warning(warning)
    return Answered(answer, opened.mesh, read_seconds, solve_seconds)


def check(kind: str, **members: Any) -> None:
    """Refuse members of a request that queries of a kind refuse, whatever their points are."""
    from pydantic import ValidationError

    from app.queries import KINDS

    try:
        KINDS[kind].model.model_validate(members)
    except ValidationError as error:
        raise Failure(_first_fault(error)) from None


def _on_mesh(
    written: Written | Sequence[Written] | Sequence[Several], mesh: "TriangleMesh"
) -> Written | Sequence[Written]:
    """Return points that are named by themselves, those of labels and files one by one."""
    if isinstance(written, Written):
        return written
    found: list[Written] = []
    for each in written:
        if isinstance(each, PointOrLabel):
            found += each.on(mesh)
        else:
            found += each.curves if isinstance(each, Curves) else [each]
    return found


def _as_json(written: Written | Sequence[Written]) -> Any:
    if isinstance(written, Written):
        return written.as_json()
    return [each.as_json() for each in written]


def _first_fault(error: "ValidationError") -> str:
    """Return the message for the first member that a model refuses."""
    fault = error.errors(include_url=False)[0]
    return f"{_option_of(str(fault['loc'][0]))} is {fault['input']!r}: {words_of(fault)}"


def _option_of(member: str) -> str:
    return _OPTIONS.get(member, "--" + member.replace("_", "-"))


def _message(problem: "Problem", points: Mapping[str, Written | Sequence[Written]]) -> str:
    """Return the message for a problem, which names the option at fault as it was written."""
    if not problem.errors:
        return problem.detail
    fault = problem.errors[0]
    name, *parts = fault.pointer.removeprefix("/").split("/")
    option = _option_of(name)
    if name in points and (parts or isinstance(points[name], Written)):  # not the whole list
        option += f" {_text_at(points[name], parts)}"
    return f"{option}: {fault.message}"


def _text_at(written: Written | Sequence[Written], parts: list[str]) -> str:
    """Return the point at a pointer as it was written."""
    if not isinstance(written, Written):
        written, parts = written[int(parts[0])], parts[1:]
    if isinstance(written, PointOrCurve):
        written = written.points[int(parts[1]) if parts[0] == "polyline" else 0]
    return written.text
