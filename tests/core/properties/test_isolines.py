"""Properties of isolines on any mesh."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

import geodesic_core as gc
from tests.support.isoline_checks import check_crossings, check_ends, check_pieces, check_points
from tests.support.meshes import mesh_of, random_points
from tests.support.random_meshes import cases


@given(cases(), st.integers(0, 2**31 - 1), st.floats(0.05, 1.05))
def test_lines_are_at_their_level_and_complete(case, seed, share):
    mesh = mesh_of(case)
    source = random_points(mesh, 3, seed)[seed % 3]
    field = gc.exact_distance(mesh, source, retain="windows")
    level = share * float(field.distances[np.isfinite(field.distances)].max())
    (lines,) = field.isolines([level])
    for line in lines:
        check_pieces(mesh, line)
        check_ends(mesh, line)
    if lines:
        check_points(mesh, source, level, lines, most=20)
    check_crossings(mesh, source, [level], [lines], samples=16)
