"""What an operator can set: environment variables that begin with ``GEODESIC_``."""

import os
import re
from pathlib import Path
from typing import Annotated, Any, Literal, Self
from urllib.parse import urlsplit
from urllib.request import url2pathname

from pydantic import (
    BeforeValidator,
    Field,
    PositiveInt,
    field_validator,
    model_validator,
)
from pydantic_settings import BaseSettings, NoDecode, SettingsConfigDict

from app.access import ApiKey, parse_keys

PREFIX = "GEODESIC_"
MIB = 2**20
GIB = 2**30
LEAST_WORKER_MEMORY = 512 * MIB
"""What compiling a kernel takes."""


def available_cores() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _memory() -> int:
    """Return the bytes of memory there are for this process, or its container."""
    physical = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    limit = Path("/sys/fs/cgroup/memory.max")
    granted = limit.read_text().strip() if limit.is_file() else "max"
    return min(physical, int(granted)) if granted.isdigit() else physical


def _worker_memory(data: dict[str, Any]) -> int:
    # The API process, the disk cache and everyone else have the rest.
    return max(GIB, _memory() * 4 // 5 // int(data["workers"]))


def _query_bytes(data: dict[str, Any]) -> int:
    return min(4 * MIB, int(data["max_upload_bytes"]))


def _query_memory(data: dict[str, Any]) -> int:
    return min(8 * GIB, int(data["worker_memory_bytes"]) // 2)


def _listed(value: object) -> object:
    """Return the items of a text that separates them by commas."""
    if not isinstance(value, str):
        return value
    return [item.strip() for item in value.split(",")] if value.strip() else []


def folder_of(store: str) -> Path:
    """Return the folder that a setting names, by its path or by a URL of the scheme ``file``.

    Raises
    ------
    ValueError
        It names none, or something else than a folder of this machine.
    """
    url = urlsplit(store) if "://" in store else None
    if url is None and store:
        return Path(store)
    if url is None or url.scheme != "file" or url.netloc not in ("", "localhost"):
        raise ValueError(
            f"{store!r} names no folder of this machine: give its path, or a URL such as file:///srv/x"
        )
    return Path(url2pathname(url.path))


def _store(value: object) -> object:
    return folder_of(value) if isinstance(value, str) else value


def _keys(value: object) -> object:
    return parse_keys(value) if isinstance(value, str) else value


Seconds = Annotated[float, Field(gt=0, allow_inf_nan=False)]

_ORIGIN = re.compile(r"\*|https?://[^/\s?#@A-Z]+")


class Settings(BaseSettings):
    """Every setting, validated at start; one that does not exist, or contradicts another, stops it.

    One store belongs to one service: it is swept of half-written entries at start.
    """

    model_config = SettingsConfigDict(
        env_prefix=PREFIX,
        frozen=True,
        extra="forbid",
        use_attribute_docstrings=True,
        hide_input_in_errors=True,  # it may be a key
    )

    store: Annotated[Path, BeforeValidator(_store)] = Path("geodesic-store")
    """Folder of meshes, results and fields, or its `file://` URL; created where it is not there."""
    workers: PositiveInt = Field(default_factory=available_cores)
    """Worker processes; one for each core, unless set."""
    worker_memory_bytes: int = Field(ge=LEAST_WORKER_MEMORY, default_factory=_worker_memory)
    """Memory of a worker for its work, whatever that is; what it maps (meshes) does not count."""
    worker_mesh_bytes: PositiveInt = 2 * GIB
    """Size of the meshes that a worker keeps open, and of what it keeps for paths on them."""
    worker_field_bytes: PositiveInt = 512 * MIB
    """Size of the distance fields that a worker keeps, so that what is asked next is there."""
    store_bytes: PositiveInt = 64 * GIB
    """Size of the meshes that the store keeps; what finds no room is refused."""
    store_evict: Literal["off", "lru"] = "off"
    """`lru` lets the least recently used meshes go instead."""
    results_bytes: PositiveInt = 4 * GIB
    """Size of the finished results that the store keeps."""
    results_memory_bytes: PositiveInt = 256 * MIB
    """Size of the small ones in memory: some of them, and all that have no files."""
    fields_bytes: PositiveInt = 4 * GIB
    """Size of the distance fields that the store keeps: those that took more than 50 ms."""
    max_upload_bytes: PositiveInt = 512 * MIB
    """Largest body of an upload."""
    max_query_bytes: PositiveInt = Field(default_factory=_query_bytes)
    """Largest body of a query; 4 MiB, unless set."""
    max_faces: PositiveInt = 5_000_000
    """Most faces of a mesh."""
    max_sources: PositiveInt = 10_000
    """Most sources of a query; each point of a curve counts."""
    max_matrix_cells: PositiveInt = 10_000_000
    """Most cells of a matrix: sources by targets, pairs, or what is reached of a sparse one."""
    max_waypoints: PositiveInt = 100
    """Most waypoints of a path."""
    max_levels: PositiveInt = 1000
    """Most levels of isolines."""
    max_json_values: PositiveInt = 2_000_000
    """Most values of an answer in JSON; binary ones have no such limit."""
    query_memory_bytes: PositiveInt = Field(default_factory=_query_memory)
    """Memory granted to a query; half of its worker's, and 8 GiB at most, unless set."""
    queue_size: PositiveInt = 64
    """Requests that may wait for a worker."""
    deadline_s: Seconds = 120.0
    """Seconds that a request may take."""
    job_deadline_s: Seconds = 86_400.0
    """Seconds that a job may take."""
    job_ttl: Seconds = 86_400.0
    """Seconds for which a job is kept after it has finished, with its answer."""
    drain_s: Seconds = 20.0
    """Seconds granted to what runs when the service is told to stop."""
    cancel_grace_s: Seconds = 2.0
    """Seconds in which a query has to stop when asked to, before its worker is killed."""
    auth: Literal["on", "off"] = "on"
    """`off` serves without keys on any address, as behind a proxy that asks for them."""
    api_keys: Annotated[tuple[ApiKey, ...], NoDecode, BeforeValidator(_keys)] = ()
    """Keys that clients must have, as `name:secret`, separated by commas; none on loopback."""
    rate_limit: PositiveInt | None = None
    """Requests a minute that a caller may make; as many may come at once."""
    max_concurrent: PositiveInt | None = None
    """Requests of one caller that may run at the same time."""
    cors_origins: Annotated[tuple[str, ...], NoDecode, BeforeValidator(_listed)] = ()
    """Origins whose pages may use the service, separated by commas, or `*`."""

    @field_validator("cors_origins")
    @classmethod
    def _are_origins(cls, origins: tuple[str, ...]) -> tuple[str, ...]:
        for origin in origins:
            if not _ORIGIN.fullmatch(origin):
                raise ValueError(f"{origin!r} is not an origin such as https://example.org, nor *")
        return origins

    @model_validator(mode="after")
    def _agrees_with_itself(self) -> Self:
        if self.auth == "off" and self.api_keys:
            raise ValueError("GEODESIC_AUTH is off, but GEODESIC_API_KEYS has keys")
        for small, large in _AT_MOST:
            if getattr(self, small) > getattr(self, large):
                raise ValueError(
                    f"{variable_of(small)} is {getattr(self, small)}, which is more than "
                    f"{variable_of(large)}, {getattr(self, large)}"
                )
        return self

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


_AT_MOST = (
    ("max_query_bytes", "max_upload_bytes"),
    ("query_memory_bytes", "worker_memory_bytes"),
)
"""Pairs of settings of which the first must not be larger than the second."""


def variable_of(field: str) -> str:
    """Return the name of the environment variable of the setting ``field``."""
    return PREFIX + field.upper()
