"""Settings: environment variables that begin with ``GEODESIC_``."""

import os
import re
import resource
from ipaddress import ip_network
from pathlib import Path
from typing import Annotated, Any, Literal, Self
from urllib.parse import urlsplit
from urllib.request import url2pathname

from pydantic import (
    BeforeValidator,
    Field,
    PositiveInt,
    SecretStr,
    field_validator,
    model_validator,
)
from pydantic_settings import BaseSettings, NoDecode, SettingsConfigDict

from app.access import ApiKey, parse_keys

PREFIX = "GEODESIC_"
LIBRARY_VARIABLES = {"GEODESIC_CPU_LEVEL", "GEODESIC_QUIET"}
"""Variables that the library reads: they are no settings of the service, and no mistakes."""
SERVICE_KEY_VARIABLE = "GEODESIC_SERVICE_KEY"
"""The variable that commands read which ask a service: likewise"""
MIB = 2**20
GIB = 2**30
LEAST_WORKER_MEMORY = 512 * MIB
"""Bytes that compiling a kernel takes"""


def available_cores() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def available_memory() -> int:
    """Return the bytes of memory of this machine, or of its container if fewer."""
    physical = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    limit = Path("/sys/fs/cgroup/memory.max")
    allowed = limit.read_text().strip() if limit.is_file() else "max"
    return min(physical, int(allowed)) if allowed.isdigit() else physical


def _worker_memory(data: dict[str, Any]) -> int:
    # The rest is for the API process, the disk cache and other programs.
    return max(GIB, available_memory() * 4 // 5 // int(data["workers"]))


def _query_bytes(data: dict[str, Any]) -> int:
    return min(4 * MIB, int(data["max_upload_bytes"]))


def _scratch_bytes(data: dict[str, Any]) -> int:
    return 8 * int(data["max_upload_bytes"])


def _quota_results(data: dict[str, Any]) -> int | None:
    return int(data["results_bytes"]) // 2 if data["api_keys"] else None


def _connections(_data: dict[str, Any]) -> int:
    # The other half is for files, and for the sockets of workers.
    return min(1000, resource.getrlimit(resource.RLIMIT_NOFILE)[0] // 2)


def _caller_connections(data: dict[str, Any]) -> int:
    return max(1, int(data["max_connections"]) // 4)


def _query_memory(data: dict[str, Any]) -> int:
    return min(8 * GIB, int(data["worker_memory_bytes"]) // 2)


def _listed(value: object) -> object:
    """Return the items of a comma-separated text; any other value stays as it is."""
    if not isinstance(value, str):
        return value
    return [item.strip() for item in value.split(",")] if value.strip() else []


OBJECT_STORES = ("s3", "gs", "az")
"""Schemes of the URLs of object stores"""


def folder_of(store: str) -> Path:
    """Return the folder of a store, from its path or a URL of the scheme ``file``.

    Raises
    ------
    ValueError
        The text is empty, or a URL of another scheme or machine.
    """
    url = urlsplit(store) if "://" in store else None
    if url is None and store:
        return Path(store)
    if url is None or url.scheme != "file" or url.netloc not in ("", "localhost"):
        raise ValueError(
            f"{store!r} is not a folder of this machine: give a path, or a URL such as "
            "file:///srv/x"
        )
    return Path(url2pathname(url.path))


def _store(value: object) -> object:
    if not isinstance(value, str) or urlsplit(value).scheme in OBJECT_STORES:
        return value
    return folder_of(value)


def _keys(value: object) -> object:
    return parse_keys(value) if isinstance(value, str) else value


Seconds = Annotated[float, Field(gt=0, allow_inf_nan=False)]

_ORIGIN = re.compile(r"\*|https?://[^/\s?#@A-Z]+")
_PREFIX = re.compile(r"(/[A-Za-z0-9._~-]+)+")
_HOST = re.compile(r"(\*\.)?[a-z0-9_-]+(\.[a-z0-9_-]+)*|\[[0-9a-f:]+\]")


class Settings(BaseSettings):
    """All settings, validated at the start; an unknown one, or a contradiction, is an error.

    One store belongs to one service, or to all of a cluster that have one ``state``. The first
    removes unfinished files from it at the start.
    """

    model_config = SettingsConfigDict(
        env_prefix=PREFIX,
        frozen=True,
        extra="forbid",
        use_attribute_docstrings=True,
        hide_input_in_errors=True,  # the input may be an API key
    )

    store: Annotated[Path | str, BeforeValidator(_store)] = Path("geodesic-store")
    """Folder of meshes, results and fields, created if missing; or URL such as `s3://bucket/x`."""
    copies: Path = Path("geodesic-copies")
    """Local folder for copies of meshes, where the store is at a URL."""
    copies_bytes: PositiveInt = 16 * GIB
    """Size of these copies; one that was removed is fetched again when needed."""
    engine: Literal["local", "ray"] = "local"
    """`local` computes on this machine, `ray` on the hosts of a cluster."""
    state: SecretStr | None = None
    """URL of a PostgreSQL database, for services of a cluster; by default SQLite in the store."""
    workers: PositiveInt = Field(default_factory=available_cores)
    """Worker processes; by default one for each core."""
    worker_memory_bytes: int = Field(ge=LEAST_WORKER_MEMORY, default_factory=_worker_memory)
    """Memory of a worker beyond its kernels; mapped files (meshes) do not count."""
    worker_mesh_bytes: PositiveInt = 2 * GIB
    """Size of the meshes that a worker holds open, and of its solvers for paths on them."""
    worker_field_bytes: PositiveInt = 512 * MIB
    """Size of the distance fields that a worker caches."""
    store_bytes: PositiveInt = 64 * GIB
    """Size of the stored meshes; an upload that does not fit is refused."""
    store_evict: Literal["off", "lru"] = "off"
    """`lru` removes the least recently used meshes instead."""
    results_bytes: PositiveInt = 4 * GIB
    """Size of the stored results."""
    results_memory_bytes: PositiveInt = 256 * MIB
    """Size of the small results cached in memory; some of them have no files."""
    fields_bytes: PositiveInt = 4 * GIB
    """Size of the stored distance fields; only those that took more than 50 ms are stored."""
    max_upload_bytes: PositiveInt = 512 * MIB
    """Largest body of an upload."""
    scratch_bytes: PositiveInt = Field(default_factory=_scratch_bytes)
    """Size of the uploads under way, unpacked ones included; by default eight of the largest."""
    max_query_bytes: PositiveInt = Field(default_factory=_query_bytes)
    """Largest body of a query; by default 4 MiB."""
    max_faces: PositiveInt = 5_000_000
    """Most faces of a mesh."""
    max_vertices: PositiveInt = 3_000_000
    """Most vertices of a mesh; a closed one has half as many as faces."""
    max_sources: PositiveInt = 10_000
    """Most sources of a query; each point of a curve counts. Large matrices may have more."""
    max_matrix_cells: PositiveInt = 10_000_000
    """Most cells of a matrix in memory: sources times targets, pairs, or finite distances."""
    max_waypoints: PositiveInt = 100
    """Most waypoints of a path."""
    max_levels: PositiveInt = 1000
    """Most levels of isolines."""
    max_json_values: PositiveInt = 2_000_000
    """Most values of an answer in JSON; binary ones have no such limit."""
    query_memory_bytes: PositiveInt = Field(default_factory=_query_memory)
    """Memory granted to a query; by default half of its worker's, at most 8 GiB."""
    queue_size: PositiveInt = 64
    """Requests that may wait for a worker."""
    deadline_s: Seconds = 120.0
    """Seconds that a request may take."""
    job_deadline_s: Seconds = 86_400.0
    """Seconds that a job may take."""
    job_ttl: Seconds = 86_400.0
    """Seconds until a finished job is removed, with its answer."""
    drain_delay_s: Annotated[float, Field(ge=0, allow_inf_nan=False)] | None = None
    """Seconds between `/readyz` saying 503 and the first refusal; 0 on loopback, else 5."""
    drain_s: Seconds = 20.0
    """Seconds that running requests get when the service is told to stop."""
    cancel_grace_s: Seconds = 2.0
    """Seconds that work gets to stop, before its worker is killed."""
    auth: Literal["on", "off"] = "on"
    """`off` serves without keys on any address, for instance behind a proxy that checks keys."""
    api_keys: Annotated[tuple[ApiKey, ...], NoDecode, BeforeValidator(_keys)] = ()
    """Keys of one tenant, one of which clients must have, as `name:secret`, separated by commas.

    They share meshes, names and jobs. Keys are optional on loopback.
    """
    rate_limit: PositiveInt | None = None
    """Requests per minute that a caller may make; all of them may come at once."""
    max_concurrent: PositiveInt | None = None
    """Requests of a caller that may run at the same time."""
    quota_results_bytes: PositiveInt | None = Field(default_factory=_quota_results)
    """Size of the answers to a caller's jobs; by default half of all, and all without keys."""
    quota_uploads: PositiveInt | None = None
    """Uploads of a caller that may run at the same time, samples included."""
    max_connections: PositiveInt = Field(default_factory=_connections)
    """Connections that may be open; 1000, or half of the process's descriptors if fewer."""
    max_caller_connections: PositiveInt = Field(default_factory=_caller_connections)
    """Connections from one address; by default a quarter of all. A proxy may need more."""
    trusted_proxies: Annotated[tuple[str, ...], NoDecode, BeforeValidator(_listed)] = ()
    """Addresses or networks whose `X-Forwarded-For` names the caller, separated by commas."""
    root_path: str = ""
    """Prefix of all addresses, such as `/geodesic`, where a proxy offers the service below it."""
    allowed_hosts: Annotated[tuple[str, ...], NoDecode, BeforeValidator(_listed)] = ()
    """Names that `Host` may have, separated by commas; `*.example.org` allows all subdomains."""
    cors_origins: Annotated[tuple[str, ...], NoDecode, BeforeValidator(_listed)] = ()
    """Origins whose pages may use the service, separated by commas, or `*`."""
    log_format: Literal["json", "text"] | None = None
    """`json` or `text`; by default text on a terminal and JSON elsewhere."""
    log_probes: Literal["on", "off"] = "off"
    """`on` logs requests for `/livez` and `/readyz` too."""

    @property
    def folder(self) -> Path:
        """The folder that workers see: the store itself, or copies of what is in it."""
        return self.store if isinstance(self.store, Path) else self.copies

    @field_validator("state")
    @classmethod
    def _is_of_postgresql(cls, state: SecretStr | None) -> SecretStr | None:
        schemes = ("postgresql://", "postgres://")
        if state is not None and not state.get_secret_value().startswith(schemes):
            raise ValueError("it is not a URL such as postgresql://user:secret@host:5432/database")
        return state

    @field_validator("root_path")
    @classmethod
    def _is_a_prefix(cls, path: str) -> str:
        if path and not _PREFIX.fullmatch(path):
            raise ValueError(
                f"{path!r} is not a prefix such as /geodesic, without a slash at its end"
            )
        return path

    @field_validator("cors_origins")
    @classmethod
    def _are_origins(cls, origins: tuple[str, ...]) -> tuple[str, ...]:
        for origin in origins:
            if not _ORIGIN.fullmatch(origin):
                raise ValueError(f"{origin!r} is not an origin such as https://example.org, nor *")
        return origins

    @field_validator("trusted_proxies")
    @classmethod
    def _are_networks(cls, proxies: tuple[str, ...]) -> tuple[str, ...]:
        for proxy in proxies:
            try:
                ip_network(proxy)
            except ValueError:
                raise ValueError(
                    f"{proxy!r} is not an address, nor a network as 10.0.0.0/8"
                ) from None
        return proxies

    @field_validator("allowed_hosts")
    @classmethod
    def _are_hosts(cls, hosts: tuple[str, ...]) -> tuple[str, ...]:
        for host in hosts:
            if not _HOST.fullmatch(host):
                raise ValueError(
                    f"{host!r} is not a host such as example.org, in lower case and without a port"
                )
        return hosts

    @model_validator(mode="after")
    def _agrees_with_itself(self) -> Self:
        if self.auth == "off" and self.api_keys:
            raise ValueError("GEODESIC_AUTH is off, but GEODESIC_API_KEYS has keys")
        for small, large in _AT_MOST:
            if getattr(self, small) > getattr(self, large):
                raise ValueError(
                    f"{variable_of(small)} is {getattr(self, small)}; it must be at most "
                    f"{variable_of(large)}, {getattr(self, large)}"
                )
        return self

    @model_validator(mode="after")
    def _no_unknown_variable(self) -> Self:
        known = {variable_of(name) for name in type(self).model_fields}
        known |= LIBRARY_VARIABLES | {SERVICE_KEY_VARIABLE}
        unknown = sorted(
            name
            for name in os.environ
            if name.upper().startswith(PREFIX) and name.upper() not in known
        )
        if unknown:
            raise ValueError(
                f"unknown setting {', '.join(unknown)}{_hint(unknown)}; the settings are "
                f"{', '.join(sorted(known))}"
            )
        return self


_AT_MOST = (
    ("max_query_bytes", "max_upload_bytes"),
    ("max_upload_bytes", "scratch_bytes"),
    ("query_memory_bytes", "worker_memory_bytes"),
    ("max_caller_connections", "max_connections"),
)
"""Pairs of settings of which the first must not exceed the second"""


def _hint(unknown: list[str]) -> str:
    """Return what to do where Kubernetes has set variables for a Service such as ``geodesic``."""
    if not any(name.endswith("_SERVICE_HOST") for name in unknown):
        return ""
    return (
        " (Kubernetes sets such variables for a Service; enableServiceLinks: false in the pod's "
        "spec keeps them out)"
    )


def variable_of(field: str) -> str:
    """Return the name of the environment variable of the setting ``field``."""
    return PREFIX + field.upper()
