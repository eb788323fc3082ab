"""``geodesic store``: list the contents of a store, check them, and remove leftovers."""

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.cli.output import AsJson, print_json
from app.cli.steps import Failure, show_help_without_command, showing

if TYPE_CHECKING:
    from app.service.maintenance import Contents

store = typer.Typer(
    help="Inspect and clean the store of a service. Run it on the machine that has the store.",
    rich_markup_mode=None,
)


def _folder(named: object) -> Path:
    from app.settings import folder_of

    try:
        return folder_of(str(named))
    except ValueError as error:
        raise typer.BadParameter(str(error)) from error


Root = Annotated[
    Path,
    typer.Argument(
        metavar="STORE",
        envvar="GEODESIC_STORE",
        help="Folder of the store, or its file:// URL.",
        parser=_folder,
    ),
]

_DEFAULT = Path("geodesic-store")

State = Annotated[
    str | None,
    typer.Option(
        metavar="URL",
        envvar="GEODESIC_STATE",
        show_envvar=True,
        help="URL of the database that the services of the store share, if any; it holds their "
        "jobs.",
    ),
]


store.callback(invoke_without_command=True)(show_help_without_command)


@store.command()
def ls(root: Root = _DEFAULT, state: State = None, as_json: AsJson = False) -> None:
    """List the meshes, and the totals of results, distance fields and jobs."""
    from app.service.maintenance import contents, jobs_of

    with _store_at(root):
        found = contents(root, jobs_of(root, state))
    if as_json:
        print_json(_document(found))
        return
    if found.meshes:
        typer.echo(_ROW.format("id", "faces", "bytes", "created", "last used", "name"))
    for mesh in found.meshes:
        faces = "damaged" if mesh.faces is None else mesh.faces
        used = mesh.last_used.isoformat(timespec="seconds")
        row = mesh.id, faces, mesh.bytes, mesh.created, used, mesh.name
        cells = ("" if cell is None else cell for cell in row)
        typer.echo(_ROW.format(*cells).rstrip())
    total = sum(mesh.bytes for mesh in found.meshes)
    typer.echo(f"meshes      {len(found.meshes)}, {total} bytes")
    typer.echo(f"results     {found.results}, {found.result_bytes} bytes")
    typer.echo(f"fields      {found.fields}, {found.field_bytes} bytes")
    states = Counter(job.status for job in found.jobs)
    by_status = "".join(f", {count} {status}" for status, count in sorted(states.items()))
    typer.echo(f"jobs        {len(found.jobs)}{by_status}")


@store.command()
def check(root: Root = _DEFAULT, as_json: AsJson = False) -> None:
    """Read everything and verify checksums; the exit code is 1 if anything is damaged."""
    from app.service.maintenance import inspect

    with _store_at(root), showing("Reading"):
        found = list(inspect(root))
    if as_json:
        print_json({"damaged": found})
    else:
        for fault in found:
            typer.echo(fault)
        typer.echo(f"damaged     {len(found)}")
    if found:
        raise typer.Exit(1)


@store.command()
def prune(
    root: Root = _DEFAULT,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Only list what would be removed.")
    ] = False,
    state: State = None,
    as_json: AsJson = False,
) -> None:
    """Remove half-written files, and damaged, outdated or orphaned results and fields.

    Orphaned ones belong to a mesh that was deleted. No service may run on the store meanwhile.
    Meshes and the answers of jobs are kept.
    """
    from app.queries import code_version
    from app.service.maintenance import jobs_of, leftovers, remove
    from app.store.ownership import owned

    with _store_at(root), owned(root):
        jobs = jobs_of(root, state)
        with showing("Reading"):
            found = leftovers(root, code_version(), jobs)
            going = [(leftover, leftover.bytes) for leftover in found]
            for leftover, _ in going:
                if not dry_run:
                    remove(leftover)
    if as_json:
        removed = [
            {"paths": list(map(str, leftover.paths)), "bytes": size} for leftover, size in going
        ]
        print_json({"dry_run": dry_run, "removed": removed})
        return
    for leftover, size in going:
        typer.echo(f"{leftover.paths[0].relative_to(root)}, {size} bytes")
    verb = "to remove" if dry_run else "removed"
    typer.echo(f"{verb:12}{len(going)}, {sum(size for _, size in going)} bytes")


_ROW = "{:32}  {:>9}  {:>13}  {:25}  {:25}  {}"


@contextmanager
def _store_at(root: Path) -> Iterator[None]:
    """Fail in one line where there is no readable store."""
    from app.state import StateError
    from app.store.layout import StoreError, is_store, require_layout

    if not is_store(root):
        raise Failure(f"there is no store in {root}")
    try:
        require_layout(root)
        yield
    except (StateError, StoreError, OSError) as error:
        raise Failure(str(error)) from error


def _document(found: "Contents") -> dict[str, Any]:
    return {
        "meshes": [asdict(mesh) for mesh in found.meshes],
        "results": {"count": found.results, "bytes": found.result_bytes},
        "fields": {"count": found.fields, "bytes": found.field_bytes},
        "jobs": [
            {
                "id": job.id,
                "status": job.status,
                "mesh_id": job.spec.mesh_id,
                "client": job.spec.client,
                "created": job.created,
            }
            for job in found.jobs
        ],
    }
