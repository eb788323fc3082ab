"""Matrices of any size that a service computes, on all machines of its cluster if it has one."""

import os
from collections.abc import Callable
from dataclasses import asdict
from hashlib import file_digest
from typing import TYPE_CHECKING

from app.cli.matrix_file import MatrixToWrite, WrittenMatrix, as_members, write_facts
from app.cli.steps import Failure, Step, showing

if TYPE_CHECKING:
    from geodesic_client import Client, StoredMatrix


def write_matrix(wanted: MatrixToWrite, service: str) -> WrittenMatrix:
    """Have the service at a URL compute a matrix, and write it.

    The same command goes on where it was, both in the computation and in the transfer. Raises
    `Failure` where the service refuses or does not answer.
    """
    try:
        from geodesic_client import Client, GeodesicClientError
    except ModuleNotFoundError:
        raise Failure("--service needs the package geodesic-client: pip install ./client") from None
    import stamina

    stamina.instrumentation.set_on_retry_hooks(())  # which log each request that is sent again
    try:
        with Client(service, api_key=_api_key()) as client:
            mesh_id, matrix = _computed(client, wanted, service)
            with showing("Receiving the matrix") as step:
                client.save_matrix(matrix, wanted.out, progress=_watched(step))
            client.delete_job(matrix.job_id)  # makes room there
    except GeodesicClientError as error:
        raise Failure(str(error)) from None
    with wanted.out.open("rb") as file:
        checksum = file_digest(file, "sha256").hexdigest()
    written = WrittenMatrix(matrix.shape, asdict(matrix.error_bound), checksum)
    _write_facts(wanted, written, service, mesh_id)
    return written


def _api_key() -> str | None:
    """Return the API key from the environment, if any; no message shows it."""
    from app.settings import SERVICE_KEY_VARIABLE

    key = os.environ.get(SERVICE_KEY_VARIABLE, "").strip()
    if not (key.isascii() and key.isprintable()):
        raise Failure(
            f"{SERVICE_KEY_VARIABLE} is not a valid key: it may contain only printable ASCII"
        )
    return key or None


def _computed(client: "Client", wanted: MatrixToWrite, service: str) -> "tuple[str, StoredMatrix]":
    """Return the id of the mesh at a service, and the matrix there."""
    mesh = wanted.mesh
    with showing("Sending the mesh") as step:
        stored = client.upload((mesh.vertices, mesh.faces), progress=_watched(step))
    with showing(f"Computing the matrix at {service}") as step:
        matrix = client.store_matrix(
            stored,
            as_members(wanted.sources),
            as_members(wanted.sources if wanted.targets is None else wanted.targets),
            **wanted.accuracy,
            layout="sparse" if wanted.out.suffix.lower() == ".npz" else "dense",
            max_distance=wanted.max_distance,
            barriers=wanted.barriers,
            dtype=wanted.dtype,
            progress=_watched(step),
        )
    return stored.id, matrix


def _write_facts(wanted: MatrixToWrite, written: WrittenMatrix, service: str, mesh_id: str) -> None:
    """Write beside a matrix what it is, as the library does."""
    facts = {
        "service": service,
        "mesh": mesh_id,
        "barriers": sorted(set(wanted.barriers)),
        "sources": as_members(wanted.sources),
        "targets": as_members(wanted.sources if wanted.targets is None else wanted.targets),
        "shape": written.shape,
        **wanted.accuracy,
        "error_bound": written.error_bound,
        "max_distance": wanted.max_distance,
        "dtype": wanted.dtype,
        "units": "mesh units",
        "sha256": written.sha256,
    }
    write_facts(wanted.out, facts)


def _watched(step: Step) -> Callable[[float], None]:
    """Return a callback that shows the progress of a step, and ends it at Ctrl-C."""

    def note(share: float) -> None:
        step.progress(share)
        step.check()

    return note
