"""What an operator asks of a store: what is in it, whether it is whole, and what may go."""

import shutil
from collections.abc import Container, Iterator
from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from app.errors import ProblemError
from app.jobs import Job, read_book, require_whole
from app.store.fields import code_of_field, field_files, name_of_field
from app.store.layout import FIELDS, JOB_BOOK, RESULTS, TEMPORARY, StoreError
from app.store.meshes import MeshStore
from app.store.results import read_seal, sealed_results


@dataclass(frozen=True)
class MeshEntry:
    """What is known of a mesh in the store."""

    id: str
    faces: int | None
    """None where it is damaged, as for the next two"""
    created: str | None
    owner: str | None
    bytes: int
    last_used: datetime


@dataclass(frozen=True)
class Contents:
    """What is in a store: meshes, those used last at the end; jobs, the newest at the end."""

    meshes: list[MeshEntry]
    results: int
    result_bytes: int
    fields: int
    field_bytes: int
    jobs: list[Job]


@dataclass(frozen=True)
class Leftover:
    """What nobody needs any more."""

    reason: str
    paths: tuple[Path, ...]

    @property
    def bytes(self) -> int:
        """How much is won where it goes."""
        files = [file for path in self.paths for file in (path, *path.rglob("*"))]
        return sum(file.stat().st_size for file in files if file.is_file())


def contents(root: Path) -> Contents:
    """Return what is in the store ``root``; a service may run on it."""
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
                size,
                store.last_used(mesh_id),
            )
        )
    results = sealed_results(root / RESULTS)
    result_bytes = sum(body.stat().st_size for _, body in results.values())
    fields = field_files(root).values()
    jobs = read_book(root / JOB_BOOK)
    return Contents(entries, len(results), result_bytes, len(fields), sum(fields), jobs)


def damage(root: Path) -> Iterator[str]:
    """Yield what is not what was written, reading all there is; a service may run on it."""
    store = MeshStore(root)
    for mesh_id in store.sizes():
        with suppress(ProblemError):  # deleted meanwhile
            yield from map(str, store.damage(mesh_id))
    for name, files in sealed_results(root / RESULTS).items():
        if read_seal(root / RESULTS, name) is None and files[0].exists():  # else evicted meanwhile
            yield f"result {name} is damaged: it is not what was written"
    for path in field_files(root):
        if code_of_field(path) is None and path.exists():
            yield f"field {name_of_field(path)} is damaged: it is not what was written"
    try:
        require_whole(root / JOB_BOOK)
    except StoreError as error:
        yield str(error)


def leftovers(root: Path, code: str) -> Iterator[Leftover]:
    """Yield what may go from a store that no service runs on, where ``code`` is what answers now.

    The answer of a job stays, unless it is damaged.
    """
    meshes = MeshStore(root).sizes()
    sealed, fields = sealed_results(root / RESULTS), field_files(root)
    held = {job.result for job in read_book(root / JOB_BOOK)}
    for name, files in sealed.items():
        seal = read_seal(root / RESULTS, name)
        if seal is not None and name in held:
            continue
        reason = _reason(name, None if seal is None else seal.code, meshes, code)
        if reason is not None:
            yield Leftover(reason, files)
    for path in fields:
        reason = _reason(name_of_field(path), code_of_field(path), meshes, code)
        if reason is not None:
            yield Leftover(reason, (path,))
    whole = {*fields, *(file for files in sealed.values() for file in files)}
    folders = (root / TEMPORARY, *(root / RESULTS).glob("*"), *(root / FIELDS).glob("*"))
    for path in (path for folder in folders for path in folder.glob("*")):
        if path not in whole:
            yield Leftover("half-written", (path,))


def _reason(name: str, found_by: str | None, meshes: Container[str], code: str) -> str | None:
    """Return why a result or a field may go, if it may; what is damaged was found by no code."""
    if found_by is None:
        return "damaged"
    if name.partition("/")[0] not in meshes:
        return "of a mesh that is gone"
    return "outdated" if found_by != code else None


def remove(leftover: Leftover) -> None:
    """Remove what nobody needs any more."""
    for path in leftover.paths:
        if path.is_dir():
            shutil.rmtree(path)
        else:
            path.unlink()
    folder = leftover.paths[0].parent
    if folder.parent.name in (RESULTS, FIELDS) and not any(folder.iterdir()):
        folder.rmdir()
