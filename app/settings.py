"""What an operator can set: environment variables that begin with ``GEODESIC_``."""

import os
from pathlib import Path
from typing import Self

from pydantic import Field, PositiveFloat, PositiveInt, model_validator
from pydantic_settings import BaseSettings, SettingsConfigDict

PREFIX = "GEODESIC_"
MIB = 2**20
GIB = 2**30


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class Settings(BaseSettings):
    """Every setting, validated at start; a variable that does not exist stops the start.

    One store belongs to one service: it is swept of half-written entries at start.
    """

    model_config = SettingsConfigDict(
        env_prefix=PREFIX, frozen=True, extra="forbid", use_attribute_docstrings=True
    )

    store: Path = Path("geodesic-store")
    """Folder of the meshes and results; created where it is not there."""
    workers: PositiveInt = Field(default_factory=_cores)
    """Worker processes; one for each core, unless set."""
    worker_mesh_bytes: PositiveInt = 2 * GIB
    """Size of the meshes that a worker keeps open, and of what it keeps for paths on them."""
    results_bytes: PositiveInt = 4 * GIB
    """Size of the finished results that the store keeps."""
    results_memory_bytes: PositiveInt = 256 * MIB
    """Size of those among them that are kept in memory as well: small ones."""
    max_upload_bytes: PositiveInt = 512 * MIB
    """Largest body of an upload."""
    max_query_bytes: PositiveInt = 4 * MIB
    """Largest body of a query."""
    max_faces: PositiveInt = 5_000_000
    """Most faces of a mesh."""
    max_sources: PositiveInt = 10_000
    """Most sources of a query; each point of a curve counts."""
    max_matrix_cells: PositiveInt = 10_000_000
    """Most cells of a matrix, sources by targets, or pairs."""
    max_waypoints: PositiveInt = 100
    """Most waypoints of a path."""
    max_levels: PositiveInt = 1000
    """Most levels of isolines."""
    max_json_values: PositiveInt = 2_000_000
    """Most values of an answer in JSON; binary ones have no such limit."""
    query_memory_bytes: PositiveInt = 8 * GIB
    """Memory granted to a query."""
    queue_size: PositiveInt = 64
    """Requests that may wait for a worker."""
    deadline_s: PositiveFloat = 120.0
    """Seconds that a request may take."""
    job_deadline_s: PositiveFloat = 86_400.0
    """Seconds that a job may take."""
    job_ttl: PositiveFloat = 86_400.0
    """Seconds for which a job is kept after it has finished, with its answer."""
    drain_s: PositiveFloat = 20.0
    """Seconds granted to what runs when the service is told to stop."""
    cancel_grace_s: PositiveFloat = 2.0
    """Seconds in which a query has to stop when asked to, before its worker is killed."""

    @model_validator(mode="after")
    def _no_unknown_variable(self) -> Self:
        known = {variable_of(name) for name in type(self).model_fields}
        unknown = sorted(
            name
            for name in os.environ
            if name.upper().startswith(PREFIX) and name.upper() not in known
        )
        if unknown:
            raise ValueError(
                f"unknown setting {', '.join(unknown)}; there are {', '.join(sorted(known))}"
            )
        return self


def variable_of(field: str) -> str:
    """Return the name of the environment variable of the setting ``field``."""
    return PREFIX + field.upper()
