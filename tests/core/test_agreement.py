"""Every way to a distance, on every mesh whose distances an oracle knows, keeps its promise."""

import itertools
import math
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import geodesic_core as gc
from tests.support import zoo
from tests.support.approximation import ERRORS
from tests.support.known import (
    BY_ENUMERATION,
    BY_GEOMETRY,
    Known,
    among_polygonal_holes,
    in_closed_form,
    points_of_a_plane,
    thin_plane,
    unfolded_among_barriers,
    unfolded_with_points,
)
from tests.support.path_checks import LENGTH, check_path
from tests.support.random_meshes import KINDS, blocks, cases, moebius, pages, wound

pytestmark = [
    pytest.mark.jit,
    pytest.mark.filterwarnings("ignore::geodesic_core.errors.BlockedSource"),
]

EXACT = 1e-9
"""Relative error allowed against an oracle, also of what is promised exactly."""
UNKNOWN = 1e9
"""In place of an infinite share: on needles a fast distance may be far too long."""


class Way(NamedTuple):
    """How distances (S, T) are asked for, of how many of each, and what is promised of them."""

    ask: Callable[..., object]
    short: float = 0.0
    """Share by which they may be too small"""
    long: float = 0.0
    """Share by which they may be too large"""
    absolute: float = 1.0
    """Share of the mesh's diagonal by which they may be too small, if that is less"""
    most: tuple[int, int] = (12, 10**6)
    """Sources and targets"""
    of: Callable[[Known], np.ndarray] = lambda known: known.table
    """What is asked for"""
    limits: bool = False
    """Whether they are asked for within a limit, too"""


# Ways to ask ------------------------------------------------------------------------------------


def fields(known: Known, solve, told=False, **options) -> Iterator[gc.DistanceField]:
    """From each source, by a sweep that was told of the targets or not."""
    targets = {"targets": known.targets} if told else {}
    for source in known.sources:
        yield solve(known.mesh, source, **options, **targets)


def distances(known: Known, solve, **options) -> list[list[float]]:
    table = []
    for field in fields(known, solve, **options):
        np.testing.assert_array_equal(field.nearest_source < 0, np.isinf(field.distances))
        table.append([field.distance_at(target) for target in known.targets])
    return table


def late_sources(known: Known) -> list[gc.Source]:
    """All sources, of which every second one starts late."""
    late = 0.3 * known.mesh.diagonal
    return [gc.Source(source, late * (i % 2)) for i, source in enumerate(known.sources)]


def from_each(known: Known) -> np.ndarray:
    return known.table + np.array([[source.start_distance] for source in late_sources(known)])


def from_all(known: Known) -> np.ndarray:
    return from_each(known).min(axis=0, keepdims=True)


def together(known: Known, solve, **options) -> list[list[float]]:
    """From all sources at once."""
    return distances(known._replace(sources=[late_sources(known)]), solve, **options)


def named(known: Known, solve, **options) -> list[list[float]]:
    """From the source that is said to be the nearest of all."""
    field, each = solve(known.mesh, late_sources(known), **options), from_each(known)
    nearest = [field.nearest_source_at(target) for target in known.targets]
    return [[each[k, j] if k >= 0 else math.inf for j, k in enumerate(nearest)]]


def lengths(known: Known, finds: Iterable[Callable[..., gc.GeodesicPath]]) -> np.ndarray:
    """Of paths over the surface from each source; infinite where there is none."""
    table = np.full(known.table.shape, math.inf)
    for i, (source, find) in enumerate(zip(known.sources, finds, strict=True)):
        for j, target in enumerate(known.targets):
            try:
                path = find(target)
            except gc.errors.NoPath as refusal:
                is_disconnected = math.isinf(known.table[i, j])
                assert (refusal.reason == "disconnected") == is_disconnected  # noqa: PT017
                continue
            if known.mesh.point(source) != known.mesh.point(target):
                check_path(known.mesh, path, source, target, path.length)
            table[i, j] = path.length
    return table


def follow(field: gc.DistanceField, target) -> gc.GeodesicPath:
    """A path as much longer than the field says as it guarantees; or else no longer."""
    path, distance = field.path_to(target), field.distance_at(target)
    excess = path.length - distance
    if path.error_bound.kind == "guaranteed":
        excess = max(excess, 0.0) - path.error_bound.value * distance
        assert excess >= -LENGTH * distance
    assert excess <= LENGTH * distance + 1e-13 * field.mesh.diagonal
    return path


def traced(known: Known, solve, **options) -> np.ndarray:
    finds = (partial(follow, field) for field in fields(known, solve, **options))
    return lengths(known, finds)


def searched(known: Known, **options) -> np.ndarray:
    find = gc.Solver(known.mesh).shortest_path
    return lengths(known, [partial(find, source, **options) for source in known.sources])


def searched_anew(known: Known, **options) -> np.ndarray:
    find = partial(gc.shortest_path, known.mesh)
    return lengths(known, [partial(find, source, **options) for source in known.sources])


def searched_back(known: Known) -> np.ndarray:
    back = known._replace(sources=known.targets, targets=known.sources, table=known.table.T)
    return searched(back).T


def nearest(known: Known, **options) -> np.ndarray:
    """All targets, in order; and fewer are the first of these."""
    table, solver = np.full(known.table.shape, math.inf), gc.Solver(known.mesh)
    for row, source in zip(table, known.sources, strict=True):
        found = solver.nearest(source, known.targets, len(known.targets), **options)
        row[found.indices] = found.distances
        assert (np.diff(found.distances) >= -1e-12 * found.distances[1:]).all()
        for k in {1, len(known.targets) // 2} - {0}:
            few = gc.nearest(known.mesh, source, known.targets, k, **options)
            np.testing.assert_allclose(few.distances, found.distances[:k], rtol=1e-11, atol=1e-13)
    return table


def matrix(known: Known, **options) -> np.ndarray:
    return gc.distance_matrix(known.mesh, known.sources, known.targets, **options)


def transposed_matrix(known: Known, **options) -> np.ndarray:
    return gc.distance_matrix(known.mesh, known.targets, known.sources, **options).T


def sparse_matrix(known: Known, **options) -> np.ndarray:
    """What is out of reach is not stored."""
    ask = gc.Solver(known.mesh).distance_matrix
    found = ask(known.sources, known.targets, layout="sparse", **options)
    assert np.isfinite(found.data).all()
    table, stored = np.full(found.shape, math.inf), found.tocoo()
    table[stored.row, stored.col] = stored.data
    return table


def pairs(known: Known, **options) -> np.ndarray:
    """All pairs of a source and a target in a row."""
    sources, targets = zip(*itertools.product(known.sources, known.targets), strict=True)
    found = gc.distance_matrix(known.mesh, sources, targets, layout="pairs", **options)
    return found.reshape(known.table.shape)


def scattered_pairs(known: Known) -> np.ndarray:
    """So few of each source that they are searched for."""
    table = known.table.copy()
    rows, columns = np.nonzero(np.add.outer(*map(np.arange, table.shape)) % 4 == 0)
    sources, targets = [known.sources[i] for i in rows], [known.targets[j] for j in columns]
    table[rows, columns] = gc.distance_matrix(known.mesh, sources, targets, layout="pairs")
    return table


def by_absolute_error(mesh, source, share: float, **options) -> gc.DistanceField:
    return gc.approximate_distance(mesh, source, absolute_error=share * mesh.diagonal, **options)


# The table --------------------------------------------------------------------------------------


ALL, FEW, FEWER, SQUARE = (10**6, 10**6), (5, 30), (3, 14), (6, 6)
EXACT_FIELDS = {"": {}, "told, ": {"told": True}, "windows, ": {"retain": "windows"}}


def _exact() -> Iterator[tuple[str, Way]]:
    yield "exact, all", Way(partial(distances, solve=gc.exact_distance), most=ALL)
    for kind, options in EXACT_FIELDS.items():
        known = {"solve": gc.exact_distance, **options}
        yield f"exact, {kind}distances", Way(partial(distances, **known), most=FEW, limits=True)
        yield f"exact, {kind}paths", Way(partial(traced, **known), most=FEWER, limits=True)
    for kind, options in (("", {}), ("windows, ", {"retain": "windows"})):
        ask = partial(together, solve=gc.exact_distance, **options)
        yield f"exact, {kind}together", Way(ask, most=FEW, of=from_all)
        ask = partial(named, solve=gc.exact_distance, **options)
        yield f"exact, {kind}named", Way(ask, most=FEW, of=from_all)
    yield "search", Way(searched, most=FEWER, limits=True)
    yield "search anew", Way(searched_anew, most=FEWER, limits=True)
    yield "search back", Way(searched_back, most=FEWER)
    yield "nearest", Way(nearest, most=FEWER, limits=True)
    yield "matrix", Way(matrix, most=FEW, limits=True)
    yield "matrix, transposed", Way(transposed_matrix, most=FEW, limits=True)
    yield "matrix, square", Way(matrix, most=SQUARE)
    yield "matrix, sparse", Way(sparse_matrix, most=FEWER, limits=True)
    yield "matrix, sparse square", Way(sparse_matrix, most=SQUARE)
    yield "matrix, pairs", Way(pairs, most=FEW, limits=True)
    yield "matrix, scattered pairs", Way(scattered_pairs, most=FEWER)


def _with_an_error() -> Iterator[tuple[str, Way]]:
    for error in ERRORS:
        solve = partial(gc.approximate_distance, relative_error=error)
        yield f"{error}", Way(partial(distances, solve=solve), error)
        yield f"{error}, told", Way(partial(distances, solve=solve, told=True), error, most=FEW)
        ask = partial(traced, solve=solve, told=True, retain="paths")
        yield f"{error}, paths", Way(ask, 0.0, error, most=FEWER)
        yield (
            f"{error}, together",
            Way(partial(together, solve=solve), error, most=FEW, of=from_all),
        )
        ask, long = partial(named, solve=solve), 1 / (1 - error) - 1
        yield f"{error}, named", Way(ask, 0.0, long, most=FEW, of=from_all)
    for share in (1e-5, 1e-3, 0.1):
        for name, relative, short in (("", None, 1.0), (" and 0.001", 1e-3, 1e-3)):
            solve = partial(by_absolute_error, share=share, relative_error=relative)
            yield f"absolute {share}{name}", Way(partial(distances, solve=solve), short, 0.0, share)
    for effort in (1, 2):
        solve = partial(gc.fast_distance, effort=effort)
        ask = partial(distances, solve=solve, told=True)
        yield f"fast {effort}", Way(ask, 0.0, UNKNOWN, most=FEW)
        ask = partial(traced, solve=solve, told=True)
        yield f"fast {effort}, paths", Way(ask, 0.0, UNKNOWN, most=FEWER)
    yield "fast search", Way(partial(searched, method="fast"), 0.0, UNKNOWN, most=FEWER)


WAYS = {**dict(_exact()), **dict(_with_an_error())}


def middle(table: np.ndarray) -> float:
    """A distance between those of a table, about half as long as most, and of none of them."""
    known = np.unique(table[np.isfinite(table)])
    some = known[len(known) // 4 : 1 + 3 * len(known) // 4]
    gap = int(np.diff(some).argmax()) if len(some) > 1 else 0
    return float(some[gap : gap + 2].mean())


def check(known: Known, ways: Iterable[str] = WAYS) -> None:
    """They keep their promises, and reach what can be reached."""
    for name in ways:
        way = WAYS[name]
        some = known.some(*way.most)
        table = way.of(some)
        check_promise(name, some, way.ask(some), table)
        if way.limits and np.ptp(table[np.isfinite(table)]) > 0:
            limit = middle(table)
            found = way.ask(some, max_distance=limit)
            check_promise(name, some, found, np.where(table <= limit, table, math.inf))


def check_promise(name: str, known: Known, found, table: np.ndarray) -> None:
    way, found, reached = WAYS[name], np.asarray(found), np.isfinite(table)
    np.testing.assert_array_equal(np.isfinite(found), reached, err_msg=name)
    found, exact = found[reached], table[reached]
    allowed = np.minimum(way.short * exact, way.absolute * known.mesh.diagonal)
    least = exact * (1 - EXACT) - allowed - known.rounding
    assert (found >= least).all(), f"{name}: too short by {(least - found).max()}"
    most = exact * (1 + way.long + EXACT) + known.rounding
    assert (found <= most).all(), f"{name}: too long by {(found - most).max()}"


@pytest.mark.slow
@pytest.mark.slice(5)
@pytest.mark.parametrize("name", BY_ENUMERATION)
def test_every_way_keeps_its_promise(name: str) -> None:
    check(BY_ENUMERATION[name]())


@pytest.mark.slow
@pytest.mark.slice(5)
@pytest.mark.parametrize("name", BY_GEOMETRY)
def test_every_way_keeps_its_promise_where_geometry_knows_all(name: str) -> None:
    check(BY_GEOMETRY[name]())


seeds = st.integers(0, 2**31 - 1)
MOST_THIN = 300
"""Thin planes with ``--full``: each is asked in all ways, which takes nearly a second."""


@given(
    cases((*KINDS, wound, moebius, blocks, pages)),
    seeds,
    st.sampled_from([unfolded_with_points, unfolded_among_barriers]),
)
def test_every_way_keeps_its_promise_on_random_meshes(case, seed, know) -> None:
    check(know(case, seed).some(9, 30))


@settings(max_examples=min(settings().max_examples, MOST_THIN))
@given(seeds)
def test_every_way_keeps_its_promise_on_thin_planes(seed: int) -> None:
    """However thin the triangles: windows cross, overlap and nest, also behind obstacles."""
    rng = np.random.default_rng(seed)
    if rng.integers(2):
        check(points_of_a_plane(thin_plane(rng), seed))
    else:
        check(among_polygonal_holes(seed, int(10.0 ** rng.uniform(0, 4))))


@pytest.mark.full
@zoo.each(zoo.KNOWN)
def test_exact_distances_from_every_vertex(case: zoo.Case) -> None:
    check(in_closed_form(case, len(case.vertices)), ["exact, all"])
