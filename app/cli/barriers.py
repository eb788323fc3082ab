"""Barriers as an option names them."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any

import typer

from app.cli.labels import Label
from app.cli.text_file import NUMBER, at, columns_in, lines_of, whole


@dataclass(frozen=True)
class BlockedFaces:
    """The faces that an option lists, or those in a label of the surface."""

    runs: Sequence[range] = ()
    """Ranges of faces, not listed one by one: a range may be longer than any mesh"""
    label: Label | None = None

    @classmethod
    def parse(cls, text: str) -> "BlockedFaces":
        """Return the faces that an option lists, those of ``@FILE``, or those in a label there."""
        label = Label.parse(text)
        return cls(_runs(text)) if label is None else cls((), label)

    def of(self, mesh: Any) -> Sequence[int]:
        """Return the faces of a mesh that are blocked."""
        return self._listed(len(mesh.faces)) if self.label is None else self.label.faces(mesh)

    def _listed(self, count: int) -> Sequence[int]:
        """Return the faces, each once, of a mesh with ``count`` faces."""
        from geodesic_core.errors import InvalidArgument

        for run in self.runs:
            if run[-1] >= count:
                face = max(run[0], count)
                raise InvalidArgument(
                    f"--barriers: face {face} does not exist; the indices are 0 to {count - 1}"
                )
        return sorted(set(chain.from_iterable(self.runs)))


def _runs(text: str) -> Sequence[range]:
    """Return the faces that an option lists, or those of ``@FILE``, one or more a line."""
    if text.startswith("outside@"):
        raise typer.BadParameter(f"{text!r} names no label: outside@ goes with labels only")
    if not text.startswith("@"):
        return _runs_of(text, text.split(","))
    lines = lines_of(Path(text[1:]))
    column = None
    if lines and not NUMBER.match(lines[0].text):
        column = columns_in(lines[0], _FACE)
    if column is None:
        return [run for line in lines for run in _runs_of(line.text, _PART.findall(line.text))]
    return [run for line in lines[1:] for run in _runs_of(line.text, at(line, column))]


def _runs_of(text: str, parts: Sequence[str]) -> Sequence[range]:
    parts = list(map(whole, parts))
    if not all(map(_RUN.fullmatch, parts)):
        raise typer.BadParameter(f"{text!r} is not a list of faces: write it as 3,7,40-59")
    return [_run(part) for part in parts]


def _run(text: str) -> range:
    first, _, last = text.partition("-")
    run = range(int(first), int(last or first) + 1)
    if not run:
        raise typer.BadParameter(f"{text!r} runs backwards: write it as {last}-{first}")
    return run


_PART = re.compile(r"[^\s;,]+")
_RUN = re.compile(r"[0-9]{1,9}(-[0-9]{1,9})?")
_FACE = {"face", "faces", "face_id", "faceid", "index", "id", "triangle"}
"""Names of the column of faces in a header"""
