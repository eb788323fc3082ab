"""Matrices that a service computes, on all machines of its cluster if it has one."""

import json
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from hashlib import file_digest
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from app.cli.steps import Failure, showing

if TYPE_CHECKING:
    from geodesic_client import StoredMatrix

    from geodesic_core import SurfacePoint, TriangleMesh

    Points = Sequence[SurfacePoint] | Literal["all"]


def write_matrix(
    service: str,
    mesh: "TriangleMesh",
    out: Path,
    sources: "Points",
    targets: "Points",
    *,
    accuracy: Mapping[str, Any],
    max_distance: float | None,
    barriers: Sequence[int],
    dtype: Literal["float64", "float32"],
) -> "tuple[StoredMatrix, str]":
    """Have the service at a URL compute a matrix, and write it; return it, and its SHA-256.

    The same command goes on where it was, both in the computation and in the transfer. Raises
    `Failure` where the service refuses or does not answer.
    """
    from app.settings import SERVICE_KEY_VARIABLE

    try:
        from geodesic_client import Client, GeodesicClientError
    except ModuleNotFoundError:
        raise Failure("--service needs the package geodesic-client: pip install ./client") from None

    try:
        with Client(service, api_key=os.environ.get(SERVICE_KEY_VARIABLE)) as client:
            with showing("Sending the mesh") as step:
                stored = client.upload((mesh.vertices, mesh.faces), progress=_watched(step))
            with showing(f"Computing the matrix at {service}") as step:
                matrix = client.store_matrix(
                    stored,
                    _written(sources),
                    _written(targets),
                    **accuracy,
                    layout="sparse" if out.suffix.lower() == ".npz" else "dense",
                    max_distance=max_distance,
                    barriers=barriers,
                    dtype=dtype,
                    progress=_watched(step),
                )
            with showing("Receiving the matrix") as step:
                client.save_matrix(matrix, out, progress=_watched(step))
            client.dismiss_job(matrix.job_id)  # makes room there
    except GeodesicClientError as error:
        raise Failure(str(error)) from None
    with out.open("rb") as file:
        checksum = file_digest(file, "sha256").hexdigest()
    facts = {
        "service": service,
        "mesh": stored.id,
        "shape": matrix.shape,
        **accuracy,
        "error_bound": asdict(matrix.error_bound),
        "max_distance": max_distance,
        "dtype": dtype,
        "sha256": checksum,
    }
    out.with_name(f"{out.name}.json").write_text(json.dumps(facts, indent=1) + "\n")
    return matrix, checksum


def _watched(step: Any) -> Callable[[float], None]:
    """Return a callback that shows the progress of a step, and ends it at Ctrl-C."""

    def note(share: float) -> None:
        step.progress(share)
        if step.cancel():
            raise KeyboardInterrupt

    return note


def _written(points: "Points") -> Any:
    if isinstance(points, str):
        return points
    return [
        {"face": point.face_index, "barycentric": point.barycentric}
        if point.vertex_index is None
        else point.vertex_index
        for point in points
    ]
