"""Exact paths between random pairs: against our full sweeps, against peers, and without landmarks.

One of the peers, meshlib, is not among the packages of the group `bench`, since its licence is for
evaluation and non-commercial use only: ``pip install meshlib`` adds its columns.
"""

from collections.abc import Iterator
from functools import partial
from itertools import islice
from statistics import median
from typing import Any, NamedTuple

import numpy as np
import potpourri3d

import geodesic_core as gc
from benchmarks.inputs import Inputs
from benchmarks.tables import Section, rated
from benchmarks.timing import timed
from geodesic_core.arrays import Floats, Ints
from geodesic_core.fields.path import SearchStep
from geodesic_core.kernels.front.bounds import LANDMARKS
from geodesic_core.mesh.surface_curve import length_of
from geodesic_core.tolerances import LANDMARK_ERROR

try:
    from meshlib import mrmeshnumpy, mrmeshpy
except ImportError:
    mrmeshnumpy = mrmeshpy = None

SEED = 4
PAIRS = 8
"""Far pairs for each of the runs."""

NEAR_PAIRS = 20
FAR = (0.4, 2.0)
"""Straight distance of far pairs, as a share of the model's largest extent."""

NEAR = 0.05
"""Length of the paths between near pairs, at most, as the same share."""


class Asked(NamedTuple):
    """The far pairs of a mesh, and the targets of their paths."""

    faster: float | None = None
    """Times faster than full sweeps, by the medians."""
    each_faster: float | None = None
    slowest_ms: float | None = None
    apart: tuple[float, float] = FAR
    swept: int = PAIRS
    """Number of pairs, for each of the runs, that a full sweep follows."""


LARGEST = Asked(slowest_ms=300.0, apart=(0.45, 0.55), swept=1)
SMOOTH, ROUGH = "horse97k.ply, Loop", "dragon100k.ply, split"
MESHES = {
    SMOOTH: Asked(faster=15.0, each_faster=2.5),
    ROUGH: Asked(faster=5.0, each_faster=2.5),
    "dragon100k.ply": Asked(),
    "armadillo86k.ply": Asked(),
    "armadillo86k.ply, Loop, Loop": LARGEST,
}
NEAR_MS = 2.0
FLIPS = 1.0
"""Times faster than edge flips, at least."""
FEWER = 2.0
"""Times fewer faces that step 2 visits with landmarks, at least."""

FAST_MESHES = (
    SMOOTH,
    "fandisk.obj, Loop, Loop",
    "horse97k.ply",
    "bunny.obj",
    "buddha30k.ply",
    "teapot.obj",
)
FAST_MS, MEAN_EXCESS, LARGEST_EXCESS = 25.0, 0.05, 1.0
"""Of fast paths: milliseconds of 90 % of them, and per cent by which they are too long."""

Pair = tuple[int, int]


class EdgeFlips:
    """potpourri3d's paths: from edges, straightened by intrinsic flips; only locally shortest."""

    def __init__(self, vertices: Floats, faces: Ints) -> None:
        self._solver = potpourri3d.EdgeFlipGeodesicSolver(vertices, faces)

    def find(self, source: int, target: int) -> Any:
        """Return a path in the peer's own form."""
        return self._solver.find_geodesic_path(source, target)

    def points(self, found: Any) -> Floats:
        """Return the points of a path."""
        points: Floats = found
        return points


class AStar:
    """meshlib's paths: by A* along edges, then straightened; only locally shortest."""

    def __init__(self, vertices: Floats, faces: Ints) -> None:
        self._mesh = mrmeshnumpy.meshFromFacesVerts(faces, vertices)

    def find(self, source: int, target: int) -> Any:
        """Return the ends of a path, and its crossings of edges between them."""
        topology = self._mesh.topology
        ends = [mrmeshpy.MeshTriPoint(topology, mrmeshpy.VertId(v)) for v in (source, target)]
        way = mrmeshpy.GeodesicPathApprox.DijkstraAStar
        return ends, mrmeshpy.computeGeodesicPath(self._mesh, *ends, way)

    def points(self, found: Any) -> Floats:
        """Return the points of a path."""
        (first, last), crossings = found
        mesh = self._mesh
        points = [mesh.triPoint(first), *map(mesh.edgePoint, crossings), mesh.triPoint(last)]
        return np.array([(point.x, point.y, point.z) for point in points])


def run(inputs: Inputs, runs: int) -> Section:
    """Time paths of a new solver, then of one with its landmarks, by turns with full sweeps."""
    gc.warm_up()
    rows = [_row(name, vertices, faces, runs) for name, vertices, faces in inputs.arrays(MESHES)]
    return Section(
        "Paths between two points",
        f"`Solver.shortest_path` end to end on a prepared mesh, one thread, milliseconds, random "
        f"pairs. Far pairs lie {FAR[0]:g} of the model's largest extent apart or more, on the "
        f"largest mesh about half; the paths of near pairs are shorter than {NEAR:g} of it. The "
        f"first far pairs are asked of a new solver, until it has its {LANDMARKS} landmarks: after "
        f"{LANDMARKS} of these answers a landmark is added, which counts with the request. Then "
        f"{PAIRS * runs} other far pairs, by turns with full sweeps, `exact_distance` from the "
        f"pair's source (on the largest mesh for {LARGEST.swept * runs} of them): how many times "
        f"faster by the medians, and for one pair at least; how far the length is from the "
        f"sweep's distance, relatively, at most.",
        [
            "mesh",
            "faces",
            "first pairs",
            "median",
            "slowest",
            "far: median",
            "slowest",
            "sweep",
            "times faster",
            "the least",
            "near: median",
            "slowest",
            "largest difference",
        ],
        rows,
    )


def run_peers(inputs: Inputs, runs: int) -> Section:
    """Compare times and lengths of far paths with those of peers, by turns."""
    gc.warm_up()
    rows = [
        _row_of_peers(name, vertices, faces, runs)
        for name, vertices, faces in inputs.arrays((SMOOTH, ROUGH))
    ]
    return Section(
        "Paths against peers",
        f"{PAIRS * runs} random far pairs, one thread, medians in milliseconds, by turns in one "
        f"process; our solver has its landmarks, and the peers are built once. Edge flips are "
        f"potpourri3d's `EdgeFlipGeodesicSolver`, A* is meshlib's `computeGeodesicPath` by "
        f"`DijkstraAStar`, in single precision. Their paths are only locally shortest: the largest "
        f"excess over ours is given.",
        [
            "mesh",
            "faces",
            "ours",
            "edge flips",
            "times faster",
            "longer, %",
            "A*",
            "times faster",
            "longer, %",
        ],
        rows,
    )


def run_fast(inputs: Inputs, runs: int) -> Section:
    """Compare fast paths with exact ones, by turns, by one solver with its landmarks."""
    gc.warm_up()
    rows = [_row_of_fast(*mesh, runs) for mesh in inputs.arrays(FAST_MESHES)]
    return Section(
        "Fast paths",
        f'`shortest_path(method="fast")` beside the exact search: {5 * PAIRS * runs} random far '
        f"pairs, one thread, by turns, by a solver with its {LANDMARKS} landmarks. Milliseconds: "
        f"the median, and 90 % take no longer. Excess of the length over the exact one, per cent.",
        ["mesh", "faces", "exact", "90 %", "fast", "90 %", "mean excess", "largest"],
        rows,
    )


def run_landmarks(inputs: Inputs, runs: int) -> Section:
    """Compare far paths, and the region of step 2, without and with landmarks."""
    gc.warm_up()
    rows = [
        _row_of_landmarks(name, vertices, faces, runs)
        for name, vertices, faces in inputs.arrays((SMOOTH, ROUGH))
    ]
    return Section(
        "Landmarks",
        f"{PAIRS * runs} random far pairs, medians, by turns: the first path of a new solver, and "
        f"one of a solver that has its {LANDMARKS} landmarks; both without the allocation of "
        f"memory. A landmark costs an approximate sweep of the mesh and four bytes a vertex.",
        [
            "mesh",
            "faces",
            "a landmark, ms",
            "path without, ms",
            "with, ms",
            "faces in step 2 without",
            "with",
            "times fewer",
        ],
        rows,
    )


def _row(name: str, vertices: Floats, faces: Ints, runs: int) -> list[str]:
    asked = MESHES[name]
    mesh = gc.TriangleMesh(vertices, faces)
    rng = np.random.default_rng(SEED)
    far = _pairs(mesh, rng, *asked.apart)
    solver = gc.Solver(mesh)
    first_s = _add_landmarks(solver, far)
    ours_s, sweeps_s, differences = [], [], []
    for i, (source, target) in enumerate(islice(far, PAIRS * runs)):
        seconds, path = timed(partial(solver.shortest_path, source, target))
        ours_s.append(seconds)
        if i < asked.swept * runs:
            seconds, field = timed(partial(gc.exact_distance, mesh, source))
            sweeps_s.append(seconds)
            differences.append(abs(path.length / field.distances[target] - 1.0))
    near_s = _near_seconds(solver, rng)
    least = min(sweep_s / path_s for path_s, sweep_s in zip(ours_s, sweeps_s, strict=False))
    return [
        name,
        f"{len(faces):,}",
        f"{len(first_s)}",
        f"{1e3 * median(first_s):.1f}",
        f"{1e3 * max(first_s):.0f}",
        f"{1e3 * median(ours_s):.1f}",
        rated(1e3 * max(ours_s), asked.slowest_ms, at_least=False, digits=1),
        f"{1e3 * median(sweeps_s):.0f}",
        rated(median(sweeps_s) / median(ours_s), asked.faster, at_least=True, digits=1),
        rated(least, asked.each_faster, at_least=True, digits=1),
        rated(1e3 * median(near_s), NEAR_MS, at_least=False),
        rated(1e3 * max(near_s), NEAR_MS, at_least=False),
        f"{max(differences):.1e}",
    ]


def _row_of_peers(name: str, vertices: Floats, faces: Ints, runs: int) -> list[str]:
    mesh = gc.TriangleMesh(vertices, faces)
    far = _pairs(mesh, np.random.default_rng(SEED), *FAR)
    solver = gc.Solver(mesh)
    _add_landmarks(solver, far)
    peers = [kind(vertices, faces) for kind in (EdgeFlips, AStar) if kind is EdgeFlips or mrmeshpy]
    ours_s: list[float] = []
    theirs_s: list[list[float]] = [[] for _ in peers]
    longer: list[list[float]] = [[] for _ in peers]
    for pair in islice(far, PAIRS * runs):
        seconds, path = timed(partial(solver.shortest_path, *pair))
        ours_s.append(seconds)
        for i, peer in enumerate(peers):
            seconds, found = timed(partial(peer.find, *pair))
            theirs_s[i].append(seconds)
            longer[i].append(length_of(peer.points(found)) / path.length - 1.0)
    row = [name, f"{len(faces):,}", f"{1e3 * median(ours_s):.1f}"]
    for i, target in enumerate((FLIPS, None)[: len(peers)]):
        faster = median(theirs_s[i]) / median(ours_s)
        row += [
            f"{1e3 * median(theirs_s[i]):.1f}",
            rated(faster, target, at_least=True),
            f"{100 * max(longer[i]):.2f}",
        ]
    return row if len(peers) == 2 else [*row, "", "", ""]


def _row_of_fast(name: str, vertices: Floats, faces: Ints, runs: int) -> list[str]:
    mesh = gc.TriangleMesh(vertices, faces)
    far = _pairs(mesh, np.random.default_rng(SEED), *FAR)
    solver = gc.Solver(mesh)
    _add_landmarks(solver, far)
    exact_ms, fast_ms, excess = [], [], []
    for pair in islice(far, 5 * PAIRS * runs):
        exact_s, exact = timed(partial(solver.shortest_path, *pair))
        fast_s, fast = timed(partial(solver.shortest_path, *pair, method="fast"))
        exact_ms.append(1e3 * exact_s)
        fast_ms.append(1e3 * fast_s)
        excess.append(100.0 * (fast.length / exact.length - 1.0))
    return [
        name,
        f"{len(faces):,}",
        f"{median(exact_ms):.1f}",
        f"{np.quantile(exact_ms, 0.9):.1f}",
        f"{median(fast_ms):.1f}",
        rated(float(np.quantile(fast_ms, 0.9)), FAST_MS, at_least=False, digits=1),
        rated(float(np.mean(excess)), MEAN_EXCESS, at_least=False, digits=4),
        rated(max(excess), LARGEST_EXCESS, at_least=False, digits=3),
    ]


def _row_of_landmarks(name: str, vertices: Floats, faces: Ints, runs: int) -> list[str]:
    mesh = gc.TriangleMesh(vertices, faces)
    far = _pairs(mesh, np.random.default_rng(SEED), *FAR)
    solver = gc.Solver(mesh)
    _add_landmarks(solver, far)
    landmarks_s = [
        timed(partial(gc.approximate_distance, mesh, source, LANDMARK_ERROR))[0]
        for source, _ in islice(far, runs)
    ]
    without, having = [], []
    for pair in islice(far, PAIRS * runs):
        without.append(_steps(gc.Solver(mesh), pair))
        having.append(_steps(solver, pair))
    without_s, having_s = (
        median(sum(step.seconds for step in steps.values()) for steps in some)
        for some in (without, having)
    )
    faces_without, faces_having = (
        median(len(steps["approximate"].faces) for steps in some) for some in (without, having)
    )
    return [
        name,
        f"{len(faces):,}",
        f"{1e3 * median(landmarks_s):.0f}",
        f"{1e3 * without_s:.1f}",
        f"{1e3 * having_s:.1f}",
        f"{faces_without:,.0f}",
        f"{faces_having:,.0f}",
        rated(faces_without / faces_having, FEWER, at_least=True),
    ]


def _pairs(
    mesh: gc.TriangleMesh, rng: np.random.Generator, least: float, most: float
) -> Iterator[Pair]:
    """Yield random connected pairs with a straight distance within shares of the extent."""
    positions, components = mesh.vertices, mesh.components
    while True:
        some = rng.integers(0, len(positions), (10_000, 2))
        here, there = some.T
        apart = np.linalg.norm(positions[here] - positions[there], axis=1) / _extent(mesh)
        fits = (least <= apart) & (apart <= most) & (components[here] == components[there])
        yield from map(tuple, some[fits & (here != there)].tolist())


def _extent(mesh: gc.TriangleMesh) -> float:
    return float(np.ptp(mesh.vertices, axis=0).max())


def _add_landmarks(solver: gc.Solver, far: Iterator[Pair]) -> list[float]:
    """Ask for paths until the solver has all its landmarks; return the seconds of each."""
    seconds = []
    for pair in far:
        seconds.append(timed(partial(solver.shortest_path, *pair))[0])
        # Nobody else needs to know how many landmarks there are.
        if solver._workspace.path_search()._landmarks.count == LANDMARKS:
            break
    return seconds


def _near_seconds(solver: gc.Solver, rng: np.random.Generator) -> list[float]:
    """Return the seconds of short paths: points that are near may be so only across a gap."""
    longest = NEAR * _extent(solver.mesh)
    near = _pairs(solver.mesh, rng, 0.0, NEAR)
    calls = (timed(partial(solver.shortest_path, *pair)) for pair in near)
    return list(islice((seconds for seconds, path in calls if path.length <= longest), NEAR_PAIRS))


def _steps(solver: gc.Solver, pair: Pair) -> dict[str, SearchStep]:
    steps = solver.shortest_path(*pair, explain=True).steps or ()
    return {step.name: step for step in steps}
