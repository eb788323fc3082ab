"""The records of jobs on a disk that is full: a real one, of 16 megabytes in memory."""

import shutil
import sqlite3
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import anyio
import pytest

from app.jobs.job import Job, JobSpec
from app.jobs.repository import JobRepository
from tests.support.paths import ROOT

SPEC = JobSpec(
    owner=None,
    kind="distances",
    mesh_id="0" * 32,
    media_type="application/json",
    fingerprint="",
    idempotency_key=None,
    request_id="",
)


def new_job() -> Job:
    return Job(spec=SPEC)


def fill(path: Path) -> None:
    """Write a file until the disk is full."""
    with path.open("wb", buffering=0) as file, suppress(OSError):
        while True:
            file.write(bytes(4096))


async def use_full_disk(folder: Path) -> None:
    repository = JobRepository(folder / "jobs.sqlite3")
    await repository.open()
    try:
        await use(repository, folder)
    finally:
        await repository.close()


async def use(repository: JobRepository, folder: Path) -> None:
    jobs = [new_job() for _ in range(100)]
    for job in jobs:
        await repository.add(job)
    await repository.close()  # empties SQLite's log
    await repository.open()
    fill(folder / "others")

    with pytest.raises(sqlite3.OperationalError, match="disk is full"):
        await repository.add(new_job())
    for job in jobs:
        await repository.update(job.dismissed())
    assert await repository.count_finished() == {"dismissed": 100}
    for job in jobs:
        await repository.remove(job.id)
    assert await repository.page(None, 1, None) == ([], None)
    with pytest.raises(sqlite3.OperationalError, match="disk is full"):
        await repository.add(new_job())

    (folder / "jobs.reserve").unlink()
    fill(folder / "more")
    (folder / "others").unlink()
    await repository.add(new_job())
    assert (folder / "jobs.reserve").exists(), "there is room again"


def run_on_own_disk(command: str) -> subprocess.CompletedProcess[str]:
    """Run a command where ``/mnt`` is a disk of 16 megabytes, which no one else sees."""
    script = f"mount -t tmpfs -o size=16m none /mnt && {command}"
    words = ["unshare", "--user", "--map-root-user", "--mount", "sh", "-c", script]
    return subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False)  # noqa: S603 - our own command


def test_on_a_full_disk_jobs_end_and_are_removed_but_none_is_accepted() -> None:
    if shutil.which("unshare") is None or run_on_own_disk("true").returncode:
        pytest.skip("this system lets nobody mount a disk of their own")
    ran = run_on_own_disk(f"exec {sys.executable} -m {__name__}")
    assert (ran.returncode, ran.stdout) == (0, "done\n"), ran.stderr


if __name__ == "__main__":
    anyio.run(use_full_disk, Path("/mnt"))
    sys.stdout.write("done\n")
