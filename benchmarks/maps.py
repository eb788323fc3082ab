"""Log maps and straight lines: what directions cost a sweep, and against potpourri3d.

The last section needs geometry-central's exact log map, a program that
``benchmarks/peers/geometry_central/CMakeLists.txt`` builds; without it the section is left out.
All is of one thread, and counts the processor's seconds, which others on the machine disturb less
than those on the clock.
"""

import math
import subprocess
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

import numpy as np
import potpourri3d

import geodesic_core as gc
from benchmarks import timing
from benchmarks.inputs import Inputs
from benchmarks.tables import Section, rated, verdict
from geodesic_core.arrays import Flags, Floats, Ints

SEED = 5
SOURCE = 0
IN_FACE = gc.SurfacePoint.face(0, (0.5, 0.3, 0.2))
SCANS = ("horse97k.ply", "dragon100k.ply", "armadillo86k.ply", "icosphere 6")
WITH_FIN = ("horse97k.ply", "dragon100k.ply")
"""Also with an edge of three faces, so that windows tell whether their frame is mirrored"""

SMOOTH, ROUGH = "horse97k.ply", "dragon100k.ply"
STRATEGIES = ("VectorHeat", "AffineLocal", "AffineAdaptive")
LINES = 2000
CROSSED = 200
"""Faces that a line crosses, about"""

COST, COST_IN_MIRROR = 1.10, 1.15
"""Time of a log map as a multiple of the sweep's, at most"""
FASTER = 3.0
"""Times faster than potpourri3d's tracer, at least"""
OF_HEAT = 0.1
"""Share of the vector heat method's time to its first log map, at most"""
AGREEMENT = 1e-9
"""Share of the diagonal by which two exact log maps differ, at most"""
PAIRS = 3
"""Pairs of a sweep and a log map, for each of the runs"""

by_turns = partial(timing.by_turns, clock=time.process_time)

GEOMETRY_CENTRAL = Path(__file__).parent / "peers" / "geometry_central" / "build" / "log_map"


def run(inputs: Inputs, runs: int) -> Iterator[Section]:
    """Measure log maps and lines."""
    gc.warm_up()
    yield _costs(inputs, runs)
    yield _lines(inputs, runs)
    yield _against_heat(inputs, runs)
    if GEOMETRY_CENTRAL.exists():
        yield _against_geometry_central(inputs, runs)
    else:
        print(f"{GEOMETRY_CENTRAL.name} of geometry-central: not built, left out")


def _costs(inputs: Inputs, runs: int) -> Section:
    """Compare sweeps that carry directions with those that do not."""
    surfaces = [(*each, COST) for each in inputs.arrays(SCANS)]
    surfaces += [
        (f"{name}, a fin", *with_fin(vertices, faces), COST_IN_MIRROR)
        for name, vertices, faces in inputs.arrays(WITH_FIN)
    ]
    surfaces.append(("Möbius strip", *moebius(451, 60), COST_IN_MIRROR))
    rows = []
    for name, vertices, faces, most in surfaces:
        mesh = gc.TriangleMesh(vertices, faces)
        sweeps_s, maps_s, log_map = timing.paired(
            partial(gc.exact_distance, mesh, SOURCE),
            partial(gc.log_map, mesh, SOURCE),
            PAIRS * runs,
            time.process_time,
        )
        straight = log_map.bends[log_map.bends >= 0] == 0
        rows.append(
            [
                name,
                f"{len(faces):,}",
                f"{1e3 * median(sweeps_s):.1f}",
                f"{1e3 * median(maps_s):.1f}",
                rated(timing.ratio(maps_s, sweeps_s), most, at_least=False, digits=3),
                f"{100 * straight.mean():.1f}",
            ]
        )
    return Section(
        "Log maps",
        f"`log_map` and `exact_distance` from vertex 0 on a prepared "
        f"mesh, processor time, {PAIRS * runs} pairs by turns: milliseconds are medians, the ratio "
        f"is the median of those of the pairs. *A fin* is one more face at an edge, where three "
        f"meet then: on such meshes, and on one-sided ones, windows also tell whether their frame "
        f"is mirrored. The last column is the share of vertices whose path bends nowhere.",
        ["mesh", "faces", "sweep, ms", "log map, ms", "ratio", "seen straight, %"],
        rows,
    )


def _lines(inputs: Inputs, runs: int) -> Section:
    """Compare straight lines with potpourri3d's."""
    rows = []
    for name, vertices, faces in inputs.arrays(SCANS):
        mesh = gc.TriangleMesh(vertices, faces)
        tracer = potpourri3d.GeodesicTracer(vertices, faces)
        asked = _lines_of(mesh)
        gc.trace(mesh, asked.starts[:1], asked.directions[:1], asked.length)
        (ours_s, ours), (theirs_s, theirs) = by_turns(
            [
                partial(gc.trace, mesh, asked.starts, asked.directions, asked.length),
                partial(asked.traced_by, tracer),
            ],
            runs,
        )
        gaps = [
            math.dist(line.points[-1], points[-1]) / mesh.diagonal
            for line, points in zip(ours, theirs, strict=True)
        ]
        rows.append(
            [
                name,
                f"{len(faces):,}",
                f"{median(len(line.faces) for line in ours):.0f}",
                f"{1e3 * ours_s:.0f}",
                f"{1e3 * theirs_s:.0f}",
                rated(theirs_s / ours_s, FASTER, at_least=True, digits=1),
                f"{median(gaps):.1e}",
                f"{np.quantile(gaps, 0.999):.1e}",
                f"{max(gaps):.1e}",
            ]
        )
    return Section(
        "Straight lines",
        f"{LINES:,} lines in random directions from random points in faces, in one call of `trace` "
        f"and in as many of potpourri3d's `GeodesicTracer`, on a prepared mesh, "
        f"processor time, medians of {runs} by turns. Ends differ by so much, as shares of the "
        f"diagonal.",
        [
            "mesh",
            "faces",
            "faces crossed, median",
            "ours, ms",
            "potpourri3d, ms",
            "times faster",
            "ends differ, median",
            "99.9 % of lines",
            "most",
        ],
        rows,
    )


def _against_heat(inputs: Inputs, runs: int) -> Section:
    """Compare times of log maps with those of the vector heat method, and tell its errors."""
    rows = []
    for name, vertices, faces in inputs.arrays(SCANS):
        (ours_first_s, ours_first), *first = by_turns(
            [
                partial(_first_of_ours, vertices, faces),
                *(partial(_first_of_heat, vertices, faces, way) for way in STRATEGIES),
            ],
            max(runs // 2, 1),
        )
        mesh, log_map = ours_first
        solvers = [solver for _, (solver, _) in first]
        calls: list[Callable[[], Any]] = [partial(gc.log_map, mesh, SOURCE)]
        calls += [
            partial(solver.compute_log_map, SOURCE, way)
            for solver, way in zip(solvers, STRATEGIES, strict=True)
        ]
        (ours_s, _), *each = by_turns(calls, runs)
        for way, (first_s, _), (each_s, found) in zip(STRATEGIES, first, each, strict=True):
            errors = _errors(found, log_map, log_map.distances > 0.0)
            straight = _errors(found, log_map, (log_map.bends == 0) & (log_map.distances > 0.0))
            rows.append(
                [
                    name,
                    way,
                    f"{1e3 * ours_first_s:.0f}",
                    f"{1e3 * first_s:.0f}",
                    rated(ours_first_s / first_s, OF_HEAT, at_least=False, digits=3),
                    f"{1e3 * ours_s:.0f}",
                    f"{1e3 * each_s:.0f}",
                    f"{ours_s / each_s:.2f}",
                    *errors,
                    *straight,
                ]
            )
    return Section(
        "Log maps against the vector heat method",
        f"`log_map` from vertex 0 and potpourri3d's "
        f"`MeshVectorHeatSolver.compute_log_map` by its strategies, processor time, medians by "
        f"turns. *First* is from arrays to the first log map: our topology and sweep, and the "
        f"peer's construction, which factorises, and its query ({max(runs // 2, 1)} of these). "
        f"*Next* is that of a prepared mesh, its factorisation at hand ({runs} of these). Errors "
        f"are the peer's, against our exact coordinates, which are first turned so that directions "
        f"agree best: mean angle, that of 99 % of vertices, and mean radius, of all vertices and "
        f"of those that the source sees straight.",
        [
            "mesh",
            "strategy",
            "first: ours, ms",
            "heat, ms",
            "of heat's time",
            "next: ours, ms",
            "heat, ms",
            "of heat's time",
            "all: mean, °",
            "99 %, °",
            "radius, %",
            "straight: mean, °",
            "99 %, °",
            "radius, %",
        ],
        rows,
    )


def _against_geometry_central(inputs: Inputs, runs: int) -> Section:
    """Compare coordinates and times with those of another exact method."""
    rows = []
    for name, vertices, faces in inputs.arrays(SCANS):
        mesh = gc.TriangleMesh(vertices, faces)
        ours_s, log_map = by_turns([partial(gc.log_map, mesh, IN_FACE)], runs)[0]
        sweep_s, paths_s, theirs = _by_geometry_central(vertices, faces)
        gaps = np.hypot(*(_aligned(theirs, log_map) - log_map.coordinates).T) / mesh.diagonal
        rows.append(
            [
                name,
                f"{len(faces):,}",
                f"{1e3 * ours_s:.0f}",
                f"{1e3 * sweep_s:.0f}",
                f"{1e3 * paths_s:.0f}",
                f"{(sweep_s + paths_s) / ours_s:.0f}",
                f"{np.median(gaps):.1e}",
                f"{np.quantile(gaps, 0.99):.1e}",
                f"{gaps.max():.1e} ({verdict(gaps.max(), AGREEMENT, at_least=False)})",
                f"{(gaps > AGREEMENT).sum()}",
            ]
        )
    return Section(
        "Log maps against geometry-central",
        f"`log_map` from a point in a face (processor time, medians of {runs}), and "
        f"geometry-central's `GeodesicAlgorithmExact`: its sweep, and `getLog` of all vertices, "
        f"which traces the path of each (once). Coordinates differ by so much, as shares of the "
        f"diagonal, once both are turned alike. From a vertex they would differ more: `getLog` "
        f"rescales the angles of the edges there, but not those between them.",
        [
            "mesh",
            "faces",
            "ours, ms",
            "geometry-central: sweep, ms",
            "paths, ms",
            "times faster",
            "differ, median",
            "99 % of vertices",
            "most",
            "vertices beyond",
        ],
        rows,
    )


class Lines(NamedTuple):
    """Lines to trace."""

    starts: list[gc.SurfacePoint]
    directions: Floats
    """Unit vectors in the faces of the starts."""
    length: float

    def traced_by(self, tracer: Any) -> list[Floats]:
        """Return the points of the lines that a tracer of potpourri3d finds."""
        return [
            tracer.trace_geodesic_from_face(start.face_index, start.barycentric, vector)
            for start, vector in zip(self.starts, self.length * self.directions, strict=True)
        ]


def _lines_of(mesh: gc.TriangleMesh) -> Lines:
    """Return random lines of a length at which they cross as many faces as they are to.

    A random line of length L crosses 2 L E / (π A) edges, of total length E, of a surface of area
    A (Crofton).
    """
    rng = np.random.default_rng(SEED)
    corners = mesh.vertices[mesh.faces]
    sides = np.roll(corners, -1, axis=1) - corners
    areas = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1) / 2.0
    edges = np.linalg.norm(sides, axis=2).sum() / 2.0
    length = CROSSED * math.pi * areas.sum() / (2.0 * edges)
    chosen = rng.choice(len(areas), LINES, p=areas / areas.sum())
    weights = rng.dirichlet((1.0, 1.0, 1.0), LINES)
    starts = [
        gc.SurfacePoint.face(int(face), tuple(place.tolist()))
        for face, place in zip(chosen, weights, strict=True)
    ]
    along = sides[chosen, 0] / np.linalg.norm(sides[chosen, 0], axis=1)[:, None]
    across = np.cross(np.cross(along, sides[chosen, 1]), along)
    across /= np.linalg.norm(across, axis=1)[:, None]
    angles = rng.uniform(0.0, 2.0 * math.pi, LINES)[:, None]
    return Lines(starts, np.cos(angles) * along + np.sin(angles) * across, length)


def _first_of_ours(vertices: Floats, faces: Ints) -> tuple[gc.TriangleMesh, gc.LogMap]:
    mesh = gc.TriangleMesh(vertices, faces)
    return mesh, gc.log_map(mesh, SOURCE)


def _first_of_heat(vertices: Floats, faces: Ints, way: str) -> tuple[Any, Floats]:
    solver = potpourri3d.MeshVectorHeatSolver(vertices, faces)
    return solver, solver.compute_log_map(SOURCE, way)


def _aligned(coordinates: Floats, log_map: gc.LogMap) -> Floats:
    """Return coordinates turned so that their directions agree best with those of a log map."""
    theirs, ours = (each @ (1.0, 1.0j) for each in (coordinates, log_map.coordinates))
    with np.errstate(invalid="ignore"):
        turns = ours / theirs
        turn = np.nanmean(turns / np.abs(turns))
        turn *= np.exp(1j * np.nanmedian(np.angle(turns / turn)))
    turned = theirs * turn / abs(turn)
    return np.stack([turned.real, turned.imag], axis=1)


def _errors(coordinates: Floats, log_map: gc.LogMap, chosen: Flags) -> list[str]:
    """Return mean angle, that of 99 % of vertices, both in degrees, and mean radius in percent."""
    theirs = _aligned(coordinates, log_map)[chosen] @ (1.0, 1.0j)
    ours = log_map.coordinates[chosen] @ (1.0, 1.0j)
    angles = np.degrees(np.abs(np.angle(theirs / ours)))
    radii = 100.0 * np.abs(np.abs(theirs / ours) - 1.0)
    return [f"{angles.mean():.2f}", f"{np.quantile(angles, 0.99):.1f}", f"{radii.mean():.2f}"]


def _by_geometry_central(vertices: Floats, faces: Ints) -> tuple[float, float, Floats]:
    """Return seconds of the sweep and of the paths, and coordinates."""
    head = np.array([len(vertices), len(faces), IN_FACE.face_index], np.int64)
    weights = np.array(IN_FACE.barycentric)
    question = (
        head.tobytes()
        + weights.tobytes()
        + vertices.astype("f8").tobytes()
        + faces.astype("i4").tobytes()
    )
    ran = subprocess.run([GEOMETRY_CENTRAL], input=question, capture_output=True, check=True)
    sweep_s, paths_s, *_ = answer = np.frombuffer(ran.stdout)
    return float(sweep_s), float(paths_s), answer[2:].reshape(-1, 2)


def with_fin(vertices: Floats, faces: Ints) -> tuple[Floats, Ints]:
    """Return a mesh with one more face, upright on an edge of its last face."""
    a, b, c = vertices[faces[-1]]
    normal = np.cross(b - a, c - a)
    tip = (a + b) / 2.0 + normal / math.sqrt(np.linalg.norm(normal))
    fin = [*faces[-1, :2], len(vertices)]
    return np.vstack([vertices, [tip]]), np.vstack([faces, [fin]]).astype(np.int32)


def moebius(around: int, across: int) -> tuple[Floats, Ints]:
    """Return a strip of so many cells of two faces, joined to itself after half a turn."""
    turn = 2.0 * math.pi * np.arange(around)[:, None] / around
    side = np.linspace(-0.4, 0.4, across + 1)
    out = 1.0 + side * np.cos(turn / 2.0)
    points = [out * np.cos(turn), out * np.sin(turn), side * np.sin(turn / 2.0)]
    numbers = np.arange(around * (across + 1)).reshape(around, across + 1)
    rows = np.vstack([numbers, numbers[:1, ::-1]])
    a, b, c, d = rows[:-1, :-1], rows[1:, :-1], rows[1:, 1:], rows[:-1, 1:]
    faces = np.stack([np.stack([a, b, c], -1), np.stack([a, c, d], -1)])
    return np.stack(points, axis=-1).reshape(-1, 3), faces.reshape(-1, 3).astype(np.int32)
