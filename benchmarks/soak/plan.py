"""The plan of a soak: requests with their right answers, which `traffic` reads from a file."""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

SECRETS = {name: f"{name}-0123456789abcdef" for name in ("alice", "bob", "carol", "greedy")}
"""The callers, and their API keys: Alice and Bob ask, Carol hoards jobs, one is greedy"""
HOARD = 32
"""Jobs that Carol leaves until she removes them all"""
MAX_CONCURRENT = 24
MIB = 2**20

SETTINGS = {
    "GEODESIC_WORKERS": "2",
    "GEODESIC_WORKER_MESH_BYTES": str(24 * MIB),
    "GEODESIC_WORKER_FIELD_BYTES": str(4 * MIB),
    "GEODESIC_STORE_BYTES": str(96 * MIB),
    "GEODESIC_STORE_EVICT": "lru",
    "GEODESIC_RESULTS_BYTES": str(8 * MIB),
    "GEODESIC_RESULTS_MEMORY_BYTES": str(MIB // 2),
    "GEODESIC_FIELDS_BYTES": str(8 * MIB),
    "GEODESIC_JOB_TTL": "60",
    "GEODESIC_QUEUE_SIZE": "16",
    "GEODESIC_MAX_CONCURRENT": str(MAX_CONCURRENT),
    "GEODESIC_API_KEYS": ",".join(f"{name}:{secret}" for name, secret in SECRETS.items()),
    "GEODESIC_ALLOWED_HOSTS": "localhost,127.0.0.1",
    # A worker that is killed takes its memory along, so that no growth would be seen.
    "GEODESIC_CANCEL_GRACE_S": "300",
}
"""Bounds that the traffic exceeds, so that each cache is full soon, and limits that it meets"""


@dataclass(frozen=True)
class Expected:
    """What must come back."""

    status: int = 200
    code: str = ""
    """Code of the problem, where it is one"""
    digest: str = ""
    """Of the body, where that is known"""
    headers: Mapping[str, str] = field(default_factory=dict)
    """Headers that depend on the content"""


@dataclass(frozen=True)
class Request:
    """A request and its right answer."""

    operation: str
    """Its id in the description of the interface"""
    method: str
    path: str
    body: bytes | None = None
    headers: Mapping[str, str] = field(default_factory=dict)
    expected: Expected = field(default_factory=Expected)


@dataclass(frozen=True)
class Upload:
    """A mesh to upload, its id, and a query on it."""

    request: Request
    mesh_id: str
    query: Request


@dataclass(frozen=True)
class Plan:
    """All that is sent, in random order."""

    meshes: Sequence[Upload]
    """There from the beginning"""
    variants: Sequence[Upload]
    """Uploaded again and again; the oldest are evicted"""
    queries: Sequence[Request]
    others: Sequence[Request]
    """Requests that need no worker"""
    wrong: Sequence[Request]
    """Requests that must be refused"""
    large: str
    """Id of a mesh on which exact distances take long enough to be stopped under way"""


def digest_of(body: bytes) -> str:
    """Return the hash by which bodies are compared."""
    return hashlib.blake2b(body, digest_size=16).hexdigest()
