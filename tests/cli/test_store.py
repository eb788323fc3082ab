"""``geodesic store``, on the folder that a service left."""

import json
import os
import shutil
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from app.queries import code_version
from app.store.fields import FieldStore
from app.store.ownership import owned
from app.store.results import ResultManifest
from tests.support.commands import Run, error_line
from tests.support.faults import edit_counts, flip_bytes
from tests.support.postgres import SECRET
from tests.support.postgres import Server as Postgres
from tests.support.service import serving, upload_sample, wait_until

pytestmark = pytest.mark.service  # a store is left by a service that has run

KEYS = {"alice": "alice-alice-alice", "bob": "bob-bob-bob-bob-bob"}
ALICE, BOB = ({"Authorization": f"Bearer {secret}"} for secret in KEYS.values())


@dataclass(frozen=True)
class Left:
    """A store that a service has left.

    Two meshes, three results of one and one of the other, three fields of the first.
    """

    root: Path
    ids: list[str]
    job: str
    """It holds the result of the second mesh."""

    def files(self) -> set[str]:
        """Return all files, but for the lock and what SQLite has beside its own."""
        found = (path for path in self.root.rglob("*") if path.is_file())
        names = {path.relative_to(self.root).as_posix() for path in found}
        return names - {"lock", "jobs.sqlite3-shm", "jobs.sqlite3-wal"}

    def results(self, number: int) -> list[Path]:
        """Return the bodies of the results of a mesh."""
        return sorted((self.root / "results" / self.ids[number]).glob("*.body"))

    def fields(self) -> list[Path]:
        """Return the files of all fields."""
        return sorted(self.root.glob("fields/*/*"))


def write_field(left: Left, mesh_id: str, key: str, code: str) -> None:
    arrays = {"distance": np.arange(1000.0)}
    FieldStore(left.root, 10**9).write(mesh_id, key, arrays, code)


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory) -> Left:
    root = tmp_path_factory.mktemp("left") / "store"
    keys = ",".join(f"{name}:{secret}" for name, secret in KEYS.items())
    with serving(root, api_keys=keys) as client:
        client.headers.update(ALICE)
        ids = [upload_sample(client, "plane", faces) for faces in (45_000, 200)]
        for vertex in range(3):
            body = {"sources": [{"vertex": vertex}]}
            assert client.post(f"/v1/meshes/{ids[0]}/distances", json=body).status_code == 200
        job = client.post(
            f"/v1/meshes/{ids[1]}/distances",
            json={"sources": [{"vertex": 0}]},
            headers={**BOB, "Prefer": "respond-async"},
        ).headers["location"]
        wait_until(lambda: client.get(job, headers=BOB).json()["status"] == "successful")
    left = Left(root, ids, job.rpartition("/")[2])
    for path in left.fields():  # whether it took long enough
        path.unlink()
    for key in ("1", "2", "3"):
        write_field(left, ids[0], key, code_version())
    return left


@pytest.fixture
def left(original: Left, tmp_path: Path) -> Left:
    shutil.copytree(original.root, tmp_path / "store")
    return Left(tmp_path / "store", original.ids, original.job)


def test_ls(run: Run, left: Left) -> None:
    for number, mesh_id in enumerate(reversed(left.ids)):
        os.utime(left.root / "meshes" / mesh_id / "manifest.json", (number, number))
    before = left.files()

    ran = run("store", "ls", left.root)

    assert (ran.code, ran.err) == (0, "")
    rows = [row.split() for row in ran.out.splitlines()]
    assert rows[0] == ["id", "faces", "bytes", "created", "last", "used", "name"]
    assert [row[:2] for row in rows[1:3]] == [[left.ids[1], "200"], [left.ids[0], "45000"]]
    assert [row[-2] for row in rows[1:3]] == [f"1970-01-01T00:00:0{n}+00:00" for n in range(2)]
    on_disk = sum(path.stat().st_size for path in (left.root / "meshes").rglob("*.*"))
    assert ran.figure("meshes") == f"2, {on_disk} bytes"
    bodies = left.results(0) + left.results(1)
    assert ran.figure("results") == f"4, {sum(body.stat().st_size for body in bodies)} bytes"
    sizes = [field.stat().st_size for field in left.fields()]
    assert ran.figure("fields") == f"3, {sum(sizes)} bytes"
    assert ran.figure("jobs") == "1, 1 successful"
    assert left.files() == before


def test_ls_as_json(run: Run, left: Left, monkeypatch: pytest.MonkeyPatch) -> None:
    (left.root / "meshes" / left.ids[1] / "manifest.json").write_bytes(b"{")
    monkeypatch.setenv("GEODESIC_STORE", str(left.root))

    found = json.loads(run("store", "ls", "--json").out)

    meshes = {mesh["id"]: mesh for mesh in found["meshes"]}
    assert meshes.keys() == set(left.ids)
    healthy, damaged = (meshes[mesh_id] for mesh_id in left.ids)
    assert healthy["faces"] == 45_000
    assert datetime.fromisoformat(healthy["created"]) <= datetime.now(UTC)
    assert (damaged["faces"], damaged["name"]) == (None, None)
    (job,) = found["jobs"]
    assert (job["id"], job["status"], job["client"]) == (left.job, "successful", "bob")
    assert job["mesh_id"] == left.ids[1]
    assert (found["results"]["count"], found["fields"]["count"]) == (4, 3)


def test_check_names_what_is_damaged(run: Run, left: Left) -> None:
    sound = run("store", "check", left.root)
    assert (sound.code, sound.err, sound.figure("damaged")) == (0, "", "0")
    assert json.loads(run("store", "check", left.root, "--json").out) == {"damaged": []}

    for name in ("faces", "component"):
        flip_bytes(left.root / "meshes" / left.ids[0] / f"{name}.npy")
    edit_counts(left.root / "meshes" / left.ids[1] / "manifest.json")
    flip_bytes(left.results(0)[1])
    left.results(0)[2].with_suffix(".json").write_bytes(b"{")
    left.fields()[1].write_bytes(b"PK")
    (left.root / "jobs.sqlite3").write_bytes(b"nothing" * 999)
    ran = run("store", "check", left.root)

    assert (ran.code, ran.err, ran.figure("damaged")) == (1, "", "7")
    rows = ran.out.splitlines()
    for part in (
        f"mesh {left.ids[0]} is damaged: its array faces has changed since it was written",
        f"mesh {left.ids[0]} is damaged: its array component has changed since it was written",
        f"mesh {left.ids[1]} is damaged: its manifest has changed since it was written",
        f"result {left.ids[0]}/{left.results(0)[1].stem} is damaged",
        f"result {left.ids[0]}/{left.results(0)[2].stem} is damaged",
        f"field {left.ids[0]}/2 is damaged",
        f"{left.root}/jobs.sqlite3 is damaged",
    ):
        assert sum(row.startswith(part) for row in rows) == 1, part
    ran = run("store", "check", "--json", left.root)
    assert ran.code == 1
    assert sorted(json.loads(ran.out)["damaged"]) == sorted(rows[:-1])


def test_prune(run: Run, left: Left) -> None:
    """What nobody needs goes; meshes stay, and so do answers of jobs."""
    damaged, outdated, kept = left.results(0)
    (held,) = left.results(1)
    flip_bytes(damaged)
    for body in (outdated, held):
        manifest = ResultManifest.model_validate_json(body.with_suffix(".json").read_bytes())
        assert manifest.code
        written = manifest.model_copy(update={"code": "an older one"}).model_dump_json()
        body.with_suffix(".json").write_text(written)
    shutil.rmtree(left.root / "meshes" / left.ids[1])
    orphan = left.root / "results" / ("0" * 32)
    orphan.mkdir()
    shutil.copy(kept, orphan)
    shutil.copy(kept.with_suffix(".json"), orphan)
    shutil.copy(kept, kept.with_name("incomplete.body"))
    kept.with_name("tmp123").write_bytes(b"1234567")
    (left.root / "tmp" / "upload").mkdir()
    (left.root / "tmp" / "upload" / "mesh").write_bytes(b"12345")
    flip_bytes(left.root / "meshes" / left.ids[0] / "faces.npy")
    left.fields()[1].write_bytes(b"PK")
    write_field(left, left.ids[0], "3", "an older one")
    write_field(left, left.ids[1], "1", code_version())
    left.fields()[0].with_name("tmp456").write_bytes(b"1234567")
    before = left.files()

    tried = run("store", "prune", "--dry-run", left.root)
    assert (tried.code, tried.err) == (0, "")
    assert left.files() == before
    told = json.loads(run("store", "prune", "--dry-run", "--json", left.root).out)
    assert told["dry_run"] is True
    listed = {
        Path(path).relative_to(left.root).as_posix()
        for each in told["removed"]
        for path in each["paths"]
    }
    ran = run("store", "prune", left.root)

    assert (ran.code, ran.err) == (0, "")
    assert ran.figure("removed") == tried.figure("to remove")
    gone = before - left.files()
    assert {name for name in gone if not name.startswith("tmp/")} == {
        name for name in listed if not name.startswith("tmp/")
    }
    assert ran.figure("removed").startswith("10, ")
    bodies = {"results/" + "/".join(body.parts[-2:]) for body in (kept, held)}
    assert {file for file in left.files() if file.startswith("results/")} == {
        name for body in bodies for name in (body, body.removesuffix("body") + "json")
    }
    assert not orphan.exists()
    assert [path.relative_to(left.root / "fields") for path in left.fields()] == [
        Path(left.ids[0]) / "1.npz"
    ]
    assert not (left.root / "fields" / left.ids[1]).exists()
    assert list((left.root / "tmp").iterdir()) == []
    for others in ("meshes/", "jobs"):
        assert {file for file in left.files() if file.startswith(others)} == {
            file for file in before if file.startswith(others)
        }
    assert run("store", "prune", left.root).figure("removed") == "0, 0 bytes"


def test_answers_of_jobs_are_there_after_pruning(run: Run, left: Left) -> None:
    assert run("store", "prune", left.root).figure("removed") == "0, 0 bytes"
    with serving(left.root, api_keys=f"bob:{KEYS['bob']}") as client:
        assert client.get(f"/v1/jobs/{left.job}/results", headers=BOB).status_code == 200


def test_the_jobs_of_services_that_share_a_database(
    run: Run, postgres: Postgres, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Their answers stay; and without the URL of their database nothing is removed."""
    root, url, other = tmp_path / "store", postgres.new_database(), postgres.new_database()
    with serving(root, state=url) as client:
        mesh_id = upload_sample(client, "plane", 200)
        job = client.post(
            f"/v1/meshes/{mesh_id}/distances",
            json={"sources": [{"vertex": 0}]},
            headers={"Prefer": "respond-async"},
        ).headers["location"]
        wait_until(lambda: client.get(job).json()["status"] == "successful")
    (held,) = Left(root, [mesh_id], job).results(0)
    manifest = ResultManifest.model_validate_json(held.with_suffix(".json").read_bytes())
    written = manifest.model_copy(update={"code": "an older one"}).model_dump_json()
    held.with_suffix(".json").write_text(written)
    capsys.readouterr()  # the log of the service

    for command in ("ls", "prune"):
        ran = run("store", command, root)
        assert ran.code == 1
        assert "share the store" in error_line(ran)
        assert "GEODESIC_STATE" in error_line(ran)
    assert run("store", "ls", root, "--state", url).figure("jobs") == "1, 1 successful"
    ran = run("store", "prune", root, "--state", other)
    assert ran.code == 1
    assert SECRET not in ran.err
    assert run("store", "prune", root, "--state", url).figure("removed") == "0, 0 bytes"
    with serving(root, state=url) as client:
        assert client.get(f"{job}/results").status_code == 200


def test_prune_needs_the_store_for_itself(run: Run, left: Left) -> None:
    with owned(left.root):
        for options in ([], ["--dry-run"]):
            ran = run("store", "prune", left.root, *options)
            assert ran.code == 1
            assert "in use by another process" in error_line(ran)
        assert run("store", "ls", left.root).code == 0
        assert run("store", "check", left.root).code == 0


@pytest.mark.parametrize("command", ["ls", "check", "prune"])
def test_what_is_no_store_is_refused(run: Run, tmp_path: Path, command: str) -> None:
    (tmp_path / "photos").mkdir()
    for name in ("photos", "nothing"):
        ran = run("store", command, tmp_path / name)
        assert ran.code == 1
        assert f"there is no store in {tmp_path / name}" in error_line(ran)
    assert list((tmp_path / "photos").iterdir()) == []

    (tmp_path / "photos" / "VERSION").write_text("8\n")
    ran = run("store", command, tmp_path / "photos")
    assert ran.code == 1
    assert "has layout 8, but this release reads 7" in error_line(ran)


def test_serve_refuses_a_store_that_it_cannot_have(
    run: Run,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("GEODESIC_STORE", str(tmp_path / "store"))
    with owned(tmp_path / "store"):
        ran = run("serve")
    assert ran.code == 1
    assert "in use by another process" in error_line(ran)
    (tmp_path / "store" / "jobs.sqlite3").write_bytes(b"nothing" * 999)
    ran = run("serve")
    assert ran.code == 1
    assert "jobs.sqlite3 is damaged" in error_line(ran)
    (tmp_path / "store" / "VERSION").write_text("4.5")
    ran = run("serve")
    assert ran.code == 1
    assert "has layout 4.5" in error_line(ran)


def test_a_store_by_its_url(run: Run, tmp_path: Path) -> None:
    with owned(tmp_path / "store"):
        pass
    assert run("store", "ls", f"file://{tmp_path}/store").figure("meshes") == "0, 0 bytes"
    refused = run("store", "ls", "s3://bucket/store")
    assert refused.code == 2
    assert "is not a folder of this machine" in " ".join(refused.err.split())
