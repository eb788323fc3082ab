"""Faces of certificates in balls of 200 bits: they agree with bounds by doubles, forged or not."""

import subprocess
import sys

import numpy as np
import pytest

import geodesic_core as gc
from geodesic_core import verify
from geodesic_core.verify_slowly import disagreements, tau
from tests.core.fields.test_certificate import FORGERIES, sampled, saved, write_obj
from tests.support import zoo
from tests.support.paths import ROOT

FACES = 6
NUMBERS = [
    *("one a", "one sigma", "a value", "all values", "values of noise", "constant"),
    *("all sigmas raised", "all sigmas lowered", "noise on all", "heights zero"),
]
"""Forgeries after which the file still is a function on the edges"""


def proved(mesh, *starts):
    surface, question, given, _ = saved(mesh, *starts)
    return surface, question, given, verify.prove(surface, question, given)


@pytest.mark.parametrize("name", ["knot", "terrain", "cortex", "obstacles"])
@pytest.mark.parametrize("start", [0, gc.SurfacePoint.face(7, (0.2, 0.3, 0.5))])
def test_certificates_of_exact_fields_agree(name, start):
    surface, question, given, proof = proved(getattr(gc.samples, name)(500), start)
    rows = np.random.default_rng(1).permutation(len(surface.faces))[:FACES]
    assert not disagreements(surface, given, question, proof, rows)


@pytest.mark.jit
@pytest.mark.parametrize("kind", NUMBERS)
@pytest.mark.parametrize("name", ["plane", "book_of_3"])
def test_of_forged_functions_it_is_between_samples_and_bounds(kind, name):
    case = zoo.IRREGULAR.get(name)
    mesh = gc.TriangleMesh(case.vertices, case.faces) if case else gc.samples.plane(60)
    surface, _, given, _ = proved(mesh, 0)
    FORGERIES[kind](np.random.default_rng(2), given)
    bounds, jumps = verify.rises_and_jumps(surface, verify.Pieces(surface, given))
    bounds += jumps[surface.of_face].sum(axis=1)
    found = sampled(surface, given)
    for row in np.argsort(-bounds)[:FACES]:
        exact = float(tau(surface, given, int(row), []).mid())
        assert found[row] - 1e-12 <= exact <= bounds[row]


def test_a_bound_that_is_too_low_is_found():
    surface, question, given, proof = proved(gc.samples.plane(60), 0)
    given["sigma"][3] += 0.01
    wrong = disagreements(surface, given, question, proof, np.arange(len(surface.faces)))
    edge = np.searchsorted(np.cumsum(given["pieces"]), 3, "right")
    beside = surface.kept[(surface.of_face == edge).any(axis=1)]
    assert {face for face, *_ in wrong} == set(beside.tolist())
    assert all(exact > bound for _, exact, bound in wrong)


def test_lengths_alone():
    mesh = gc.samples.terrain(500)
    ends = mesh.vertices[mesh.faces] - mesh.vertices[np.roll(mesh.faces, -1, axis=1)]
    surface, question, given, proof = proved(mesh.with_lengths(np.linalg.norm(ends, axis=2)), 3)
    assert not disagreements(surface, given, question, proof, np.arange(FACES))


def test_the_program_says_what_it_found(tmp_path):
    mesh = gc.samples.knot(500)
    write_obj(tmp_path / "knot.obj", mesh)
    gc.exact_distance(mesh, 0).certify().save(tmp_path / "proof.npz")
    command = [sys.executable, "-m", "geodesic_core.verify_slowly"]
    given = [str(tmp_path / name) for name in ("knot.obj", "proof.npz")]
    asked = [*command, *given, "--faces", "3", "--seed", "1", "--source"]
    done = subprocess.run([*asked, "0"], cwd=ROOT, capture_output=True, text=True, check=False)  # noqa: S603
    assert done.stdout == "checked   3 faces in balls of 200 bits, 0 do not agree\n"
    refused = subprocess.run([*asked, "1"], cwd=ROOT, capture_output=True, text=True, check=False)  # noqa: S603
    assert refused.returncode == 1
    assert refused.stderr.startswith("refused: the value at source 0 is above")
