"""Errors of fast distances by effort: on real meshes, samples, and the meshes of the tests."""

from collections.abc import Iterator
from random import Random
from typing import Any, NamedTuple

import numpy as np

import geodesic_core as gc
from benchmarks.inputs import Inputs
from benchmarks.tables import Section
from geodesic_core.arrays import Floats
from geodesic_core.fields.fast_sweep import ESTIMATES
from tests.support import zoo

EFFORTS: tuple[Any, ...] = (1, 2, 4, 8)
REAL_SOURCES, SAMPLE_SOURCES, SMALL_SOURCES = 10, 10, 3
"""Of each mesh"""
SAMPLE_FACES = 20_000


class Errors(NamedTuple):
    """Errors of one field."""

    is_real: bool
    is_within: bool
    """Of 99 % of the vertices, within the estimate"""
    is_all_within: bool
    mean: float
    least: float


def run(inputs: Inputs, runs: int) -> Section:  # noqa: ARG001 - as all benchmarks
    """Compare the errors of fast distances with their estimates."""
    by_effort: dict[int, list[Errors]] = {effort: [] for effort in EFFORTS}
    meshes, real = 0, 0
    for mesh, sources, is_real in _meshes(inputs):
        solver = gc.Solver(mesh)
        meshes, real = meshes + 1, real + is_real
        for source in sources:
            exact = solver.exact_distance(source).distances
            for effort in EFFORTS:
                field = solver.fast_distance(source, effort)
                found = _errors(field, ESTIMATES[effort], exact, is_real)
                by_effort[effort].append(found)
    least = min(each.least for some in by_effort.values() for each in some)
    return Section(
        "Errors of fast distances",
        f"{len(by_effort[1])} fields on {meshes} meshes, {real} of them real: from {REAL_SOURCES} "
        f"vertices of each real mesh, {SAMPLE_SOURCES} of each sample with {SAMPLE_FACES:,} faces, "
        f"and {SMALL_SOURCES} of each mesh of the tests, among them slivers and non-manifold ones. "
        f"The most that a distance fell short of the exact one: {-least:.0e} of it.",
        [
            "effort",
            "estimate",
            "fields of which 99 % of the vertices lie within",
            "of real meshes",
            "fields of which all do",
            "mean error, real meshes",
        ],
        [[str(effort), *_row(effort, by_effort[effort])] for effort in EFFORTS],
    )


def _meshes(inputs: Inputs) -> Iterator[tuple[gc.TriangleMesh, list[int], bool]]:
    random = Random(5)  # noqa: S311 - for choosing vertices

    def some(mesh: gc.TriangleMesh, count: int) -> list[int]:
        used = np.unique(mesh.faces).tolist()
        return random.sample(used, min(count, len(used)))

    for path in sorted([*inputs.folder.glob("*.obj"), *inputs.folder.glob("*.ply")]):
        mesh = gc.load_mesh(path)
        yield mesh, some(mesh, REAL_SOURCES), True
    for make in gc.samples.SAMPLES.values():
        mesh = make(SAMPLE_FACES)
        yield mesh, some(mesh, SAMPLE_SOURCES), False
    for case in (zoo.SMALL | zoo.KNOWN | zoo.IRREGULAR).values():
        mesh = gc.TriangleMesh(case.vertices, case.faces)
        yield mesh, some(mesh, SMALL_SOURCES), False


def _errors(field: gc.DistanceField, estimate: float, exact: Floats, is_real: bool) -> Errors:
    reached = np.isfinite(exact) & (exact > 0)
    errors = field.distances[reached] / exact[reached] - 1
    if not len(errors):
        return Errors(is_real, True, True, 0.0, 0.0)
    return Errors(
        is_real,
        bool(np.quantile(errors, 0.99) <= estimate),
        bool(errors.max() <= estimate),
        float(errors.mean()),
        float(errors.min()),
    )


def _row(effort: int, fields: list[Errors]) -> list[str]:
    real = [each for each in fields if each.is_real]
    return [
        f"{100 * ESTIMATES[effort]:g} %",
        _share([each.is_within for each in fields]),
        _share([each.is_within for each in real]),
        _share([each.is_all_within for each in fields]),
        f"{100 * np.mean([each.mean for each in real]):.2g} %" if real else "–",
    ]


def _share(found: list[bool]) -> str:
    return f"{100 * np.mean(found):.1f} %" if found else "–"
