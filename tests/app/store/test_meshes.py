"""Meshes in a folder: they come back as they were, or are damaged until they are written again."""

import errno
import shutil
from pathlib import Path

import numpy as np
import pytest

import geodesic_core as gc
from app.errors import ProblemError
from app.store.folder import Folder
from app.store.mesh_home import MeshHome
from app.store.meshes import MeshStore
from tests.support.disks import fill_disk
from tests.support.faults import FAULTS, MANIFEST_FAULTS, Fault, flip_bytes
from tests.support.service import store_mesh

SQUARE = (
    np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float),
    np.array([[0, 1, 2], [0, 2, 3]]),
)


@pytest.fixture
def meshes(tmp_path: Path) -> MeshStore:
    return MeshStore(tmp_path)


def damage_of(meshes: MeshStore, mesh_id: str) -> list[str]:
    return [str(error) for error in meshes.inspect(mesh_id)]


def code_of(call) -> str:
    with pytest.raises(ProblemError) as caught:
        call()
    return caught.value.problem.code


def test_a_mesh_comes_back_as_it_was(meshes: MeshStore, tmp_path: Path) -> None:
    mesh = gc.TriangleMesh(*SQUARE)

    opened = meshes.open(store_mesh(tmp_path, mesh))

    assert opened.warnings == list(mesh.warnings)
    assert opened.mesh.arrays().keys() == mesh.arrays().keys()
    for name, array in mesh.arrays().items():
        np.testing.assert_array_equal(opened.mesh.arrays()[name], array)
        assert opened.mesh.arrays()[name].dtype == array.dtype
        assert not opened.mesh.arrays()[name].flags.writeable


def test_the_id_is_of_the_content(tmp_path: Path) -> None:
    vertices, faces = SQUARE
    mesh_id = store_mesh(tmp_path, gc.TriangleMesh(vertices, faces))

    assert store_mesh(tmp_path, gc.TriangleMesh(vertices.tolist(), faces.tolist())) == mesh_id
    assert store_mesh(tmp_path, gc.TriangleMesh(vertices * 2, faces)) != mesh_id
    assert store_mesh(tmp_path, gc.TriangleMesh(vertices, faces[::-1])) != mesh_id


def test_a_vertex_map_is_part_of_the_content(tmp_path: Path) -> None:
    vertices, faces = SQUARE
    doubled = np.concatenate([vertices, vertices])

    merged = gc.TriangleMesh(doubled, faces, merge="exact")

    assert store_mesh(tmp_path, merged) != store_mesh(tmp_path, gc.TriangleMesh(vertices, faces))


def test_a_mesh_that_is_stored_is_not_written_again(meshes: MeshStore, tmp_path: Path) -> None:
    mesh = gc.TriangleMesh(*SQUARE)
    mesh_id = store_mesh(tmp_path, mesh)

    written = meshes.write_aside(mesh, tmp_path / "aside")

    assert (written.mesh_id, written.folder) == (mesh_id, None)
    assert not (tmp_path / "aside").exists()


@pytest.mark.parametrize("fault", FAULTS.values(), ids=FAULTS.keys())
@pytest.mark.parametrize("name", ["vertices", "faces", "component"])
def test_a_damaged_array_is_noticed_and_healed_by_writing_the_mesh_again(
    meshes: MeshStore, tmp_path: Path, name: str, fault: Fault
) -> None:
    mesh = gc.TriangleMesh(*SQUARE)
    mesh_id = store_mesh(tmp_path, mesh)
    before = meshes.manifest(mesh_id)

    fault(meshes.array_file(mesh_id, name))
    assert code_of(lambda: meshes.open(mesh_id)) == "mesh_damaged"
    (found,) = damage_of(meshes, mesh_id)
    assert f"its array {name} has changed since it was written" in found
    assert store_mesh(tmp_path, mesh) == mesh_id

    assert damage_of(meshes, mesh_id) == []
    assert meshes.manifest(mesh_id) == before
    np.testing.assert_array_equal(meshes.open(mesh_id).mesh.vertices, mesh.vertices)


@pytest.mark.parametrize("fault", MANIFEST_FAULTS.values(), ids=MANIFEST_FAULTS.keys())
def test_a_damaged_manifest_is_noticed_and_healed_by_writing_the_mesh_again(
    meshes: MeshStore, tmp_path: Path, fault: Fault
) -> None:
    mesh = gc.TriangleMesh(*SQUARE)
    mesh_id = store_mesh(tmp_path, mesh)
    path = meshes.folder / mesh_id / "manifest.json"

    fault(path)
    assert code_of(lambda: meshes.open(mesh_id)) == (
        "mesh_damaged" if path.exists() else "mesh_not_found"
    )
    store_mesh(tmp_path, mesh)

    assert damage_of(meshes, mesh_id) == []


@pytest.mark.parametrize("content", [b"", b"[]", b"{}", b'{"id": "of another"}'])
def test_a_broken_manifest_is_noticed(meshes: MeshStore, tmp_path: Path, content: bytes) -> None:
    mesh_id = store_mesh(tmp_path, gc.TriangleMesh(*SQUARE))
    (tmp_path / "meshes" / mesh_id / "manifest.json").write_bytes(content)

    assert code_of(lambda: meshes.manifest(mesh_id)) == "mesh_damaged"
    (found,) = damage_of(meshes, mesh_id)
    assert "its manifest" in found


def test_a_mesh_under_the_name_of_another_is_noticed(meshes: MeshStore, tmp_path: Path) -> None:
    vertices, faces = SQUARE
    ids = [store_mesh(tmp_path, gc.TriangleMesh(vertices * scale, faces)) for scale in (1, 2)]
    shutil.copytree(meshes.folder / ids[1], meshes.folder / ids[0], dirs_exist_ok=True)
    assert "its manifest belongs to another mesh" in damage_of(meshes, ids[0])[0]


def test_a_mesh_that_is_removed_or_healed_is_no_longer_current(
    meshes: MeshStore, tmp_path: Path
) -> None:
    mesh = gc.TriangleMesh(*SQUARE)
    mesh_id = store_mesh(tmp_path, mesh)
    opened = meshes.open(mesh_id)
    MeshHome(Folder(tmp_path), meshes).note_use(mesh_id)
    assert meshes.is_current(opened)
    assert meshes.is_current(opened.with_barriers(np.array([0])))

    flip_bytes(meshes.array_file(mesh_id, "faces"))
    store_mesh(tmp_path, mesh)
    assert not meshes.is_current(opened)
    again = meshes.open(mesh_id)
    assert meshes.is_current(again)
    meshes.drop(mesh_id)
    assert not meshes.is_current(again)
    np.testing.assert_array_equal(again.mesh.faces, mesh.faces)  # it is still mapped


def test_a_mesh_removed_while_it_is_inspected_is_not_damaged(
    meshes: MeshStore, tmp_path: Path
) -> None:
    mesh_id = store_mesh(tmp_path, gc.TriangleMesh(*SQUARE))
    flip_bytes(meshes.array_file(mesh_id, "vertices"))
    findings = meshes.inspect(mesh_id)
    assert next(findings)
    meshes.drop(mesh_id)
    assert not list(findings)


def test_a_device_that_is_full(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A real one, which np.save would answer with an error that does not say so."""
    fill_disk(monkeypatch, "*.npy")
    with pytest.raises(OSError, match="No space left") as caught:
        MeshStore(tmp_path).write_aside(gc.samples.plane(10_000), tmp_path / "mesh")
    assert caught.value.errno == errno.ENOSPC


@pytest.mark.parametrize("mesh_id", ["", "..", "0" * 32, "../meshes", "G" * 32])
def test_unknown_ids(meshes: MeshStore, mesh_id: str) -> None:
    assert code_of(lambda: meshes.manifest(mesh_id)) == "mesh_not_found"
