"""Cuts along paths and isolines, as multiples of the exact sweep."""

import time
from collections.abc import Sequence
from functools import partial
from statistics import median

import numpy as np

import geodesic_core as gc
from benchmarks.inputs import Inputs
from benchmarks.tables import Section, rated
from benchmarks.timing import paired, ratio

SEED = 6
FACES = 100_000
SOURCE = 0
PATHS = 20
LEVELS = 3
"""Isolines of the distance that together have about 2,000 points"""

ALONG_PATHS, ALONG_ISOLINES = 1.5, 0.6
"""Time of a cut as a multiple of the sweep's, at most"""
PAIRS = 3
"""Pairs of a sweep and a cut, for each of the runs"""


def run(_: Inputs, runs: int) -> Section:
    """Time cuts of a knot, with and without taking it apart."""
    gc.warm_up()
    mesh = gc.samples.knot(FACES)
    field = gc.exact_distance(mesh, SOURCE)
    ends = np.random.default_rng(SEED).choice(len(mesh.vertices), PATHS, replace=False)
    paths = [field.path_to(end) for end in ends.tolist()]
    isolines = [line for lines in field.isolines(field.levels(LEVELS).tolist()) for line in lines]
    rows = [
        _row(mesh, name, curves, runs, most, separate=separate)
        for name, curves, most in (
            (f"{PATHS} paths", paths, ALONG_PATHS),
            (f"isolines at {LEVELS} levels", isolines, ALONG_ISOLINES),
        )
        for separate in (False, True)
    ]
    return Section(
        "Cuts",
        f"`cut` of a knot of {len(mesh.faces):,} faces along paths to random vertices, and along "
        f"isolines, with `separate` and without; and `exact_distance` on the prepared knot. All "
        f"from vertex {SOURCE}, processor time, {PAIRS * runs} pairs by turns: milliseconds are "
        f"medians, the ratio is the median of those of the pairs.",
        ["curves", "points", "separate", "faces after", "parts", "sweep, ms", "cut, ms", "ratio"],
        rows,
    )


def _row(
    mesh: gc.TriangleMesh,
    name: str,
    curves: Sequence[gc.SurfaceCurve],
    runs: int,
    most: float,
    *,
    separate: bool,
) -> list[str]:
    """Compare cuts along curves with sweeps."""
    sweeps_s, cuts_s, cut = paired(
        partial(gc.exact_distance, mesh, SOURCE),
        partial(gc.cut, mesh, curves, separate),
        PAIRS * runs,
        time.process_time,
    )
    return [
        name,
        f"{sum(len(curve.points) for curve in curves):,}",
        "yes" if separate else "no",
        f"{len(cut.mesh.faces):,}",
        f"{cut.parts.max() + 1}",
        f"{1e3 * median(sweeps_s):.1f}",
        f"{1e3 * median(cuts_s):.1f}",
        rated(ratio(cuts_s, sweeps_s), most, at_least=False),
    ]
