"""Costs by face and by slope: time beside an exact sweep without costs, errors, and scikit-image.

All is of one thread, and counts the processor's seconds, which others on the machine disturb less
than those on the clock. Errors are those against an exact sweep where costs are 1, else against the
same method with `REFERENCE` nodes on an edge.
"""

import time
from collections.abc import Callable, Iterator
from functools import partial
from importlib.util import find_spec
from typing import Any

import numpy as np

import geodesic_core as gc
from benchmarks import timing
from benchmarks.inputs import Inputs
from benchmarks.tables import Section, verdict
from geodesic_core.arrays import Floats
from geodesic_core.control import Control
from geodesic_core.costs.cost_sweep import Detail, starts_of, sweep_costs
from geodesic_core.costs.surface_costs import SurfaceCosts

SCANS = ("buddha30k.ply", "armadillo86k.ply")
SIDE, LARGE_SIDE = 250, 347
"""Cells of the rasters: 124 and 239 thousand faces"""
REFERENCE = 24
DETAILS: tuple[Detail, ...] = ("default", "fine")
MOST_TIME = {"default": 3.0, "fine": 6.0}
"""Times an exact sweep without costs, at most, where costs are by face"""
MOST_ERROR = {"default": 1.2, "fine": 0.5}
"""Mean error in per cent, at most"""
OF_PATHS = 0.2
"""Mean error of straightened paths in per cent, at most"""
PATHS = 12
PATH_S = 1.0
"""Seconds of one path on the large raster, at most"""

by_turns = partial(timing.by_turns, clock=time.process_time)


def run(inputs: Inputs, runs: int) -> Iterator[Section]:
    """Measure fields, paths, and a raster beside scikit-image."""
    gc.warm_up()
    rows: list[list[str]] = []
    for name, mesh in _surfaces(inputs):
        rows += _fields(name, mesh, runs)
    yield Section(
        "Costs",
        "Fields of costs from one vertex. Time in exact sweeps without costs, medians of "
        f"{runs} by turns; errors in per cent; of paths, {PATHS} to vertices at random, against "
        "the best known; the share of the vertices whose error is within the stated one.",
        [
            "surface and cost",
            "exact s",
            "detail",
            "time",
            "mean",
            "95 %",
            "worst",
            "paths",
            "within",
        ],
        rows,
    )
    yield _large(runs)


def raster(side: int, slope: float) -> gc.TriangleMesh:
    """Return a smooth random terrain in unit cells, whose faces have that slope on average."""
    rng = np.random.default_rng(1)
    x, y = np.fft.fftfreq(side)[:, None], np.fft.fftfreq(side)[None, :]
    frequency = np.hypot(x, y)
    frequency[0, 0] = 1.0
    waves = np.fft.fft2(rng.normal(size=(side, side))) * frequency**-2.2
    heights = np.fft.ifft2(waves).real
    rows, columns = np.mgrid[:side, :side].astype(float)
    number = np.arange(side * side).reshape(side, side)
    a, b, c, d = (
        number[i : i + side - 1, j : j + side - 1].ravel()
        for i, j in ((0, 0), (1, 0), (1, 1), (0, 1))
    )
    even = (np.add.outer(np.arange(side - 1), np.arange(side - 1)) % 2 == 0).ravel()
    one = np.where(even[:, None], np.stack([a, b, c], 1), np.stack([a, b, d], 1))
    two = np.where(even[:, None], np.stack([a, c, d], 1), np.stack([b, c, d], 1))
    steep = np.hypot(np.diff(heights, axis=0)[:, 1:], np.diff(heights, axis=1)[1:]).mean()
    points = np.stack([rows, columns, heights * (slope / steep)], axis=2).reshape(-1, 3)
    return gc.TriangleMesh(points, np.concatenate([one, two]))


def patches(mesh: gc.TriangleMesh) -> Floats:
    """Return costs 1, 2 and 5 in cubes, ten along the longest side."""
    middle = mesh.vertices[mesh.faces].mean(axis=1)
    cubes = ((middle - middle.min(axis=0)) / np.ptp(middle, axis=0).max() * 9.999).astype(int)
    table = np.random.default_rng(2).choice([1.0, 2.0, 5.0], (10, 10, 10))
    costs: Floats = table[cubes[:, 0], cubes[:, 1], cubes[:, 2]]
    return costs


def _surfaces(inputs: Inputs) -> Iterator[tuple[str, gc.TriangleMesh]]:
    yield "raster, slope 0.15", raster(SIDE, 0.15)
    yield "raster, slope 0.5", raster(SIDE, 0.5)
    for name, vertices, faces in inputs.arrays(SCANS):
        yield name, gc.TriangleMesh(vertices, faces)


def _costs(name: str, mesh: gc.TriangleMesh) -> Iterator[tuple[str, Any]]:
    yield "one", np.ones(len(mesh.faces))
    yield "at random", np.random.default_rng(1).choice([1.0, 2.0, 5.0], len(mesh.faces))
    yield "patches", patches(mesh)
    if name.startswith("raster"):
        yield "Tobler", gc.SlopeCost("tobler")


def _fields(name: str, mesh: gc.TriangleMesh, runs: int) -> Iterator[list[str]]:
    source = int(np.random.default_rng(3).integers(len(mesh.vertices)))
    targets = np.random.default_rng(4).choice(len(mesh.vertices), PATHS, replace=False).tolist()
    for kind, cost in _costs(name, mesh):
        calls: list[Callable[[], Any]] = [
            partial(gc.exact_distance, mesh, source, retain="distances"),
            *(partial(gc.cost_distance, mesh, source, cost, detail=each) for each in DETAILS),
        ]
        (exact_s, exact), *measured = by_turns(calls, runs)
        least = exact.distances if kind == "one" else _reference(mesh, source, cost)
        near = np.isfinite(least) & (least > 0.0)
        paths = {d: [field.path_to(t).cost for t in targets] for d, (_, field) in _by(measured)}
        best = np.minimum(*(np.array(some) for some in paths.values()))
        if kind == "one":
            best = np.minimum(best, least[targets])
        for detail, (seconds, field) in _by(measured):
            share = field.costs[near] / least[near] - 1.0
            error = 100.0 * share
            off = 100.0 * (np.array(paths[detail]) / best - 1.0).mean()
            is_rated = kind != "Tobler"
            yield [
                f"{name}, {kind}",
                f"{exact_s:.3f}",
                detail,
                _rated(
                    f"{seconds / exact_s:.2f} ×", seconds / exact_s, MOST_TIME[detail], is_rated
                ),
                _rated(f"{error.mean():.3f}", error.mean(), MOST_ERROR[detail], is_rated),
                f"{np.quantile(error, 0.95):.2f}",
                f"{error.max():.2f}",
                _rated(f"{off:.4f}", off, OF_PATHS, is_rated),
                f"{(share <= field.error_bound.value).mean():.1%}",
            ]


def _by(measured: list[tuple[float, Any]]) -> Iterator[tuple[str, tuple[float, Any]]]:
    yield from zip(DETAILS, measured, strict=True)


def _rated(text: str, value: float, limit: float, is_rated: bool) -> str:
    return f"{text} ({verdict(value, limit, at_least=False)})" if is_rated else text


def _reference(mesh: gc.TriangleMesh, source: int, cost: Any) -> Floats:
    costs = SurfaceCosts.of(mesh, cost, np.empty(0, np.int64))
    starts = starts_of(mesh, costs, [(mesh.point(source),)], [0.0])
    return sweep_costs(mesh, costs, starts, REFERENCE, np.inf, Control()).values


def _large(runs: int) -> Section:
    """One path on a large raster, and a flat one beside scikit-image."""
    mesh = raster(LARGE_SIDE, 0.15)
    ends = 5 * LARGE_SIDE + 7, len(mesh.vertices) - 9 * LARGE_SIDE - 4
    rows = []
    for kind, cost in _costs("raster", mesh):
        ((seconds, path),) = by_turns([partial(gc.cheapest_path, mesh, *ends, cost)], runs)
        rated = verdict(seconds, PATH_S, at_least=False, unit=" s")
        rows.append([f"a path, {kind}", f"{seconds:.3f} s ({rated})", f"{path.cost:.6g}"])
    flat = gc.TriangleMesh(raster(SIDE, 0.15).vertices * [1.0, 1.0, 0.0], raster(SIDE, 0.15).faces)
    source = (SIDE // 2) * SIDE + SIDE // 3
    exact = np.hypot(*(flat.vertices - flat.vertices[source])[:, :2].T)
    calls: dict[str, Callable[[], Any]] = {
        d: partial(lambda d: gc.cost_distance(flat, source, 1.0, detail=d).costs, d)
        for d in DETAILS
    }
    if find_spec("skimage") is not None:
        calls["MCP_Geometric"] = partial(_pixels, source)
    for name, (seconds, found) in zip(calls, by_turns(list(calls.values()), runs), strict=True):
        error = found[exact > 0.0] / exact[exact > 0.0] - 1.0
        text = f"mean {100 * error.mean():.3f} %, worst {100 * error.max():.2f} %"
        rows.append([f"a flat raster, {name}", f"{seconds:.3f} s", text])
    return Section(
        "Costs on rasters",
        f"One path on {len(mesh.faces):,} faces, from corner to corner, and costs of 1 on "
        f"{SIDE} × {SIDE} places, beside MCP_Geometric of scikit-image where that is installed.",
        ["what", "time", "cost, or error"],
        rows,
    )


def _pixels(source: int) -> Floats:
    from skimage.graph import MCP_Geometric  # noqa: PLC0415

    search = MCP_Geometric(np.ones((SIDE, SIDE)))
    costs: Floats = search.find_costs([divmod(source, SIDE)])[0].ravel()
    return costs
