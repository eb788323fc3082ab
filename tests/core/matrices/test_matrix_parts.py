"""Parts of a matrix: together they are the file that `write_matrix` writes."""

from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.sparse import load_npz

import geodesic_core as gc
from geodesic_core.matrices import matrix_parts, plan
from tests.core.fields.test_points import SAME
from tests.support import zoo
from tests.support.meshes import mesh_of, random_points

ROWS = 2
METHODS: list[dict[str, Any]] = [
    {},
    {"method": "approximate", "relative_error": 1e-3},
    {"method": "approximate", "relative_error": None, "absolute_error": 1e-3},
    {"method": "fast", "effort": 2},
]


@pytest.fixture
def small_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have parts of few sweeps."""
    for module in (plan, matrix_parts):
        monkeypatch.setattr(module, "block_rows", lambda _width: ROWS)


def finite_in(path: Path) -> int:
    """Return the number of finite distances in a file."""
    if path.suffix == ".npz":
        return int(load_npz(path).nnz)
    return int(np.isfinite(np.load(path)).sum())


@pytest.mark.slow
@pytest.mark.usefixtures("small_parts")
@pytest.mark.parametrize("ends", ["symmetric", "wide", "tall"])
@pytest.mark.parametrize("layout", ["dense", "sparse"])
@pytest.mark.parametrize(
    ("name", "barriers", "options"),
    [
        ("two_components", [], {}),
        ("two_components", [], {"dtype": "float32"}),
        ("two_components", [0, 3], {"max_distance": 0.6, "dtype": "float32"}),
        ("hills", [*range(9)], {}),
        ("hills", [*range(9)], {"max_distance": 0.4}),
    ],
)
@pytest.mark.parametrize("method", METHODS, ids=str)
def test_parts_are_the_file_to_the_bit(
    ends: str,
    layout: str,
    name: str,
    barriers: list[int],
    options: dict[str, Any],
    method: dict[str, Any],
    tmp_path: Path,
) -> None:
    mesh = mesh_of(zoo.SMALL[name]).with_barriers(barriers)
    points = random_points(mesh, 9, seed=61)
    sources, targets = {
        "symmetric": (points, points),
        "wide": (points[:3], points[2:]),
        "tall": (points[2:], points[:3]),
    }[ends]
    parts = gc.MatrixParts(mesh, sources, targets, layout=layout, **method, **options)
    found = [parts.compute(part) for part in range(parts.count)]
    file = BytesIO()
    parts.write(file, found.__getitem__)

    others = None if ends == "symmetric" else targets
    areas = gc.MatrixParts.areas(
        len(sources), others and len(others), len(mesh.faces), options.get("max_distance")
    )
    assert parts.count == len(areas) > 1
    if layout == "dense":
        assert [part.size for part in found] == areas
    out = tmp_path / f"whole.{'npy' if layout == 'dense' else 'npz'}"
    written = gc.write_matrix(mesh, out, sources, others, **method, **options)
    assert file.getvalue() == out.read_bytes()
    assert parts.shape == written.shape
    reached = sum(parts.reached(part) for part in found)
    assert reached == finite_in(out) > 0


@pytest.mark.jit
@pytest.mark.usefixtures("small_parts")
def test_a_sparse_file_is_numpy_s(tmp_path: Path) -> None:
    out = tmp_path / "whole.npz"
    gc.write_matrix(gc.samples.sphere(320), out, range(0, 160, 9), max_distance=0.8)
    again = BytesIO()
    with np.load(out) as table:
        np.savez(again, **table)
    assert out.read_bytes() == again.getvalue()


@pytest.mark.jit
@pytest.mark.parametrize("layout", ["dense", "sparse"])
@pytest.mark.parametrize("method", METHODS, ids=str)
def test_what_is_computed_in_memory_is_the_file_to_the_bit(
    layout: Any, method: dict[str, Any], tmp_path: Path
) -> None:
    mesh = mesh_of(zoo.SMALL["hills"])
    points = random_points(mesh, 9, seed=62)
    out = tmp_path / f"whole.{'npy' if layout == 'dense' else 'npz'}"
    for targets in (points, points[:4]):
        gc.write_matrix(
            mesh, out, points, None if targets is points else targets, max_distance=0.9, **method
        )
        table = gc.distance_matrix(mesh, points, targets, 0.9, layout, **method)
        if layout == "dense":
            np.testing.assert_array_equal(table, np.load(out))
        else:
            whole = load_npz(out)
            for name in ("indptr", "indices", "data"):
                np.testing.assert_array_equal(getattr(table, name), getattr(whole, name))


@pytest.mark.slow
@pytest.mark.parametrize("layout", ["dense", "sparse", "pairs"])
@pytest.mark.parametrize("method", METHODS[1:], ids=str)
@pytest.mark.jit
@zoo.each({name: zoo.SMALL[name] for name in ("saddle", "hills", "two_components", "crags")})
def test_distances_keep_to_their_bound(case: Any, method: dict[str, Any], layout: Any) -> None:
    mesh = mesh_of(case)
    points = [*random_points(mesh, 6, seed=63), 0, len(mesh.vertices) - 1]
    for sources, targets in ((points, points), (points[:3], points[1:])):
        stops = targets[: len(sources)] if layout == "pairs" else targets
        exact, found = (
            gc.distance_matrix(mesh, sources, stops, layout=layout, **options)
            for options in ({}, method)
        )
        if layout == "sparse":
            np.testing.assert_array_equal(found.indptr, exact.indptr)
            np.testing.assert_array_equal(found.indices, exact.indices)
            exact, found = exact.data, found.data
        rounding = SAME * mesh.diagonal
        np.testing.assert_array_equal(np.isinf(found), np.isinf(exact))
        exact, found = exact[np.isfinite(exact)], found[np.isfinite(exact)]
        bound = gc.error_bound(mesh, **method)
        if method["method"] == "fast":
            assert bound.kind == "estimated"
            assert (found >= exact - rounding).all()
            assert (found <= 1.5 * exact + rounding).all()
        else:
            assert bound.kind == "guaranteed"
            allowed = bound.value * (exact if bound.type == "relative" else 1.0)
            assert (found <= exact + rounding).all()
            assert (found >= exact - allowed - rounding).all()


@pytest.mark.parametrize("method", METHODS, ids=str)
def test_the_bound_is_that_of_fields(method: dict[str, Any], tmp_path: Path) -> None:
    mesh = gc.samples.sphere(320)
    solve = {"approximate": gc.approximate_distance, "fast": gc.fast_distance}.get(
        method.get("method", ""), gc.exact_distance
    )
    rest = {name: value for name, value in method.items() if name != "method"}
    bound = gc.error_bound(mesh, **{"method": "exact"} | method)
    assert bound == solve(mesh, 0, **rest).error_bound
    assert bound == gc.write_matrix(mesh, tmp_path / "m.npy", [0], [1], **method).error_bound


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"layout": "pairs"}, "layout is 'pairs'"),
        ({"method": "quick"}, "method is 'quick'"),
        ({"method": "fast", "effort": 3}, "effort is 3"),
        ({"method": "approximate", "relative_error": 0}, "relative_error is 0"),
        ({"method": "approximate", "relative_error": None}, "are both None"),
        ({"method": "approximate", "absolute_error": -1.0}, "absolute_error is -1.0"),
    ],
)
def test_bad_arguments_are_named(changed: dict[str, Any], message: str) -> None:
    mesh = gc.samples.plane(2)
    calls = [lambda: gc.MatrixParts(mesh, [0], [1], **changed)]
    if "method" in changed:
        calls += [
            lambda: gc.distance_matrix(mesh, [0], [1], **changed),
            lambda: gc.error_bound(mesh, **changed),
        ]
    for call in calls:
        with pytest.raises(gc.errors.InvalidArgument, match=message):
            call()
