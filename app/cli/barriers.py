"""Barriers as an option names them."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import typer


@dataclass(frozen=True)
class BlockedFaces:
    """The faces that an option lists, or those in a label of the surface."""

    listed: Sequence[int] = ()
    file: Path | None = None
    """Of the label"""
    label: str | None = None
    """The one of several in a file"""

    @classmethod
    def parse(cls, text: str) -> "BlockedFaces":
        """Return the faces that an option lists, those of ``@FILE``, or those in a label there."""
        label = _LABEL.fullmatch(text)
        return cls(faces(text)) if label is None else cls((), Path(label[1]), label[2])

    def of(self, mesh: Any) -> Sequence[int]:
        """Return the faces, of a mesh."""
        if self.file is None:
            return self.listed
        from geodesic_core import load_label

        found: Sequence[int] = load_label(self.file, mesh, self.label).tolist()
        return found


_LABEL = re.compile(r"@(.+(?:\.label|\.gii))(?:=(.+))?")


def faces(text: str) -> Sequence[int]:
    """Return the faces that an option lists, or those of ``@FILE``, one or more a line."""
    if not text.startswith("@"):
        return _listed(text)
    try:
        lines = Path(text[1:]).read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise typer.BadParameter(f"cannot read {text[1:]}: {error}") from None
    return [face for line in lines if line.strip() for face in _listed(line.strip())]


def _listed(text: str) -> Sequence[int]:
    if not _FACES.fullmatch(text):
        raise typer.BadParameter(f"{text!r} is not a list of faces: write it as 3,7,40-59")
    found: list[int] = []
    for part in text.split(","):
        first, _, last = part.partition("-")
        run = range(int(first), int(last or first) + 1)
        if not run:
            raise typer.BadParameter(f"{part!r} runs backwards: write it as {last}-{first}")
        found += run
    return found


_FACES = re.compile(r"[0-9]{1,9}(-[0-9]{1,9})?(,[0-9]{1,9}(-[0-9]{1,9})?)*")
