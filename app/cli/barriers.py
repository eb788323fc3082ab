"""Barriers as an option names them."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any

import typer

from app.cli.text_file import lines_of


@dataclass(frozen=True)
class BlockedFaces:
    """The faces that an option lists, or those in a label of the surface."""

    runs: Sequence[range] = ()
    """Ranges of faces, not listed one by one: a range may be longer than any mesh"""
    file: Path | None = None
    """Of the label"""
    label: str | None = None
    """The one of several in a file"""

    @classmethod
    def parse(cls, text: str) -> "BlockedFaces":
        """Return the faces that an option lists, those of ``@FILE``, or those in a label there."""
        label = _LABEL.fullmatch(text)
        return cls(_runs(text)) if label is None else cls((), Path(label[1]), label[2])

    def of(self, mesh: Any) -> Sequence[int]:
        """Return the faces of a mesh that are blocked."""
        if self.file is None:
            return self._listed(len(mesh.faces))
        from geodesic_core import load_label

        found: Sequence[int] = load_label(self.file, mesh, self.label).tolist()
        return found

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


_LABEL = re.compile(r"@(.+(?:\.label|\.gii))(?:=(.+))?")


def _runs(text: str) -> Sequence[range]:
    """Return the faces that an option lists, or those of ``@FILE``, one or more a line."""
    if not text.startswith("@"):
        return _runs_of_line(text)
    lines = map(str.strip, lines_of(Path(text[1:])))
    return [run for line in lines if line for run in _runs_of_line(line)]


def _runs_of_line(text: str) -> Sequence[range]:
    if not _FACES.fullmatch(text):
        raise typer.BadParameter(f"{text!r} is not a list of faces: write it as 3,7,40-59")
    return [_run(part) for part in text.split(",")]


def _run(text: str) -> range:
    first, _, last = text.partition("-")
    run = range(int(first), int(last or first) + 1)
    if not run:
        raise typer.BadParameter(f"{text!r} runs backwards: write it as {last}-{first}")
    return run


_FACES = re.compile(r"[0-9]{1,9}(-[0-9]{1,9})?(,[0-9]{1,9}(-[0-9]{1,9})?)*")
