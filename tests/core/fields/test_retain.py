"""The argument ``retain``: a field holds more or less in memory, and its answers stay the same."""

import numpy as np
import pytest

import geodesic_core as gc

WORDS = "distances", "paths", "windows"
MESH = gc.samples.knot(500)


@pytest.mark.jit
@pytest.mark.parametrize("solve", [gc.exact_distance, gc.approximate_distance])
def test_each_word_holds_more_and_answers_the_same(solve):
    least, *others = (solve(MESH, [3, 50], retain=word) for word in WORDS)
    sizes = [field.nbytes for field in (least, *others)]
    assert sizes == sorted(set(sizes))
    path, levels = least.path_to(200), least.levels(2)
    for field in others:
        assert field.distances.tobytes() == least.distances.tobytes()
        assert field.nearest_source.tobytes() == least.nearest_source.tobytes()
        assert field.path_to(200).points.tobytes() == path.points.tobytes()
        assert field.gradient.tobytes() == least.gradient.tobytes()
        for lines, expected in zip(field.isolines(levels), least.isolines(levels), strict=True):
            for line, other in zip(lines, expected, strict=True):
                np.testing.assert_array_equal(line.points, other.points)


@pytest.mark.parametrize(
    ("solve", "default"), [(gc.exact_distance, "paths"), (gc.approximate_distance, "distances")]
)
@pytest.mark.jit
def test_the_default_is_as_documented(solve, default):
    assert solve(MESH, 0).nbytes == solve(MESH, 0, retain=default).nbytes
    assert getattr(gc.Solver(MESH), solve.__name__)(0).nbytes == solve(MESH, 0).nbytes


@pytest.mark.jit
def test_a_field_of_distances_sweeps_again_for_its_first_path():
    """Under the control of that call; the second path needs no sweep."""
    field = gc.exact_distance(MESH, 0, retain="distances")
    with pytest.raises(gc.errors.Cancelled):
        field.path_to(200, cancel=lambda: True)
    length = field.path_to(200).length
    assert field.path_to(200, cancel=lambda: True).length == length
    assert length == pytest.approx(field.distances[200], rel=1e-12)


@pytest.mark.jit
def test_a_field_of_distances_comes_back_from_its_arrays():
    field = gc.exact_distance(MESH, 0, retain="distances")
    assert "winner" not in field.arrays()
    again = gc.DistanceField.from_arrays(MESH, field.arrays())
    assert again.path_to(200).points.tobytes() == field.path_to(200).points.tobytes()


@pytest.mark.parametrize("solve", [gc.exact_distance, gc.approximate_distance])
@pytest.mark.parametrize("word", ["all", "", None, True, ["paths"]])
def test_any_other_word_is_refused(solve, word):
    with pytest.raises(gc.errors.InvalidArgument, match="retain is"):
        solve(MESH, 0, retain=word)
