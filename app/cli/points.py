"""Points as options name them."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from app.cli.labels import Label

if TYPE_CHECKING:
    from geodesic_core import TriangleMesh


@dataclass(frozen=True)
class Point:
    """A point of the mesh, as it was written and as it was parsed."""

    text: str
    point: Any

    @classmethod
    def parse(cls, text: str) -> "Point":
        """Return the point that an option names."""
        from app.queries.point_text import parse

        _refuse_label(text)
        try:
            return cls(text, parse(text))
        except ValueError as error:
            raise typer.BadParameter(str(error)) from None

    def as_json(self) -> dict[str, Any]:
        """Return the point as a member of a request."""
        return dict(vars(self.point))


@dataclass(frozen=True)
class PointOrCurve:
    """A point, or the points of a curve, as they were written."""

    points: Sequence[Point]

    @classmethod
    def parse(cls, text: str) -> "PointOrCurve":
        """Return the point or the curve that an option names."""
        _refuse_label(text)
        return cls([Point.parse(part) for part in text.split("/")])

    def as_json(self) -> dict[str, Any]:
        """Return the point or the curve as a member of a request."""
        parts = [point.as_json() for point in self.points]
        return parts[0] if len(parts) == 1 else {"polyline": parts}


@dataclass(frozen=True)
class PointOrLabel:
    """A point or a curve, or all vertices of a label."""

    written: PointOrCurve | Label

    @classmethod
    def parse(cls, text: str) -> "PointOrLabel":
        """Return the point, the curve or the label that an option names."""
        return cls(Label.parse(text) or PointOrCurve.parse(text))

    def on(self, mesh: "TriangleMesh") -> Sequence[PointOrCurve]:
        """Return the point or the curve itself, or the vertices of a mesh that are in the label."""
        if isinstance(self.written, PointOrCurve):
            return [self.written]
        return [PointOrCurve.parse(str(vertex)) for vertex in self.written.vertices(mesh)]


@dataclass(frozen=True)
class WrittenCurve:
    """A curve, as it was written, or a line of a file."""

    text: str
    curve: dict[str, Any]

    def as_json(self) -> dict[str, Any]:
        """Return the curve as a member of a request."""
        return self.curve


@dataclass(frozen=True)
class Curves:
    """A curve, or all lines of a file."""

    curves: Sequence[WrittenCurve]

    @classmethod
    def parse(cls, text: str) -> "Curves":
        """Return the curve that an option names, or the lines of ``@FILE``."""
        if text.startswith("@"):
            return cls([WrittenCurve(text, curve) for curve in _lines_in(Path(text[1:]))])
        points = [point.as_json() for point in PointOrCurve.parse(text).points]
        return cls([WrittenCurve(text, {"polyline": points})])


@dataclass(frozen=True)
class Position:
    """A position in space, as it was written and as it was parsed."""

    text: str
    coordinates: tuple[float, float, float]

    @classmethod
    def parse(cls, text: str) -> "Position":
        """Return the position that an option names."""
        try:
            return cls(text, Point.parse(f"p{text}").point.position)
        except typer.BadParameter:
            raise typer.BadParameter(f"{text!r} is not a position: write it as x,y,z") from None

    def as_json(self) -> tuple[float, float, float]:
        """Return the position as a member of a request."""
        return self.coordinates


@dataclass(frozen=True)
class Direction:
    """A direction at a point, as it was written: an angle, a vector, or a point to look at."""

    text: str
    direction: Any

    @classmethod
    def parse(cls, text: str) -> "Direction":
        """Return the direction that an option names as an angle, or as a vector."""
        try:
            return cls(text, Position.parse(text).coordinates if "," in text else float(text))
        except (ValueError, typer.BadParameter):
            raise typer.BadParameter(
                f"{text!r} is neither an angle in radians nor a vector, written as x,y,z"
            ) from None

    @classmethod
    def to_look_at(cls, text: str) -> "Direction":
        """Return the direction that an option names as a vector, or as a point to look at."""
        try:
            return cls(text, Position.parse(text).coordinates)
        except typer.BadParameter:
            return cls(text, Point.parse(text).as_json())

    def as_json(self) -> Any:
        """Return the direction as a member of a request."""
        return self.direction


def _lines_in(file: Path) -> list[dict[str, Any]]:
    """Return the lines that an answer in JSON has with their locations, as curves of a request."""
    import orjson

    try:
        answer = orjson.loads(file.read_bytes())
    except OSError as error:
        raise typer.BadParameter(f"cannot read {file}: {error.strerror}") from None
    except ValueError as error:
        raise typer.BadParameter(f"{file} is not JSON: {error}") from None
    curves = [
        {"polyline": line["locations"], "closed": line.get("closed", False)}
        for line in _lines_of(answer)
    ]
    if not curves:
        raise typer.BadParameter(
            f"{file} has no lines with locations: write it by path, paths or trace, or with "
            "--locations by isolines, borders, boundaries, loop or straighten"
        )
    return curves


def _lines_of(answer: Any) -> Iterator[dict[str, Any]]:
    """Yield all objects in a JSON value that have locations."""
    if isinstance(answer, dict) and answer.get("locations"):
        yield answer
    elif isinstance(answer, dict | list):
        for each in answer.values() if isinstance(answer, dict) else answer:
            yield from _lines_of(each)


def _refuse_label(text: str) -> None:
    if Label.parse(text) is not None:
        raise typer.BadParameter(
            f"{text!r} is a label; only the sources of distance and isolines may be labels"
        )
