"""A mesh cut along curves: a new mesh, and the way back to the old one."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from numpy.typing import NDArray

import geodesic_core as gc
from app.encoding import JSON, Answer, Surface
from app.queries.base import ExecutionContext, Query
from app.queries.cost_model import PER_FACE_STORED, PER_POINT
from app.queries.points import SurfacePoints, points_in_curves, split_points, to_curves
from app.queries.validation import FAULTS_SHOWN, WrittenPoints, naming
from app.schemas.requests import CutRequest
from app.store.meshes import CUT_ARRAYS, OpenMesh, content_hash


class CutQuery(Query[CutRequest]):
    """The mesh cut along ``curves``."""

    kind = "cut"
    model = CutRequest
    offers = (JSON,)

    def written_points(self) -> WrittenPoints:
        """Yield the points of all curves."""
        return points_in_curves(self.request.curves)

    def rough_seconds(self) -> float:
        """Return the cost of the points, and of a new mesh."""
        points = sum(len(curve.polyline) for curve in self.request.curves)
        return PER_POINT * points + PER_FACE_STORED * self.size.faces

    def solve(self, opened: OpenMesh, points: SurfacePoints, context: ExecutionContext) -> Answer:
        """Cut the mesh; the answer is that of a service, with the mesh and its arrays as views."""
        cut, about = self._cut(opened, points, context)
        arrays = {**cut.mesh.arrays(), **arrays_of(cut)}
        own = {"faces", "lengths", *CUT_ARRAYS}
        if opened.mesh.has_positions:
            own.add("vertices")
        return replace(
            self.told(content_hash(arrays, self.mesh_id), about),
            surface=Surface(cut.vertices, cut.faces),
            named={name: array for name, array in arrays.items() if name in own},
        )

    def make(
        self, opened: OpenMesh, context: ExecutionContext
    ) -> tuple[gc.CutMesh, dict[str, Any]]:
        """Return the cut mesh, and what the answer tells of it; raises as `answer`."""
        points = self.resolved(opened.mesh, context.cancel)
        return self._cut(self.noted(opened, points), points, context)

    def told(self, mesh_id: str, about: Mapping[str, Any]) -> Answer:
        """Return the answer that names the new mesh, once that is stored."""
        names = {"kind": self.kind, "mesh_id": self.mesh_id, "cut_mesh_id": mesh_id}
        return Answer({**names, **about})

    def _cut(
        self, opened: OpenMesh, points: SurfacePoints, context: ExecutionContext
    ) -> tuple[gc.CutMesh, dict[str, Any]]:
        given = split_points(self.request.curves, points)
        curves = to_curves(opened.mesh, self.request.curves, given)
        with naming((gc.errors.InvalidMesh, "/curves")):
            cut = gc.cut(opened.mesh, curves, self.request.separate, **context.options)
        about = self.members(
            opened,
            vertices=len(cut.vertices),
            faces=len(cut.faces),
            parts=int(cut.parts.max()) + 1,
            snapped={"count": len(cut.snapped), "ids": cut.snapped[:FAULTS_SHOWN].tolist()},
        )
        return cut, about


def arrays_of(cut: gc.CutMesh) -> Mapping[str, NDArray[Any]]:
    """Return the arrays that lead from a cut mesh back to the old one, by name."""
    return {name: getattr(cut, name) for name in CUT_ARRAYS}
