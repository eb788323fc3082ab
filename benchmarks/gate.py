"""The gate: ratios of times that were measured by turns, against those that are committed.

Ratios differ between processors by up to a factor of two, so each processor has its own.
"""

import json
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path

import potpourri3d
import pygeodesic.geodesic as peer

import geodesic_core as gc
from benchmarks.inputs import icosphere
from benchmarks.paper import surfaces
from benchmarks.tables import processor, table
from benchmarks.timing import by_turns
from geodesic_core.arrays import Floats, Ints

COMMITTED = Path(__file__).with_name("results") / "gate.json"
TOLERANCE = 0.15
"""How much a ratio may grow: by turns, and with medians, noise stays within a tenth"""
RUNS = 15


def run(*, is_new: bool) -> tuple[str, bool]:
    """Measure the ratios; return them as a table, and whether all are as good as committed.

    Without committed ratios for this processor, the second value is False. With ``is_new``, the
    measured ratios replace the committed ones.
    """
    gc.warm_up()
    measured = {
        f"{surface}: {name}": ratio
        for surface, (vertices, faces) in _surfaces().items()
        for name, ratio in _ratios(vertices, faces).items()
    }
    here = processor()
    by_processor: dict[str, Mapping[str, float]] = json.loads(COMMITTED.read_text())
    if is_new:
        by_processor[here] = measured
        COMMITTED.write_text(json.dumps(by_processor, indent=1) + "\n")
    if here not in by_processor:
        known = ", ".join(by_processor)
        return f"No ratios are committed for {here}, only for {known}; --new adds them.", False
    committed = by_processor[here]
    rows, is_good = [], True
    for name, ratio in measured.items():
        change = ratio / committed[name] - 1.0
        is_worse = change > TOLERANCE
        is_good = is_good and not is_worse
        verdict = "**worse**" if is_worse else ""
        rows.append([name, f"{ratio:.3f}", f"{committed[name]:.3f}", f"{change:+.1%}", verdict])
    ratios = table(["ratio of times", "now", "committed", "change", ""], rows)
    return f"{here}\n\n{ratios}", is_good


def _surfaces() -> Mapping[str, tuple[Floats, Ints]]:
    return {
        "sphere": icosphere(5),
        "rough knot": surfaces.noisy(surfaces.knot(20_000), 0.4, seed=1),
    }


def _ratios(vertices: Floats, faces: Ints) -> Mapping[str, float]:
    """Return the times of the library, each as a multiple of another one's or of a peer's."""
    mesh = gc.TriangleMesh(vertices, faces)
    solver, heat = gc.Solver(mesh), potpourri3d.MeshHeatMethodDistanceSolver(vertices, faces)
    algorithm, far = peer.PyGeodesicAlgorithmExact(vertices, faces), len(vertices) - 1
    calls: Mapping[str, Callable[[], object]] = {
        "pygeodesic": partial(algorithm.geodesicDistances, [0], None),
        "heat": partial(heat.compute_distance, 0),
        "exact": partial(solver.exact_distance, 0),
        "approximate": partial(solver.approximate_distance, 0),
        "fast": partial(solver.fast_distance, 0, retain="distances"),
        "path": partial(solver.shortest_path, 0, far),
        "topology": partial(gc.TriangleMesh, vertices, faces),
    }
    found = by_turns(list(calls.values()), RUNS)
    seconds = {name: took for name, (took, _) in zip(calls, found, strict=True)}
    pairs = (
        ("exact", "pygeodesic"),
        ("approximate", "exact"),
        ("fast", "heat"),
        ("path", "exact"),
        ("topology", "exact"),
    )
    return {f"{ours} to {other}": seconds[ours] / seconds[other] for ours, other in pairs}
