"""Fields in files: the same answers to the bit, on the same mesh, or a refusal that says why."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import geodesic_core as gc
from geodesic_core.errors import InvalidArgument, InvalidMesh
from geodesic_core.fields import field_file

MESH = gc.samples.terrain(200)
INSIDE = gc.SurfacePoint.face(40, (0.2, 0.3, 0.5))
FIELDS = {
    "exact": lambda: gc.exact_distance(MESH, [3, gc.Source(90, 0.5)], max_distance=6.0),
    "windows": lambda: gc.exact_distance(MESH, INSIDE, targets=INSIDE, retain="windows"),
    "distances": lambda: gc.exact_distance(MESH, gc.Curve([0, 1]), retain="distances"),
    "approximate": lambda: gc.approximate_distance(MESH, 3, 0.05, retain="paths"),
    "fast": lambda: gc.fast_distance(MESH, 3, effort=1),
    "barriers": lambda: gc.exact_distance(MESH, 3, barriers=range(100, 130)),
}


@pytest.mark.parametrize("kind", FIELDS)
def test_a_field_comes_back_as_it_was(kind: str, tmp_path: Path) -> None:
    field = FIELDS[kind]()
    assert field.save(tmp_path / "field.npz") is None

    again = gc.load_field(str(tmp_path / "field.npz"), (MESH.vertices, MESH.faces))

    assert again.distances.tobytes() == field.distances.tobytes()
    assert again.nearest_source.tolist() == field.nearest_source.tolist()
    assert again.error_bound == field.error_bound
    assert again.stats == field.stats
    assert again.mesh.barriers.tolist() == field.mesh.barriers.tolist()
    assert again.max_distance == field.max_distance
    farthest = int(np.argmax(np.where(np.isfinite(field.distances), field.distances, -1)))
    assert again.path_to(farthest).points.tobytes() == field.path_to(farthest).points.tobytes()
    assert again.distance_at(INSIDE) == field.distance_at(INSIDE)
    assert again.nbytes == field.nbytes


@pytest.mark.jit
def test_any_reader_of_numpy_gets_the_distances(tmp_path: Path) -> None:
    field = FIELDS["barriers"]()
    field.save(tmp_path / "field.NPZ")
    with np.load(tmp_path / "field.NPZ") as file:
        assert file["distances"].tolist() == field.distances.tolist()
        assert file["nearest_source"].tolist() == field.nearest_source.tolist()
        assert file["barriers"].tolist() == list(range(100, 130))


@pytest.mark.jit
def test_a_file_that_is_there_is_replaced_as_a_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "field.npz"
    FIELDS["exact"]().save(file)
    before = file.read_bytes()

    def write_half(stream: Any, **_: Any) -> None:
        stream.write(b"half")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(np, "savez", write_half)
    with pytest.raises(InvalidArgument, match=r"cannot write .*field.npz: No space left"):
        FIELDS["fast"]().save(file)
    assert file.read_bytes() == before
    assert list(tmp_path.iterdir()) == [file]


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "field.npz"
    gc.exact_distance(MESH, 3).save(path)
    return path


def test_another_mesh_is_refused(file: Path) -> None:
    moved = MESH.vertices.copy()
    moved[7, 2] = np.nextafter(moved[7, 2], 9.0)
    others = [
        gc.samples.terrain(900),
        (moved, MESH.faces),
        (MESH.vertices, MESH.faces[::-1]),
        (MESH.vertices, MESH.faces[:-1]),
    ]
    for other in others:
        with pytest.raises(InvalidArgument, match="holds a field of another mesh"):
            gc.load_field(file, other)


def test_other_barriers_are_refused(tmp_path: Path) -> None:
    FIELDS["barriers"]().save(tmp_path / "field.npz")
    same = MESH.with_barriers(range(100, 130))
    assert gc.load_field(tmp_path / "field.npz", same).mesh is same
    with pytest.raises(InvalidArgument, match="other barriers than the mesh"):
        gc.load_field(tmp_path / "field.npz", MESH.with_barriers([5]))


def test_the_layout_of_another_version_is_refused(
    file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(field_file, "sources_digest", lambda: "another")
    with pytest.raises(InvalidArgument, match=re.escape("numpy.load(path)['distances']")):
        gc.load_field(file, MESH)


def test_what_is_no_field_is_refused(file: Path, tmp_path: Path) -> None:
    whole = file.read_bytes()
    damaged = bytearray(whole)
    damaged[len(damaged) // 2] ^= 1
    np.savez(tmp_path / "other.npz", distances=np.zeros(3))
    np.save(tmp_path / "array.npy", np.zeros(3))
    np.savez(tmp_path / "object.npz", mesh=np.array([None], object))
    cases = {
        "nowhere.npz": (None, "cannot read .*nowhere.npz: No such file"),
        "short.npz": (whole[: len(whole) // 2], "is damaged, or was not written"),
        "damaged.npz": (bytes(damaged), "is damaged, or was not written"),
        "empty.npz": (b"", "is damaged, or was not written"),
        "text.npz": (b"distances", "is damaged, or was not written"),
        "other.npz": (None, "was not written by DistanceField.save"),
        "array.npy": (None, "is damaged, or was not written"),
        "object.npz": (None, "is damaged, or was not written"),
    }
    for name, (content, message) in cases.items():
        if content is not None:
            (tmp_path / name).write_bytes(content)
        with pytest.raises(InvalidArgument, match=message):
            gc.load_field(tmp_path / name, MESH)
    with pytest.raises(InvalidArgument, match="cannot read"):
        gc.load_field(tmp_path, MESH)
    with pytest.raises(InvalidMesh, match="cannot be made from this NoneType"):
        gc.load_field(file, None)  # type: ignore[arg-type]


@pytest.mark.jit
@pytest.mark.parametrize(
    ("offset", "bits"),
    [(6, 0xFF), (8, 1), (10, 8), (10, 0xFF)],
    ids=["version", "encryption", "deflate", "compression"],
)
def test_damage_of_the_directory_is_refused(file: Path, offset: int, bits: int) -> None:
    content = bytearray(file.read_bytes())
    content[content.index(b"PK\x01\x02") + offset] ^= bits
    file.write_bytes(content)
    with pytest.raises(InvalidArgument, match="is damaged, or was not written"):
        gc.load_field(file, MESH)


@pytest.mark.parametrize("name", ["counts", "start_distances"])
def test_a_missing_array_is_refused(file: Path, name: str) -> None:
    with np.load(file) as whole:
        members = {key: whole[key] for key in whole if key != f"sweep.{name}"}
        assert len(members) < len(whole)
    np.savez(file, **members)
    with pytest.raises(InvalidArgument, match="is damaged, or was not written"):
        gc.load_field(file, MESH)


@pytest.mark.jit
@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("scalar", "holds other 'scalar' than the field"),
        ("distances", "holds other 'distances' than the field"),
        ("nearest_source", "holds other 'nearest_source' than the field"),
        ("sweep.scalar", "arrays has 'scalar', which is none of this field's"),
        ("swept", "holds other 'swept' than the field"),
    ],
)
def test_a_foreign_or_changed_array_is_refused(file: Path, name: str, message: str) -> None:
    """Else the field would be as it was, without a word."""
    with np.load(file) as whole:
        members = dict(whole)
    members[name] = members["distances"] + 1.0
    np.savez(file, allow_pickle=False, **members)
    with pytest.raises(InvalidArgument, match=message):
        gc.load_field(file, MESH)


@pytest.mark.parametrize(
    ("path", "message"),
    [
        ("field.npy", "path is 'field.npy'; it must end in .npz"),
        ("field", "must end in .npz"),
        ("no/folder/field.npz", "cannot write no/folder/field.npz: its folder does not exist"),
        (3, "path is 3; it must be a string or a Path"),
    ],
)
@pytest.mark.jit
def test_a_place_where_no_field_can_be_written_is_refused(path: Any, message: str) -> None:
    with pytest.raises(InvalidArgument, match=message):
        gc.exact_distance(MESH, 3).save(path)
