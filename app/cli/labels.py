"""Labels of brain surfaces as options name them."""

import re
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from app.cli.words import say_warning

if TYPE_CHECKING:
    from geodesic_core import TriangleMesh

_LABEL = re.compile(
    r"(?P<outside>outside)?@(?P<file>.+\.(?:label|annot|gii)(?:\.gz)?)(?:=(?P<name>.+))?",
    re.IGNORECASE,
)


@dataclass(frozen=True)
class Label:
    """A label in a file, or what is outside of it."""

    text: str
    """As it was written"""
    file: Path
    name: str | None
    """The one of several in a file"""
    outside: bool

    @classmethod
    def parse(cls, text: str) -> "Label | None":
        """Return the label that an option names; None where it names something else."""
        found = _LABEL.fullmatch(text)
        if found is None:
            return None
        return cls(text, Path(found["file"]), found["name"], found["outside"] is not None)

    def faces(self, mesh: "TriangleMesh") -> Sequence[int]:
        """Return the faces of a mesh that lie in the label; warn where there is none."""
        from geodesic_core import load_label
        from geodesic_core.errors import EmptyBarrier

        with warnings.catch_warnings(record=True, action="always") as told:
            faces = load_label(self.file, mesh, self.name, outside=self.outside)
        for warning in told:
            if issubclass(warning.category, EmptyBarrier):
                say_warning(str(warning.message))
        return list(map(int, faces))

    def vertices(self, mesh: "TriangleMesh") -> Sequence[int]:
        """Return the vertices of a mesh that are in the label."""
        from geodesic_core import load_label_vertices

        vertices = load_label_vertices(self.file, mesh, self.name, outside=self.outside)
        return list(map(int, vertices))
