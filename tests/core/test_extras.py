"""Extras: without their packages few calls are refused, and all others answer."""

from importlib.metadata import packages_distributions, requires

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

import geodesic_core as gc
from geodesic_core.errors import MissingExtra
from geodesic_core.extras import extra
from tests.support.fresh import told_by


def not_required() -> list[str]:
    """Return all modules that are installed and that the library, without extras, does not need."""
    wanted, required = ["geodesic-core"], set()
    while wanted:
        name = canonicalize_name(wanted.pop())
        if name not in required:
            required.add(name)
            each = map(Requirement, requires(name) or ())
            wanted += [one.name for one in each if not one.marker or one.marker.evaluate()]
    return sorted(
        module
        for module, names in packages_distributions().items()
        if required.isdisjoint(map(canonicalize_name, names))
    )


def told_without_extras(script: str) -> str:
    """Return what a script prints that has only a mesh, the library and what it requires."""
    return told_by(f"""
import sys
for name in {not_required()!r}:
    sys.modules[name] = None
import numpy as np
import geodesic_core as gc
mesh = gc.samples.plane(8)
{script}
""")


REFUSED = [
    (
        "locate",
        "mesh.locate([0.5, 0.5, 1.0])",
        "TriangleMesh.locate needs libigl: pip install 'geodesic-core[locate]'",
    ),
    *(
        ("terrain", code, f"{call} needs {package}: pip install 'geodesic-core[terrain]'")
        for code, call, package in (
            ("gc.terrain.from_dem('dem.tif')", "from_dem of a file", "rasterio"),
            ("gc.terrain.from_dem(np.eye(2), range(6), crs=32632)", "a CRS", "pyproj"),
            ("gc.terrain.burn(mesh, {}, 2.0)", "burn", "shapely"),
        )
    ),
    *(
        ("plot", f"{thing}()", f"{call} needs PyVista: pip install 'geodesic-core[plot]'")
        for thing, call in (
            ("gc.exact_distance(mesh, 0).plot", "DistanceField.plot"),
            ("gc.shortest_path(mesh, 0, 8).plot", "GeodesicPath.plot"),
            ("gc.shortest_path(mesh, 0, 8).to_pyvista", "GeodesicPath.to_pyvista"),
            ("mesh.to_pyvista", "TriangleMesh.to_pyvista"),
        )
    ),
]
ANSWERED = """
field = gc.exact_distance(mesh, 0, retain="windows")
assert field.path_to(8).length > 0.0
assert field.isolines([0.1])
assert gc.approximate_distance(mesh, 0).gradient.shape == mesh.vertices.shape
assert gc.distance_matrix(mesh, [0, 1], [2, 3]).shape == (2, 2)
assert gc.nearest(mesh, 0, [1, 8]).indices.tolist() == [0]
corners = np.array([[0, 0, 0], [4, 0, 0], [4, 4, 0], [3, 1, 0]], float)
dart = gc.TriangleMesh.from_polygons(corners, [0, 1, 2, 3], [4])
needle = gc.TriangleMesh(corners[[0, 1, 2, 2]], [[0, 1, 2], [1, 3, 2], [0, 1, 3]])
assert needle.report.zero_length_edges.count == 1
import trimesh
shape = trimesh.Trimesh(corners, dart.faces, process=False)
for kind in ("stl", "glb"):
    assert len(gc.load_mesh(trimesh.Scene(shape).export(file_type=kind), kind).faces) == 2
from geodesic_core.compilation import WORKLOADS
for workload in WORKLOADS.values():
    workload()
print("answered")
"""

pytestmark = pytest.mark.slow  # a process each


@pytest.mark.jit
def test_what_is_missing_is_named() -> None:
    catch = "except gc.errors.MissingExtra as error: print(error, error.extra)"
    told = told_without_extras("\n".join(f"try: {call}\n{catch}" for _, call, _ in REFUSED))
    assert told.splitlines() == [f"{message} {name}" for name, _, message in REFUSED]


@pytest.mark.jit
def test_all_else_needs_no_extras() -> None:
    assert told_without_extras(ANSWERED) == "answered\n"


def test_a_missing_extra_is_an_import_error_as_well() -> None:
    with pytest.raises(ImportError) as raised, extra("locate", "libigl", "a call"):
        import no_such_package  # type: ignore[import-not-found]  # noqa: F401, PLC0415
    assert isinstance(raised.value, MissingExtra)
    assert isinstance(raised.value, gc.GeodesicError)
    assert isinstance(raised.value.__cause__, ModuleNotFoundError)
