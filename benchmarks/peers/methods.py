"""Methods of distances from one source, ours and others': functions that prepare a mesh."""

import subprocess
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from geodesic_core.arrays import Floats, Ints

Query = Callable[[int], Floats]
"""Function that returns the distances of all vertices from a source"""
Prepare = Callable[[Floats, Ints], Query]


@dataclass(frozen=True)
class Method:
    """A method, and the package that it needs."""

    name: str
    prepare: Prepare
    package: str
    is_exact: bool = False

    @property
    def is_installed(self) -> bool:
        """Tell whether its package is there."""
        return find_spec(self.package) is not None


def _ours(vertices: Floats, faces: Ints, solve: str, **options: object) -> Query:
    import geodesic_core as gc

    solver = gc.Solver(gc.TriangleMesh(vertices, faces))
    return lambda source: getattr(solver, solve)(source, **options).distances


def _pygeodesic(vertices: Floats, faces: Ints) -> Query:
    import pygeodesic.geodesic as peer

    algorithm = peer.PyGeodesicAlgorithmExact(vertices, faces)
    return lambda source: algorithm.geodesicDistances(np.array([source]), None)[0]


def _heat(vertices: Floats, faces: Ints, *, robust: bool) -> Query:
    import potpourri3d as peer

    solver = peer.MeshHeatMethodDistanceSolver(vertices, faces, use_robust=robust)
    query: Query = solver.compute_distance
    return query


def _marching(vertices: Floats, faces: Ints) -> Query:
    import potpourri3d as peer

    solver = peer.MeshFastMarchingDistanceSolver(vertices, faces)
    return lambda source: solver.compute_distance([[(source, [])]])


def _igl(vertices: Floats, faces: Ints) -> Query:
    import igl

    triangles, every = faces.astype(np.int64), np.arange(len(vertices))
    none = np.empty(0, np.int64)

    def query(source: int) -> Floats:
        found = igl.exact_geodesic(vertices, triangles, np.array([source]), none, every, none)
        return np.asarray(found).reshape(-1)

    return query


def _dijkstra(vertices: Floats, faces: Ints) -> Query:
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import dijkstra

    starts, ends = faces.reshape(-1), np.roll(faces, -1, axis=1).reshape(-1)
    edges = np.unique(np.sort(np.stack([starts, ends], axis=1), axis=1), axis=0)
    lengths = np.linalg.norm(vertices[edges[:, 0]] - vertices[edges[:, 1]], axis=1)
    graph = csr_array((lengths, edges.T), shape=(len(vertices), len(vertices)))
    return lambda source: dijkstra(graph, directed=False, indices=source)


def _meshlib(vertices: Floats, faces: Ints) -> Query:
    from meshlib import mrmeshnumpy, mrmeshpy

    mesh = mrmeshnumpy.meshFromFacesVerts(faces, vertices)

    def query(source: int) -> Floats:
        start = mrmeshpy.MeshTriPoint(mesh.topology, mrmeshpy.VertId(source))
        field = mrmeshpy.computeSurfaceDistances(mesh, start)
        return np.array([field.vec[i] for i in range(len(vertices))], float)

    return query


def _command(vertices: Floats, faces: Ints, command: str) -> Query:
    """Return a query to an executable, see `executable`."""
    import trimesh

    folder = tempfile.TemporaryDirectory()  # is there as long as the query
    trimesh.Trimesh(vertices, faces, process=False).export(Path(folder.name, "mesh.obj"))

    def query(source: int) -> Floats:
        mesh = Path(folder.name, "mesh.obj")
        ran = subprocess.run([command, mesh, str(source)], capture_output=True, check=True)
        return np.array(ran.stdout.split(), float)

    return query


def executable(name: str, command: str) -> Method:
    """Return the method of an executable.

    It is run as ``COMMAND mesh.obj SOURCE`` and prints a distance for each vertex, in their order.
    Reading the mesh counts as its query.
    """
    return Method(name, partial(_command, command=command), "subprocess")


def _near(error: float) -> Method:
    solve = partial(_ours, solve="approximate_distance", relative_error=error)
    return Method(f"approximate {100 * error:g} %", solve, "geodesic_core")


def _fast(effort: int) -> Method:
    solve = partial(_ours, solve="fast_distance", effort=effort, retain="distances")
    return Method(f"fast {effort}", solve, "geodesic_core")


METHODS: Mapping[str, Method] = {
    method.name: method
    for method in (
        Method("exact", partial(_ours, solve="exact_distance"), "geodesic_core", is_exact=True),
        *(_near(error) for error in (1e-4, 1e-3, 1e-2)),
        *(_fast(effort) for effort in (1, 2, 4, 8)),
        Method("pygeodesic", _pygeodesic, "pygeodesic", is_exact=True),
        Method("libigl exact", _igl, "igl", is_exact=True),
        Method("heat", partial(_heat, robust=False), "potpourri3d"),
        Method("heat, robust", partial(_heat, robust=True), "potpourri3d"),
        Method("fast marching", _marching, "potpourri3d"),
        Method("meshlib", _meshlib, "meshlib"),
        Method("Dijkstra on edges", _dijkstra, "scipy"),
    )
}
OURS = tuple(name for name, method in METHODS.items() if method.package == "geodesic_core")
