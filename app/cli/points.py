"""Points as options name them."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import typer


@dataclass(frozen=True)
class Point:
    """A point of the mesh, as it was written and as it was parsed."""

    text: str
    point: Any

    @classmethod
    def parse(cls, text: str) -> "Point":
        """Return the point that an option names."""
        from app.queries.point_text import parse

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
        return cls([Point.parse(part) for part in text.split("/")])

    def as_json(self) -> dict[str, Any]:
        """Return the point or the curve as a member of a request."""
        parts = [point.as_json() for point in self.points]
        return parts[0] if len(parts) == 1 else {"polyline": parts}


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
