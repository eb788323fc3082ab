"""Certificates: their bounds enclose the true distances, whoever changed them."""

import ast
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import geodesic_core as gc
from geodesic_core import verify
from geodesic_core.control import Control
from geodesic_core.errors import InvalidArgument
from geodesic_core.fields.certificate import rises_and_jumps
from geodesic_core.tolerances import CERTIFIED
from tests.support import random_meshes, zoo
from tests.support.mesh_files import ply, ply_big_endian, ply_binary
from tests.support.meshes import mesh_of, random_points

ROUNDED = 1e-13
"""Share of the largest distance by which closed forms may be wrong"""

GAP = 1e-9


def surface_of(mesh, values=None):
    positions = None if mesh.lengths is not None else mesh.vertices
    return verify.Surface(positions, mesh.faces, mesh.lengths, values, mesh.barriers)


def source(point, start=0.0):
    if point.vertex_index is not None:
        return verify.Source(point.vertex_index, -1, (0.0, 0.0, 0.0), start)
    return verify.Source(-1, point.face_index, point.barycentric, start)


def check(mesh, field, tolerance=GAP):
    """The bounds enclose the distances of an exact field, closely, and are proved anew."""
    certificate = field.certify()
    known = np.isfinite(field.distances)
    scale = field.distances[known].max()
    assert certificate.holds
    assert certificate.relative_gap <= tolerance
    assert (certificate.lower[known] <= field.distances[known] + ROUNDED * scale).all()
    assert (certificate.upper[known] >= field.distances[known] - ROUNDED * scale).all()
    if np.isinf(field.max_distance):
        assert np.isinf(certificate.lower[~known]).all()
        assert np.isinf(certificate.upper[~known]).all()
    assert certificate.violations.shape == (len(mesh.faces),)
    assert certificate.worst_violation == certificate.violations[certificate.worst_face]
    assert (certificate.violations >= 0.0).all()
    check_by_the_checker(certificate)
    return certificate


def check_by_the_checker(certificate):
    """What kernels bound, paths and the function on the edges, the checker bounds as closely."""
    surface = surface_of(certificate.mesh, certificate.arrays["values"])
    scale = certificate.upper[np.isfinite(certificate.upper)].max()
    function = verify.Pieces(surface, certificate.arrays)
    rises, jumps = verify.rises_and_jumps(surface, function)
    by_kernels = rises_and_jumps(surface, function, Control())
    for bounds, others in zip(by_kernels, (rises, jumps), strict=True):
        assert bounds == pytest.approx(others, rel=2e-9, abs=ROUNDED * scale)


def check_paths(mesh, certificate, sources):
    """Paths of a certificate are as long as the upper bounds say."""
    surface = surface_of(mesh, certificate.arrays["values"])
    paths = verify.Paths(*(certificate.arrays[f"path_{name}"] for name in verify.Paths._fields))
    ends, lengths = verify.measure(surface, sources, paths)
    scale = lengths.max()
    assert certificate.upper[ends] == pytest.approx(lengths, rel=0, abs=ROUNDED * scale)


@zoo.each({name: case for name, case in zoo.KNOWN.items() if case.distances})
def test_bounds_enclose_closed_forms(case):
    mesh = mesh_of(case)
    for v in (0, len(mesh.vertices) // 2):
        true = case.distances(v)
        certificate = gc.exact_distance(mesh, v).certify()
        known = np.isfinite(true)
        rounded = ROUNDED * true[known].max()
        assert (certificate.lower[known] <= true[known] + rounded).all()
        assert (certificate.upper[known] >= true[known] - rounded).all()


@zoo.each(zoo.SMALL)
def test_every_small_mesh_is_certified(case):
    mesh = mesh_of(case)
    check(mesh, gc.exact_distance(mesh, 0, retain="windows"))
    points = random_points(mesh, 3, seed=1)
    starts = [gc.Source(point, 0.1 * i * mesh.extent) for i, point in enumerate(points)]
    certificate = check(mesh, gc.exact_distance(mesh, starts))
    sources = [source(mesh.point(start.point), start.start_distance) for start in starts]
    check_paths(mesh, certificate, sources)


@pytest.mark.jit
@pytest.mark.parametrize("name", ["knot", "terrain", "obstacles", "sphere"])
@pytest.mark.parametrize("share", [0.0, 0.1, 0.5])
@pytest.mark.parametrize("solve", [gc.exact_distance, gc.approximate_distance])
def test_within_a_limit(name, share, solve):
    """What is within is proved as closely; of the rest, that it is not."""
    mesh = getattr(gc.samples, name)(2000)
    inside = gc.SurfacePoint.face(7, (0.2, 0.3, 0.5))
    whole = gc.exact_distance(mesh, inside).distances
    limit = share * whole.max()
    certificate = solve(mesh, inside, max_distance=limit).certify()
    is_within = whole <= limit
    assert certificate.holds
    assert (certificate.lower <= whole + ROUNDED * whole.max()).all()
    assert (certificate.upper[is_within] >= whole[is_within] - ROUNDED * whole.max()).all()
    assert np.isinf(certificate.upper[~is_within]).all()
    assert (certificate.lower[~is_within] >= limit * (1 - 1e-8)).all()
    assert certificate.worst_violation <= 1e-8 * whole.max()
    if solve is gc.exact_distance:
        assert certificate.relative_gap <= GAP
        if share > 0:
            check_by_the_checker(certificate)


@zoo.each(zoo.IRREGULAR)
def test_irregular_meshes_are_certified(case):
    mesh = gc.TriangleMesh(case.vertices, case.faces)
    check(mesh, gc.exact_distance(mesh, 0))


def spiky(rng):
    """Terrain with spikes of up to a thousand times its size."""
    vertices, faces = random_meshes.terrain(rng)
    tips = rng.choice(len(vertices), 1 + len(vertices) // 10, replace=False)
    vertices[tips, 2] += 10.0 ** rng.uniform(0, 3, len(tips))
    return vertices, faces


def needles(rng):
    vertices, faces = random_meshes.ball(rng)
    return zoo.needled(vertices, faces, int(rng.integers(2**31)))[:2]


def soup(rng):
    """Triangles between random points, which cross, and whose edges have many faces."""
    points = rng.normal(size=(int(rng.integers(5, 40)), 3)) * 10.0 ** rng.uniform(-3, 0, 3)
    count = int(rng.integers(3, 80))
    return points, np.array([rng.choice(len(points), 3, replace=False) for _ in range(count)])


@pytest.mark.jit
@pytest.mark.parametrize(
    "kind", [*random_meshes.KINDS, *random_meshes.IRREGULAR_KINDS, spiky, needles, soup]
)
@pytest.mark.parametrize("slice_", range(4))
def test_random_meshes_are_certified(kind, slice_):
    """Exact fields all of them; of approximate ones at least 95 %, which is what is promised."""
    seeds, held = range(50 * slice_, 50 * (slice_ + 1)), 0
    for seed in seeds:
        rng = np.random.default_rng(seed)
        mesh = gc.TriangleMesh(*kind(rng))
        points = random_points(mesh, 1 + seed % 3, seed=seed)
        sources = [gc.Source(point, i * 0.2 * mesh.extent) for i, point in enumerate(points)]
        limit = mesh.extent * rng.uniform(0.1, 1.0) if seed % 5 == 0 else np.inf
        free = {point.face_index for point in points}
        walls = [f for f in range(0, len(mesh.faces), 7) if f not in free and seed % 4 == 0]
        options = {"max_distance": limit, "barriers": walls}
        certificate = gc.exact_distance(mesh, sources, **options).certify()
        assert certificate.holds, seed
        assert certificate.relative_gap <= GAP, seed
        held += gc.approximate_distance(mesh, sources, **options).certify().holds
    assert held >= 0.95 * len(seeds)


@pytest.mark.jit
@pytest.mark.parametrize("name", ["knot", "terrain", "obstacles", "sphere"])
def test_samples_are_certified_from_any_point(name):
    mesh = getattr(gc.samples, name)(1000)
    inside = gc.SurfacePoint.face(7, (0.2, 0.3, 0.5))
    for sources in (inside, gc.SurfacePoint.edge(100, 1, 0.3), [gc.Source(inside, 0.1), 5]):
        check(mesh, gc.exact_distance(mesh, sources))
    check(mesh, gc.exact_distance(mesh, 0, barriers=[3, 4, 90]))
    far = gc.TriangleMesh(mesh.vertices + 1e6 * mesh.extent, mesh.faces)
    check(far, gc.exact_distance(far, 0), tolerance=1e-8)
    by_lengths = mesh.with_lengths(edge_lengths(mesh) * 1.5)
    check(by_lengths, gc.exact_distance(by_lengths, inside))


def edge_lengths(mesh):
    corners = mesh.vertices[mesh.faces]
    return np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)


@pytest.mark.jit
@pytest.mark.parametrize("name", ["knot", "terrain", "obstacles"])
def test_approximate_distances_are_no_longer_than_exact_ones(name):
    mesh = getattr(gc.samples, name)(1000)
    field = gc.approximate_distance(mesh, 0, relative_error=1e-3)
    exact = gc.exact_distance(mesh, 0).distances
    certificate = field.certify()
    assert certificate.holds
    slack = CERTIFIED * exact.max()
    assert (field.distances <= certificate.lower + slack).all()
    assert (certificate.lower <= exact + ROUNDED * exact.max()).all()
    assert ((1.0 - 1e-3) * certificate.upper <= field.distances + slack).all()


@pytest.mark.jit
@pytest.mark.parametrize("share", [0.3, None])
@pytest.mark.parametrize("name", ["knot", "obstacles"])
def test_fast_distances_lie_within_what_is_proved(name, share):
    mesh = getattr(gc.samples, name)(1000)
    exact = gc.exact_distance(mesh, 7).distances
    limit = None if share is None else share * exact.max()
    field = gc.fast_distance(mesh, 7, 1, max_distance=limit)
    distances = field.distances.copy()
    certificate = field.certify()
    known, slack = np.isfinite(distances), ROUNDED * exact.max()
    assert certificate.holds
    assert (certificate.lower[known] <= exact[known] + slack).all()
    assert (distances[known] >= certificate.lower[known] - slack).all()
    bound = field.error_bound
    assert (bound.type, bound.kind) == ("absolute", "certified")
    worst = (distances[known] - exact[known]).max()
    assert worst - slack <= bound.value <= worst + GAP * exact.max()
    np.testing.assert_array_equal(field.distances, distances)


def test_fields_tell_that_they_are_certified():
    field = gc.exact_distance(gc.samples.knot(500), 0)
    assert field.error_bound.kind == "guaranteed"
    certificate = field.certify()
    bound = field.error_bound
    assert (bound.type, bound.kind) == ("absolute", "certified")
    apart = np.maximum(field.distances - certificate.lower, certificate.upper - field.distances)
    assert bound.value == apart.max()


def test_what_has_no_certificate_is_refused():
    mesh = gc.samples.plane(200)
    with pytest.raises(InvalidArgument, match="curves as sources has no certificate"):
        gc.exact_distance(mesh, gc.Curve([0, 1])).certify()


def test_coincident_vertices_and_unreached_parts():
    vertices, faces = zoo.joined(zoo.icosahedron(), zoo.octahedron())
    vertices, faces = np.vstack([vertices, vertices[:1]]), faces.copy()
    faces = np.vstack([faces, [[0, len(vertices) - 1, 1]]])
    mesh = gc.TriangleMesh(vertices, faces)
    certificate = check(mesh, gc.exact_distance(mesh, 0))
    assert certificate.upper[-1] == 0.0
    assert np.isinf(certificate.lower[12:18]).all()


# Forgery ------------------------------------------------------------------------------------------


def saved(mesh, *sources):
    """The surface, the sources, and the arrays of a certificate as its file holds them."""
    field = gc.exact_distance(mesh, list(sources))
    arrays = field.certify().arrays
    of_question = [source(mesh.point(point)) for point in sources]
    return surface_of(mesh, arrays["values"]), of_question, arrays, field.distances


def _raised(rng, arrays, name):
    k = int(rng.integers(len(arrays[name])))
    arrays[name][k] += 10.0 ** rng.uniform(-9, 0) * rng.choice([-1.0, 1.0])


FORGERIES = {
    **{
        f"one {name}": lambda rng, a, n=name: _raised(rng, a, n)
        for name in ("a", "h", "sigma", "t")
    },
    "a value": lambda rng, a: _raised(rng, a, "values"),
    "all values": lambda rng, a: a.update(values=a["values"] * (1 + 10.0 ** rng.uniform(-9, 0))),
    "values of noise": lambda rng, a: a.update(
        values=a["values"] + 0.1 * rng.random(len(a["values"]))
    ),
    "all sigmas raised": lambda rng, a: a.update(sigma=a["sigma"] + 10.0 ** rng.uniform(-9, 0)),
    "all sigmas lowered": lambda rng, a: a.update(sigma=a["sigma"] - 10.0 ** rng.uniform(-9, 0)),
    "everything longer": lambda _, a: a.update(
        values=1.01 * a["values"], a=a["a"], sigma=1.01 * a["sigma"]
    ),
    "noise on all": lambda rng, a: a.update(
        {n: a[n] + 1e-3 * rng.random(len(a[n])) for n in ("a", "h", "sigma")}
    ),
    "pieces shuffled": lambda rng, a: a.update(sigma=rng.permutation(a["sigma"])),
    "heights zero": lambda _, a: a.update(h=0.0 * a["h"]),
    "feet zero": lambda _, a: a.update(a=0.0 * a["a"]),
    "constant": lambda _, a: a.update(values=np.where(a["values"] > 0, 9.0, 0.0)),
    "a source raised": lambda _, a: a["values"].__setitem__(0, 0.1),
    "no number": lambda rng, a: a["sigma"].__setitem__(int(rng.integers(len(a["a"]))), np.nan),
    "no value": lambda rng, a: a["values"].__setitem__(int(rng.integers(len(a["values"]))), np.nan),
    "infinite": lambda rng, a: a["a"].__setitem__(int(rng.integers(len(a["a"]))), np.inf),
    "unreached": lambda rng, a: a["values"].__setitem__(
        int(rng.integers(len(a["values"]))), np.inf
    ),
    "all minus infinity": lambda _, a: a.update(values=np.full(len(a["values"]), -np.inf)),
    "all infinite": lambda _, a: a.update(values=np.full(len(a["values"]), np.inf)),
    "a value more": lambda _, a: a.update(values=np.append(a["values"], 0.0)),
    "huge": lambda rng, a: a["h"].__setitem__(int(rng.integers(len(a["a"]))), 1e200),
    "a negative height": lambda rng, a: a["h"].__setitem__(int(rng.integers(len(a["a"]))), -1.0),
    "a piece fewer": lambda _, a: a.update({n: a[n][:-1] for n in ("a", "h", "sigma", "t")}),
    "counts shifted": lambda _, a: a.update(pieces=np.roll(a["pieces"], 1)),
    "no pieces": lambda _, a: a.update(pieces=0 * a["pieces"]),
    "ends in the middle": lambda _, a: a.update(t=0.5 * a["t"]),
    "an array missing": lambda _, a: a.pop("sigma"),
    "words": lambda _, a: a.update(h=np.full(len(a["h"]), "one")),
}


@pytest.mark.parametrize("kind", list(FORGERIES))
def test_no_forgery_proves_more_than_is_true(kind, request):
    """In the plane, where every distance is that of two positions; 10,000 files in the full run."""
    mesh = gc.samples.plane(60)
    sources = (0, len(mesh.vertices) - 1)
    _, question, given, _ = saved(mesh, *sources)
    away = [np.linalg.norm(mesh.vertices - mesh.vertices[v], axis=1) for v in sources]
    true = np.minimum(*away)
    rng = np.random.default_rng(len(kind))
    for _ in range(340 if request.config.option.full else 12):
        arrays = {name: array.copy() for name, array in given.items()}
        FORGERIES[kind](rng, arrays)
        try:
            values = arrays["values"]
            proof = verify.prove(surface_of(mesh, values), question, arrays)
        except verify.Refused:
            continue
        assert (proof.lower <= true * (1 + 1e-15)).all()


def by_kernels(surface, function):
    return rises_and_jumps(surface, function, Control())


@pytest.mark.jit
@pytest.mark.parametrize("bounds", [verify.rises_and_jumps, by_kernels])
@pytest.mark.parametrize("name", ["knot", "obstacles", "book_of_3"])
def test_violations_bound_what_is_found_by_sampling(name, bounds):
    """On forged functions, at points that are spread over the rims of faces."""
    case = zoo.IRREGULAR.get(name)
    mesh = gc.TriangleMesh(case.vertices, case.faces) if case else getattr(gc.samples, name)(500)
    surface, question, given, _ = saved(mesh, 0)
    rng = np.random.default_rng(3)
    for strength in (1e-6, 1e-3, 0.1):
        arrays = {key: array.copy() for key, array in given.items()}
        for key in ("a", "h", "sigma", "values"):
            arrays[key] += strength * rng.random(len(arrays[key]))
        arrays["values"][0] = 0.0
        tau = verify.prove(surface, question, arrays, bounds).tau
        found = sampled(surface, arrays)
        assert (found <= tau[surface.kept] + 1e-12).all()
        assert found.max() > 0.05 * tau.max()


def sampled(surface, arrays, count=23):
    """The largest f(q) - f(p) - |pq| of each face, at points that are evenly spread."""
    start = np.concatenate([[0], np.cumsum(arrays["pieces"])])
    shares = np.linspace(0.0, 1.0, count)
    places, values = [], []
    for c in range(3):
        tail, head = surface.faces[:, c], surface.faces[:, (c + 1) % 3]
        edge, is_up = surface.of_face[:, c], tail < head
        share = np.where(is_up[:, None], shares, 1.0 - shares)
        low, high = surface.vertices[surface.edges[edge]].swapaxes(0, 1)
        places.append(low[:, None] + share[..., None] * (high - low)[:, None])
        length = np.linalg.norm(high - low, axis=1)
        of_edge = np.full(share.shape, np.nan)
        for i, e in enumerate(edge.tolist()):
            rows = np.arange(start[e], start[e + 1])
            if len(rows):
                k = rows[
                    np.searchsorted(arrays["t"][rows], share[i], "left").clip(0, len(rows) - 1)
                ]
                away = np.hypot(share[i] * length[i] - arrays["a"][k], arrays["h"][k])
                of_edge[i] = arrays["sigma"][k] + away
        ends = np.isin(share, (0.0, 1.0)) & surface.is_rim[edge][:, None]
        at = np.where(
            share == 0.0, surface.edges[edge, 0][:, None], surface.edges[edge, 1][:, None]
        )
        values.append(np.where(ends, arrays["values"][at], of_edge))
    place, value = np.concatenate(places, axis=1), np.concatenate(values, axis=1)
    apart = np.linalg.norm(place[:, :, None] - place[:, None], axis=3)
    return np.nanmax(value[:, None, :] - value[:, :, None] - apart, axis=(1, 2))


@pytest.mark.jit
def test_a_lost_window_is_told_by_its_face():
    mesh = gc.samples.knot(500)
    surface, question, given, distances = saved(mesh, 0)
    scale, rng = distances.max(), np.random.default_rng(5)
    for k in rng.choice(len(given["a"]), 40, replace=False):
        arrays = {name: array.copy() for name, array in given.items()}
        arrays["sigma"][k] -= 1e-3 * scale
        edge = int(np.searchsorted(np.cumsum(given["pieces"]), k, "right"))
        proof = verify.prove(surface, question, arrays)
        of_edge = (surface.of_face == edge).any(axis=1)
        assert of_edge[proof.tau.argmax()]
        assert proof.tau.max() > 1e-5 * scale


# The checker by itself ----------------------------------------------------------------------------


CHECKER = Path(verify.__file__)


def run_checker(folder, *arguments):
    """Run the file by itself, where the library cannot be imported."""
    blocked = "import sys; sys.modules['geodesic_core'] = None; import runpy; "
    script = (
        f"{blocked}sys.argv[0] = 'verify'; runpy.run_path({str(CHECKER)!r}, run_name='__main__')"
    )
    files = [str(folder / name) for name in arguments[:2]]
    command = [sys.executable, "-I", "-c", script, *files, *arguments[2:]]
    return subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603


def write_obj(path, mesh):
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in mesh.vertices.tolist()]
    lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in mesh.faces.tolist()]
    path.write_text("\n".join(lines))


def test_the_checker_proves_files_without_the_library(tmp_path):
    mesh = gc.samples.knot(500)
    write_obj(tmp_path / "mesh.obj", mesh)
    field = gc.exact_distance(mesh, [0, gc.Source(gc.SurfacePoint.face(7, (0.2, 0.3, 0.5)), 0.25)])
    field.certify().save(tmp_path / "proof.npz")
    sources = "--source", "0", "--source", "f7:0.2,0.3,0.5@0.25"
    done = run_checker(tmp_path, "mesh.obj", "proof.npz", *sources)
    assert done.returncode == 0, done.stderr
    share = float(re.search(r"gap +\S+, (\S+) of that", done.stdout)[1])
    assert 0.0 < share < GAP
    for wrong in (["--source", "1"], ["--source", "0", "--barriers", "2"]):
        refused = run_checker(tmp_path, "mesh.obj", "proof.npz", *wrong)
        assert refused.returncode == 1
        assert re.match(r"refused: [a-z]", refused.stderr)


def ply_with_more(vertices, faces):
    """Return a file with colours, edges, and a number before the corners of each face."""
    head = (
        "ply\r\nformat binary_little_endian 1.0\r\ncomment of a scanner\r\n"
        f"element vertex {len(vertices)}\r\nproperty float x\r\nproperty float y\r\n"
        "property float z\r\nproperty uchar red\r\nelement edge 1\r\nproperty int from\r\n"
        f"element face {len(faces)}\r\nproperty short group\r\n"
        "property list uint8 uint32 vertex_index\r\nend_header\r\n"
    )
    points = np.zeros(len(vertices), [("at", "<f4", 3), ("red", "u1")])
    rows = np.zeros(len(faces), [("group", "<i2"), ("count", "u1"), ("corners", "<u4", 3)])
    points["at"], rows["count"], rows["corners"] = vertices, 3, faces
    return head.encode() + points.tobytes() + np.int32(7).tobytes() + rows.tobytes()


@pytest.mark.parametrize("write", [ply, ply_binary, ply_big_endian, ply_with_more])
def test_the_checker_reads_ply(write, tmp_path):
    mesh = gc.samples.terrain(200)
    (tmp_path / "mesh.ply").write_bytes(write(mesh.vertices, mesh.faces))
    mesh = gc.load_mesh(tmp_path / "mesh.ply")
    gc.exact_distance(mesh, 3).certify().save(tmp_path / "proof.npz")
    vertices, faces, _ = verify.read_mesh(tmp_path / "mesh.ply")
    np.testing.assert_array_equal(vertices, mesh.vertices)
    np.testing.assert_array_equal(faces, mesh.faces)
    done = run_checker(tmp_path, "mesh.ply", "proof.npz", "--source", "3")
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    "body", [b"", b"ply\n", b"ply\nformat text 1.0\nend_header\n", "quads", "short"]
)
def test_the_checker_refuses_ply_that_it_cannot_read(body, tmp_path):
    mesh = gc.samples.plane(50)
    gc.exact_distance(mesh, 3).certify().save(tmp_path / "proof.npz")
    if body == "quads":
        body = ply(np.eye(4, 3), [[0, 1, 2, 3]])
    elif body == "short":
        body = ply_binary(mesh.vertices, mesh.faces)[:-5]
    (tmp_path / "mesh.ply").write_bytes(body)
    refused = run_checker(tmp_path, "mesh.ply", "proof.npz", "--source", "3")
    assert refused.returncode == 1
    assert re.match(r"refused: [A-Za-z]", refused.stderr), refused.stderr


def test_the_checker_knows_lengths_and_barriers(tmp_path):
    mesh = gc.samples.terrain(300)
    mesh = mesh.with_lengths(edge_lengths(mesh))
    gc.exact_distance(mesh, 3, barriers=[20, 21]).certify().save(tmp_path / "proof.npz")
    np.savez(
        tmp_path / "mesh.npz", faces=mesh.faces, lengths=mesh.lengths, vertices=0.0 * mesh.vertices
    )
    given = "mesh.npz", "proof.npz", "--source", "v3", "--barriers", "20,21"
    done = run_checker(tmp_path, *given)
    assert done.returncode == 0, done.stderr


def test_the_checker_needs_numpy_alone():
    nodes = ast.walk(ast.parse(CHECKER.read_text()))
    froms = {node.module for node in nodes if isinstance(node, ast.ImportFrom)}
    assert froms <= {"collections.abc", "pathlib", "typing", "zipfile"}
    lines = re.findall(r"^import (.+)$", CHECKER.read_text(), re.MULTILINE)
    assert lines == ["argparse", "sys", "numpy as np"]


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"path_tails": 0.5}, "a point of a path is beside its face"),
        ({"path_faces": 1}, "a path"),
        ({"path_first": 1}, "there are no paths"),
    ],
)
def test_paths_that_are_none_are_refused(change, why):
    mesh = gc.samples.plane(60)
    surface, question, arrays, _ = saved(mesh, 0)
    for name, shift in change.items():
        arrays[name] = arrays[name] + shift
    paths = verify.Paths(*(arrays[f"path_{name}"] for name in verify.Paths._fields))
    with pytest.raises(verify.Refused, match=why):
        verify.measure(surface, question, paths)


def test_a_path_from_elsewhere_is_refused():
    mesh = gc.samples.plane(60)
    surface, _, arrays, _ = saved(mesh, 0)
    paths = verify.Paths(*(arrays[f"path_{name}"] for name in verify.Paths._fields))
    other = [source(mesh.point(5))]
    with pytest.raises(verify.Refused, match="a path does not begin at a source"):
        verify.measure(surface, other, paths)


# Tolerances ---------------------------------------------------------------------------------------


def test_certified():
    """Bounds that differ by more prove no field, those of exact fields differ by far less."""
    certificate = gc.exact_distance(gc.samples.knot(500), 0).certify()
    assert certificate.relative_gap < 1e-2 * CERTIFIED


@pytest.mark.parametrize("sources", [[3], [gc.Source(3, 2.0), gc.Source(3, 1.0)], [6], [0, 4]])
def test_sources_of_a_place_without_faces(sources):
    """A face whose corners are one place is none; a start distance counts there as elsewhere."""
    points = [[0, 0, 0], [1, 0, 0], [0, 1, 0], *[[5, 5, 5]] * 3, [9, 9, 9]]
    mesh = gc.TriangleMesh(points, [[0, 1, 2], [3, 4, 5]])
    field = gc.exact_distance(mesh, sources)
    certificate = field.certify()
    assert certificate.holds
    assert (certificate.lower <= field.distances).all()
    assert certificate.upper.tolist() == pytest.approx(field.distances.tolist(), rel=1e-9)
