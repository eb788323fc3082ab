"""Random small meshes and curves to cut them along, and what must hold of each cut."""

from collections import Counter
from collections.abc import Iterator, Sequence

import numpy as np

import geodesic_core as gc

STEPS = 2**41  # weights are multiples of its inverse: 2**-40, and half of it in the middle of edges
SHIFTS = (0.0, 1e-15, 1e-13, 1e-12, 1e-11, 1e-10, 1e-9, 3e-9, 1e-8, 1e-7, 1e-6)
MOVED = 4e-9
"""Share of the diagonal by which a curve may move: it snaps within 2**-30 of an edge, some times"""


def flat_grid(n: int) -> tuple[np.ndarray, np.ndarray]:
    x, y = np.meshgrid(np.arange(n + 1.0), np.arange(n + 1.0))
    vertices = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
    at = np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
    a, b, c, d = at[:-1, :-1].ravel(), at[:-1, 1:].ravel(), at[1:, 1:].ravel(), at[1:, :-1].ravel()
    return vertices, np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])


def fins(random: np.random.Generator, sheets: int) -> tuple[np.ndarray, np.ndarray]:
    """Sheets that meet in a line of two edges, wound either way."""
    vertices, faces = [(0.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, 2.0)], []
    for angle in random.uniform(0.0, 2.0 * np.pi, sheets):
        first = len(vertices)
        vertices += [(np.cos(angle), np.sin(angle), z) for z in (0.0, 1.0, 2.0)]
        own = [(0, 1, first), (1, first + 1, first), (1, 2, first + 1), (2, first + 2, first + 1)]
        faces += [face[:: random.choice([1, -1])] for face in own]
    return np.array(vertices), np.array(faces)


def random_mesh(kind: str, random: np.random.Generator) -> gc.TriangleMesh:
    vertices, faces = flat_grid(int(random.integers(2, 5)))
    match kind:
        case "bumpy":
            vertices += random.normal(0.0, 0.2, vertices.shape)
        case "flat":
            vertices[:, :2] += random.uniform(-0.3, 0.3, (len(vertices), 2))
        case "slivers":
            vertices[:, 1] *= 10.0 ** random.uniform(-5.0, -1.0)
            vertices[:, 2] += random.normal(0.0, 0.01, len(vertices))
        case "needles":
            vertices[:, 0] **= 1.0 + 8.0 * random.random()
            vertices[:, 1] *= 1e-3
        case "fins":
            vertices, faces = fins(random, int(random.integers(3, 6)))
        case "two faces":
            vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, random.random()]], float)
            faces = np.array([[0, 1, 2], [1, 3, 2]])
        case "sphere":
            return gc.samples.sphere(80)
        case "grid":
            pass
    if random.random() < 0.3:
        vertices += random.choice([10.0, 100.0, 1000.0]) * random.normal(size=3)
    flips = random.random(len(faces)) < (0.3 if random.random() < 0.3 else 0.0)
    faces[flips] = faces[flips][:, ::-1]
    return gc.TriangleMesh(vertices, faces)


KINDS = ("flat", "bumpy", "slivers", "needles", "grid", "fins", "two faces", "sphere")


def random_weights(random: np.random.Generator) -> tuple[float, float, float]:
    """Of a corner, of a point of an edge or of a face, often a special one."""
    kind = random.choice(["corner", "edge", "edge", "edge", "face", "middle", "near"])
    weights = np.zeros(3)
    i, j, k = random.permutation(3)
    t = random.choice([random.random(), 0.5, 10.0 ** random.uniform(-13.0, -6.0)])
    match kind:
        case "corner":
            weights[i] = 1.0
        case "edge":
            weights[i], weights[j] = 1.0 - t, t
        case "face":
            weights[:] = random.dirichlet([1.0, 1.0, 1.0])
        case "middle":
            weights[:] = 1.0 / 3.0
        case "near":
            t = 10.0 ** random.uniform(-12.0, -7.0)
            weights[i], weights[j], weights[k] = (1.0 - t) / 2.0, (1.0 - t) / 2.0, t
    u, v, w = weights.tolist()
    return u, v, w


def faces_with(mesh: gc.TriangleMesh, point: gc.SurfacePoint) -> np.ndarray:
    corners = mesh.faces[point.face_index][np.array(point.barycentric) > 0.0]
    return np.flatnonzero(np.isin(mesh.faces, corners).sum(axis=1) == len(corners))


def random_curve(mesh: gc.TriangleMesh, random: np.random.Generator) -> gc.Curve:
    """Points at random, each in a face of the one before."""
    face, points = int(random.integers(len(mesh.faces))), []
    for _ in range(int(random.integers(1, 9))):
        points.append(mesh.point(gc.SurfacePoint.face(face, random_weights(random))))
        face = int(random.choice(faces_with(mesh, points[-1])))
    return gc.Curve(points)


def shifted(
    mesh: gc.TriangleMesh, curve: gc.Curve, shift: float, random: np.random.Generator
) -> gc.Curve:
    """The curve with each weight that is not 0 changed a little."""
    points = []
    for point in curve.points:
        weights = np.array(point.barycentric)
        weights += (weights > 0.0) * shift * random.uniform(-1.0, 1.0, 3)
        weights = weights.clip(min=0.0) / weights.clip(min=0.0).sum()
        points.append(mesh.point(gc.SurfacePoint.face(point.face_index, tuple(weights.tolist()))))
    return gc.Curve(points)


def random_curves(
    mesh: gc.TriangleMesh, random: np.random.Generator
) -> list[gc.Curve | gc.SurfaceCurve]:
    most = 28 if len(mesh.faces) == 2 else 8
    curves: list[gc.Curve | gc.SurfaceCurve] = []
    for _ in range(int(random.integers(1, most))):
        curve = random_curve(mesh, random)
        curves.append(curve)
        if random.random() < 0.3:
            curves.append(shifted(mesh, curve, random.choice(SHIFTS), random))
        if random.random() < 0.3:
            ends = random.integers(len(mesh.vertices), size=2).tolist()
            curves.append(gc.shortest_path(mesh, *ends))
        if random.random() < 0.2:
            curves += random_lines(mesh, random)
    return curves


def random_lines(mesh: gc.TriangleMesh, random: np.random.Generator) -> list[gc.SurfaceCurve]:
    """Lines of equal distance, level sets, borders, or the boundary."""
    sources = random.choice(len(mesh.vertices), 2, replace=False).tolist()
    match int(random.integers(4)):
        case 0:
            field = gc.exact_distance(mesh, sources[0])
            return field.isolines([float(field.levels(1)[0])])[0]
        case 1:
            values = random.normal(size=len(mesh.vertices))
            return gc.ScalarField(mesh, values).isolines([0.2])[0]
        case 2:
            return list(gc.exact_distance(mesh, sources).borders())
        case _:
            return mesh.boundaries()


def polylines(
    curves: Sequence[gc.Curve | gc.SurfaceCurve], mesh: gc.TriangleMesh
) -> Iterator[np.ndarray]:
    for curve in curves:
        points = list(curve.locations if isinstance(curve, gc.SurfaceCurve) else curve.points)
        if isinstance(curve, gc.SurfaceCurve) and curve.closed:
            points.append(points[0])
        yield np.array([mesh.position(point) for point in points])


def places_in_faces(cut: gc.CutMesh) -> np.ndarray:
    """Corners of all faces as whole weights in the old faces, (F', 3, 3) of Python's integers."""
    whole = cut.location_weights * STEPS
    assert (whole == np.rint(whole)).all()
    whole = whole.astype(np.int64).astype(object)
    old, places = cut.old.faces, np.zeros((len(cut.faces), 3, 3), object)
    for f, (corners, face) in enumerate(zip(cut.faces, cut.face_of, strict=True)):
        for k, vertex in enumerate(corners):
            own = old[cut.location_faces[vertex]]
            for i, corner in enumerate(old[face]):
                places[f, k, i] = whole[vertex][own == corner].sum()
    return places


def check_tiling(cut: gc.CutMesh) -> None:
    """Each old face is tiled exactly, in whole numbers, by triangles wound as it is."""
    places = places_in_faces(cut)
    assert (places.sum(axis=2) == STEPS).all(), "a corner is not in its old face"
    step = places[:, 1:, 1:] - places[:, :1, 1:]
    areas = step[:, 0, 0] * step[:, 1, 1] - step[:, 0, 1] * step[:, 1, 0]
    assert (areas > 0).all()
    sums: Counter[int] = Counter()
    for face, area in zip(cut.face_of.tolist(), areas, strict=True):
        sums[face] += area
    assert sums == dict.fromkeys(range(len(cut.old.faces)), STEPS * STEPS)


def edges(faces: np.ndarray) -> Counter[tuple[int, int]]:
    ends = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    return Counter(map(tuple, ends.tolist()))


def check_edges(cut: gc.CutMesh) -> None:
    """Each new edge has the faces of the old one that it is on, or two in an old face."""
    old = edges(cut.old.faces)
    support = [
        set(cut.old.faces[face][weights > 0.0].tolist())
        for face, weights in zip(cut.location_faces, cut.location_weights, strict=True)
    ]
    for (u, v), count in edges(cut.copy_of[cut.faces]).items():
        corners = tuple(sorted(support[u] | support[v]))
        assert count == old.get(corners, 2), (u, v)


def check_positions(cut: gc.CutMesh) -> None:
    """Old vertices stay; area stays, and no face turns over by more than its corners round."""
    old = cut.old
    assert np.array_equal(cut.vertices[: len(old.vertices)], old.vertices)
    corners, before = cut.vertices[cut.faces], old.vertices[old.faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal_before = np.cross(before[:, 1] - before[:, 0], before[:, 2] - before[:, 0])
    area, total = np.linalg.norm(normal, axis=1), np.linalg.norm(normal_before, axis=1).sum()
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    ulp = np.spacing(np.abs(old.vertices).max())
    assert abs(area.sum() - total) <= 1e-12 * total + 2.0 * ulp * longest.sum()
    upward = (normal * normal_before[cut.face_of]).sum(axis=1)
    heights = upward / np.linalg.norm(normal_before[cut.face_of], axis=1) / longest
    assert (heights[longest > 0.0] >= -4.0 * ulp).all()


def check_curves(cut: gc.CutMesh, curves: Sequence[gc.Curve | gc.SurfaceCurve]) -> None:
    """Each curve is a chain of edges from its beginning to its end, which hardly moved."""
    known = edges(cut.copy_of[cut.faces])
    assert all(tuple(edge) in known for edge in cut.curve_edges.tolist())
    reach = MOVED * cut.old.diagonal
    for i, points in enumerate(polylines(curves, cut.old)):
        own = cut.curve_edges[cut.edge_curves[cut.edge_curves[:, 1] == i, 0]]
        if len(own) == 0:
            assert np.linalg.norm(points - points[0], axis=1).max() <= 2 * len(points) * reach
            continue
        ends = cut.vertices[own]
        for point in points:
            assert np.linalg.norm(ends - point, axis=2).min() <= reach
        for middle in np.concatenate([ends.reshape(-1, 3), ends.mean(axis=1)]):
            assert from_polyline(middle, points) <= reach
        assert is_connected(own)
        length = np.linalg.norm(np.diff(points, axis=0), axis=1).sum()
        assert np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum() <= length + len(own) * reach


def from_polyline(point: np.ndarray, points: np.ndarray) -> float:
    start, step = points[:-1], np.diff(points, axis=0)
    t = ((point - start) * step).sum(axis=1) / np.maximum((step * step).sum(axis=1), 1e-300)
    foot = start + t.clip(0.0, 1.0)[:, None] * step
    return float(np.linalg.norm(point - foot, axis=1).min())


def is_connected(pairs: np.ndarray) -> bool:
    reached, rest = {int(pairs[0, 0])}, pairs.tolist()
    while found := [pair for pair in rest if reached & set(pair)]:
        reached.update(*found)
        rest = [pair for pair in rest if pair not in found]
    return not rest


def check_distances(cut: gc.CutMesh, source: int) -> None:
    """Distances on a mesh that was not taken apart are those before."""
    before = gc.exact_distance(cut.old, source).distances
    after = gc.exact_distance(cut.mesh, source).distances[: len(before)]
    reached = np.isfinite(before)
    assert np.array_equal(reached, np.isfinite(after))
    assert np.abs(after - before)[reached].max() <= 1e-10 * max(
        before[reached].max(), cut.old.extent
    )


def check_separated(apart: gc.CutMesh) -> None:
    """No two faces share an edge of a curve, and corners have one vertex in each fan."""
    opened = set(map(tuple, apart.curve_edges.tolist()))
    shared = [edge for edge, count in edges(apart.faces).items() if count > 1]
    for u, v in shared:
        assert tuple(sorted((int(apart.copy_of[u]), int(apart.copy_of[v])))) not in opened
    assert np.array_equal(apart.vertices, apart.vertices[apart.copy_of])


def check_cut(mesh: gc.TriangleMesh, curves: Sequence[gc.Curve | gc.SurfaceCurve]) -> None:
    """All of this, of the cut mesh whole and taken apart."""
    whole, apart = gc.cut(mesh, curves, separate=False), gc.cut(mesh, curves)
    for cut in (whole, apart):
        check_tiling(cut)
        check_edges(cut)
        check_positions(cut)
        check_curves(cut, curves)
    check_distances(whole, 0)
    check_separated(apart)
