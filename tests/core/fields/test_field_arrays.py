"""A field that is made of another's arrays answers all questions as that does, to the bit."""

import io
from itertools import product
from typing import Any

import numpy as np
import pytest

import geodesic_core as gc

MESH = gc.samples.terrain(1500)
FREE = (3, (0.2, 0.3, 0.5))
POINTS = [
    7,
    gc.SurfacePoint.face(*FREE),
    gc.SurfacePoint.edge(900, 1, 0.3),
    gc.SurfacePoint.face(1200, (0.6, 0.3, 0.1)),
]
LINE = gc.Curve([POINTS[1], *MESH.faces[3].tolist()])
SOURCES: dict[str, Any] = {
    "a vertex": [3],
    "points that start later": [gc.Source(3, 0.125), gc.Source(POINTS[2], 0.25)],
    "a curve": [LINE],
    "a curve and a point": [gc.Source(LINE, 0.5), gc.Source(POINTS[3], 0.25)],
}
KINDS: dict[str, Any] = {
    "exact": lambda **options: gc.exact_distance(MESH, **options),
    "exact, windows kept": lambda **options: gc.exact_distance(MESH, retain="windows", **options),
    "approximate": lambda **options: gc.approximate_distance(MESH, **options),
    "by any error": lambda **options: gc.approximate_distance(
        MESH, relative_error=0.9, absolute_error=0.1, **options
    ),
    "for paths": lambda **options: gc.approximate_distance(MESH, retain="paths", **options),
    "for isolines": lambda **options: gc.approximate_distance(
        MESH, relative_error=None, absolute_error=0.01, retain="windows", **options
    ),
}


def kept_on_disk(arrays: dict[str, Any]) -> dict[str, Any]:
    file = io.BytesIO()
    np.savez(file, allow_pickle=False, **arrays)
    file.seek(0)
    with np.load(file, allow_pickle=False) as kept:
        return dict(kept)


def answers(field: gc.DistanceField) -> list[Any]:
    highest = float(field.distances[np.isfinite(field.distances)].max())
    places = [point for point in POINTS if np.isfinite(field.distance_at(point))]
    return [
        field.distances,
        field.nearest_source,
        field.max_distance,
        field.error_bound,
        field.stats,
        [field.distance_at(point) for point in POINTS],
        [field.nearest_source_at(point) for point in POINTS],
        [field.path_to(point).points for point in places],
        [line.points for lines in field.isolines([highest / 3, highest / 2]) for line in lines],
        field.gradient,
    ]


@pytest.mark.jit
@pytest.mark.parametrize(
    ("sources", "kind", "rest"),
    [*product(SOURCES, KINDS, [{}, {"max_distance": 0.4, "targets": [POINTS[1], POINTS[1], 7]}])],
)
def test_a_field_is_what_its_arrays_say(sources: str, kind: str, rest: dict[str, Any]) -> None:
    field = KINDS[kind](sources=SOURCES[sources], **rest)

    again = gc.DistanceField.from_arrays(MESH, kept_on_disk(field.arrays()))

    np.testing.assert_equal(answers(again), answers(field))
    assert again.nbytes == field.nbytes


@pytest.mark.jit
def test_it_needs_no_sweep_for_what_the_first_one_knew(monkeypatch: pytest.MonkeyPatch) -> None:
    fields = [
        gc.exact_distance(MESH, 3, targets=[POINTS[1]], retain="windows"),
        gc.approximate_distance(MESH, 3, targets=[POINTS[1]], retain="windows"),
    ]
    kept = [kept_on_disk(field.arrays()) for field in fields]

    def never(*_: Any, **__: Any) -> Any:
        raise AssertionError("a sweep")

    monkeypatch.setattr("geodesic_core.fields.sweeps.sweep_nodes", never)
    for arrays in kept:
        field = gc.DistanceField.from_arrays(MESH, arrays)
        field.distance_at(POINTS[1])
        field.path_to(POINTS[1])
        field.isolines([0.1])


@pytest.mark.jit
def test_sources_are_spelled_canonically() -> None:
    field = gc.exact_distance(MESH, [3, gc.Source(LINE, 0.5)])

    again = gc.DistanceField.from_arrays(MESH, field.arrays())

    assert again.sources == (
        gc.Source(MESH.point(3), 0.0),
        gc.Source(gc.Curve(tuple(MESH.point(point) for point in LINE.points)), 0.5),
    )


@pytest.mark.jit
def test_the_mesh_keeps_its_barriers() -> None:
    among = MESH.with_barriers(range(200, 260))
    field = gc.exact_distance(among, 3)

    again = gc.DistanceField.from_arrays(among, field.arrays())

    np.testing.assert_equal(answers(again), answers(field))


@pytest.mark.jit
@pytest.mark.parametrize("name", ["distances", "scalar", "temperature", "Distance", "", "arrays"])
@pytest.mark.parametrize("kind", ["exact", "exact, windows kept", "for paths", "for isolines"])
def test_an_array_of_another_name_is_refused(kind: str, name: str) -> None:
    """It would be ignored: isolines would be those of the field itself."""
    arrays = KINDS[kind](sources=[3]).arrays()
    foreign = arrays | {name: np.arange(len(MESH.vertices), dtype=float)}
    with pytest.raises(gc.errors.InvalidArgument, match=f"arrays has {name!r}, which is none of"):
        gc.DistanceField.from_arrays(MESH, foreign)


@pytest.mark.jit
def test_arrays_of_what_a_field_has_not_retained_are_refused() -> None:
    """Half of what it needs for paths, beside a field without, is not taken for paths."""
    full = gc.exact_distance(MESH, 3).arrays()
    bare = gc.exact_distance(MESH, 3, retain="distances").arrays()
    for name in full.keys() - bare.keys() - {"winner"}:
        with pytest.raises(gc.errors.InvalidArgument, match=f"arrays has {name!r}"):
            gc.DistanceField.from_arrays(MESH, bare | {name: full[name]})
    gc.DistanceField.from_arrays(MESH, bare)


@pytest.mark.jit
def test_a_missing_array_is_named() -> None:
    for arrays in (gc.exact_distance(MESH, 3).arrays(), gc.fast_distance(MESH, 3).arrays()):
        for name in arrays.keys() - {"effort", "winner"}:  # without these, others are foreign
            rest = {other: array for other, array in arrays.items() if other != name}
            with pytest.raises(KeyError, match=name):
                gc.DistanceField.from_arrays(MESH, rest)
