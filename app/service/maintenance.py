"""Maintenance of a store: its contents, its damage, and what can be removed."""

import shutil
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from app.errors import ProblemError
from app.jobs import Job, read_jobs
from app.settings import variable_of
from app.state import Database, StateError, require_intact
from app.store.fields import code_of_field, field_files
from app.store.folder import Folder
from app.store.layout import (
    FIELDS,
    JOB_DATABASE,
    MESHES,
    RESULTS,
    TEMPORARY,
    StoreError,
    noted_state,
)
from app.store.mesh_home import mesh_of
from app.store.meshes import MANIFEST, MeshStore
from app.store.results import ResultFiles, result_of


@dataclass(frozen=True)
class MeshEntry:
    """A mesh in the store."""

    id: str
    faces: int | None
    """None where its manifest is damaged, as for the next two"""
    created: str | None
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
class Leftover:
    """Files that nothing needs any more."""

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
    files = list(Folder(root).found(MESHES))
    sizes: Counter[str] = Counter()
    for file in files:
        sizes[mesh_of(file)] += file.size
    meshes = [
        _mesh_entry(root, mesh_of(file), sizes[mesh_of(file)], file.modified)
        for file in files
        if file.name.endswith(f"/{MANIFEST}")
    ]
    bodies = [body.stat().st_size for _, body in _complete_results(root).values()]
    fields = field_files(root).values()
    return Contents(meshes, len(bodies), sum(bodies), len(fields), sum(fields), jobs)


def _mesh_entry(root: Path, mesh_id: str, size: int, modified: float) -> MeshEntry:
    manifest: Mapping[str, Any] = {}
    with suppress(ProblemError):
        manifest = MeshStore(root).manifest(mesh_id)
    return MeshEntry(
        mesh_id,
        manifest.get("report", {}).get("faces"),
        manifest.get("created"),
        manifest.get("name"),
        size,
        datetime.fromtimestamp(modified, UTC),
    )


def inspect(root: Path) -> Iterator[str]:
    """Read a store file by file, and yield a sentence on each damage.

    A service may run on the store.
    """
    store = MeshStore(root)
    for mesh_id in store.ids():
        yield from map(str, store.inspect(mesh_id))
    results = ResultFiles(Folder(root))
    for name, (manifest, _) in _complete_results(root).items():
        if results.read_now(name) is None and manifest.exists():  # not evicted meanwhile
            yield f"result {name} is damaged: it has changed since it was written"
    for path in field_files(root):
        if code_of_field(path) is None and path.exists():
            yield f"field {_field_name(path)} is damaged: it has changed since it was written"
    try:
        require_intact(root / JOB_DATABASE)
    except StoreError as error:
        yield str(error)


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
        Files that go together. The result of a job is none, unless it is damaged.
    """
    meshes, of_jobs = set(MeshStore(root).ids()), {job.result for job in jobs}
    results, fields, files = _complete_results(root), field_files(root), ResultFiles(Folder(root))
    for name, paths in results.items():
        found = files.read_now(name)
        if found is not None and name in of_jobs:
            continue
        if found is None or found.manifest.code != code or paths[0].parent.name not in meshes:
            yield Leftover(paths)
    for path in fields:
        if code_of_field(path) != code or path.parent.name not in meshes:
            yield Leftover((path,))
    complete = {*fields, *(path for paths in results.values() for path in paths)}
    folders = (root / TEMPORARY, *(root / RESULTS).glob("*"), *(root / FIELDS).glob("*"))
    for path in (path for folder in folders for path in folder.glob("*")):
        if path not in complete:
            yield Leftover((path,))


def _complete_results(root: Path) -> dict[str, tuple[Path, Path]]:
    """Return manifest and body of each complete result, by name."""
    found = {path: path.with_suffix(".body") for path in (root / RESULTS).glob("*/*.json")}
    return {
        result_of(manifest.relative_to(root).as_posix()): (manifest, body)
        for manifest, body in sorted(found.items())
        if body.exists()
    }


def _field_name(path: Path) -> str:
    return f"{path.parent.name}/{path.stem}"


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
