"""Maintenance of a store: its contents, its damage, and what can be removed."""

import shutil
from collections.abc import Container, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from app.errors import ProblemError
from app.jobs import Job, read_jobs
from app.settings import variable_of
from app.state import Database, StateError, require_intact
from app.store.fields import code_of_field, field_files, name_of_field
from app.store.layout import (
    FIELDS,
    JOB_DATABASE,
    MESHES,
    RESULTS,
    TEMPORARY,
    StoreError,
    noted_state,
)
from app.store.meshes import MeshStore
from app.store.results import complete_results, read_manifest


@dataclass(frozen=True)
class MeshEntry:
    """A mesh in the store."""

    id: str
    faces: int | None
    """None where its manifest is damaged, as for the next three"""
    created: str | None
    owner: str | None
    name: str | None
    bytes: int
    last_used: datetime


@dataclass(frozen=True)
class Contents:
    """The contents of a store: meshes, the most recently used last; jobs, the newest last."""

    meshes: list[MeshEntry]
    results: int
    result_bytes: int
    fields: int
    field_bytes: int
    jobs: list[Job]


@dataclass(frozen=True)
class Damage:
    """Damage of a mesh, a result, a field, or the records of jobs."""

    folder: str
    """Where in the store it is, see `app.store.layout`"""
    name: str
    detail: str
    """A sentence that says what is wrong"""


@dataclass(frozen=True)
class Leftover:
    """Files that nothing needs any more, and why."""

    reason: str
    paths: tuple[Path, ...]

    @property
    def bytes(self) -> int:
        """Bytes that its removal frees."""
        files = [file for path in self.paths for file in (path, *path.rglob("*"))]
        return sum(file.stat().st_size for file in files if file.is_file())


def jobs_of(root: Path, state: str | None) -> list[Job]:
    """Return the jobs of the store ``root``; a service may run on it.

    Parameters
    ----------
    root
        Folder of the store.
    state
        URL of the database that services share; None where their jobs are in the store.

    Raises
    ------
    StateError
        The jobs of the store are in another database, or this one cannot be used.
    StoreError
        The store's own database is damaged.
    """
    path, service = root / JOB_DATABASE, noted_state(root)
    jobs = read_jobs(Database(path))
    if state is None:
        if service is not None:
            raise StateError(
                f"services with a PostgreSQL database share the store {root}: give the URL of that "
                f"database as --state or {variable_of('state')}, since it holds their jobs"
            )
        return jobs
    shared = Database(path, state)
    shared_jobs = read_jobs(shared)
    if service not in (None, shared.service):
        raise StateError(
            f"the services of the store {root} share another database than the given one"
        )
    return jobs + shared_jobs


def contents(root: Path, jobs: list[Job]) -> Contents:
    """Return the contents of the store ``root`` with these jobs; a service may run on it."""
    store = MeshStore(root)
    entries = []
    for mesh_id, size in store.sizes().items():
        manifest = {}
        with suppress(ProblemError):
            manifest = dict(store.manifest(mesh_id))
        entries.append(
            MeshEntry(
                mesh_id,
                manifest.get("report", {}).get("faces"),
                manifest.get("created"),
                manifest.get("owner"),
                manifest.get("name"),
                size,
                store.last_used(mesh_id),
            )
        )
    results = complete_results(root / RESULTS)
    result_bytes = sum(body.stat().st_size for _, body in results.values())
    fields = field_files(root).values()
    return Contents(entries, len(results), result_bytes, len(fields), sum(fields), jobs)


def inspect(root: Path) -> Iterator[Damage | None]:
    """Read a store file by file, and yield the damage of each; None for each that is intact.

    A service may run on the store.
    """
    store = MeshStore(root)
    for mesh_id in store.sizes():
        with suppress(ProblemError):  # deleted meanwhile
            for error in store.inspect(mesh_id):
                yield None if error is None else Damage(MESHES, mesh_id, str(error))
    for name, files in complete_results(root / RESULTS).items():
        is_intact = read_manifest(root / RESULTS, name) is not None
        if is_intact or not files[0].exists():  # evicted meanwhile
            yield None
        else:
            yield Damage(
                RESULTS, name, f"result {name} is damaged: it has changed since it was written"
            )
    for path in field_files(root):
        if code_of_field(path) is not None or not path.exists():
            yield None
        else:
            name = name_of_field(path)
            yield Damage(
                FIELDS, name, f"field {name} is damaged: it has changed since it was written"
            )
    try:
        require_intact(root / JOB_DATABASE)
    except StoreError as error:
        yield Damage(JOB_DATABASE, JOB_DATABASE, str(error))


def leftovers(root: Path, code: str, jobs: Iterable[Job]) -> Iterator[Leftover]:
    """Yield the files that can be removed from a store that no service runs on.

    Parameters
    ----------
    root
        Folder of the store.
    code
        Current version of the code: what another version computed is outdated.
    jobs
        The jobs of the store, see `jobs_of`: their results stay.

    Yields
    ------
    Leftover
        The files of one reason. The result of a job is none, unless it is damaged.
    """
    meshes = MeshStore(root).sizes()
    results, fields = complete_results(root / RESULTS), field_files(root)
    of_jobs = {job.result for job in jobs}
    for name, files in results.items():
        manifest = read_manifest(root / RESULTS, name)
        if manifest is not None and name in of_jobs:
            continue
        reason = _reason(name, None if manifest is None else manifest.code, meshes, code)
        if reason is not None:
            yield Leftover(reason, files)
    for path in fields:
        reason = _reason(name_of_field(path), code_of_field(path), meshes, code)
        if reason is not None:
            yield Leftover(reason, (path,))
    complete = {*fields, *(file for files in results.values() for file in files)}
    folders = (root / TEMPORARY, *(root / RESULTS).glob("*"), *(root / FIELDS).glob("*"))
    for path in (path for folder in folders for path in folder.glob("*")):
        if path not in complete:
            yield Leftover("half-written", (path,))


def _reason(name: str, written_by: str | None, meshes: Container[str], code: str) -> str | None:
    """Return why a result or a field can be removed, if it can; no code wrote a damaged one."""
    if written_by is None:
        return "damaged"
    if name.partition("/")[0] not in meshes:
        return "of a mesh that is gone"
    return "outdated" if written_by != code else None


def remove(leftover: Leftover) -> None:
    """Remove the files of a leftover, and a folder that this empties."""
    for path in leftover.paths:
        if path.is_dir():
            shutil.rmtree(path)
        else:
            path.unlink()
    folder = leftover.paths[0].parent
    if folder.parent.name in (RESULTS, FIELDS) and not any(folder.iterdir()):
        folder.rmdir()
