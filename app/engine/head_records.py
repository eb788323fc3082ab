"""The records of a head, in a folder of its machine or in a Redis or Valkey."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import unquote, urlsplit

from pydantic import SecretStr

from app.engine.cluster import ClusterError

if TYPE_CHECKING:
    from redis import Redis
    from redis.lock import Lock

_PORT = 6379
_ANSWER_S = 5.0
_LEASE_S = 10.0
"""Time after which a head that no longer renews its claim counts as gone"""


@dataclass(frozen=True)
class FolderRecords:
    """Records in a folder, in RocksDB: as durable as its disk."""

    folder: Path
    options: Sequence[str] = ()
    """For ``ray start``"""

    @property
    def environment(self) -> Mapping[str, str]:
        """The variables by which Ray finds them."""
        return {"RAY_gcs_storage": "rocksdb", "RAY_gcs_storage_path": str(self.folder)}

    @property
    def durability(self) -> str:
        """How durable they are, in words."""
        return f"its records stay in {self.folder} when it stops"

    def renew(self) -> None:
        """Nothing: the lock of RocksDB keeps others out."""


@dataclass(frozen=True)
class RedisRecords:
    """Records in a Redis, of the head that holds the claim."""

    place: str
    name: str
    """Of the records there"""
    is_durable: bool
    options: Sequence[str] = field(repr=False)
    """For ``ray start``; they have the password"""
    environment: Mapping[str, str]
    claim: "Lock" = field(repr=False)

    @property
    def durability(self) -> str:
        """How durable they are, in words."""
        if self.is_durable:
            return f"its records stay in the Redis at {self.place} when it stops"
        return (
            f"its records stay in the Redis at {self.place} when it stops, but a crash of that "
            "Redis loses them: it keeps no log of changes (appendonly)"
        )

    def renew(self) -> None:
        """Renew the claim; raises ``ClusterError`` where another head has taken it over."""
        from redis.exceptions import LockNotOwnedError, RedisError

        with suppress(RedisError):  # Redis is away: Ray ends by itself
            try:
                self.claim.reacquire()
            except LockNotOwnedError:
                if not self.claim.acquire(blocking=False):
                    raise ClusterError(
                        f"another head has taken over the records {self.name} in the Redis at "
                        f"{self.place}"
                    ) from None


@contextmanager
def in_redis(url: SecretStr, token: str) -> Iterator[RedisRecords]:
    """Keep the records of the head of the cluster with a token in a Redis inside the block.

    Raises
    ------
    ClusterError
        It does not answer, or refuses; or another head has these records.
    """
    if find_spec("redis") is None:
        raise ClusterError("the Redis client is not installed: pip install 'geodesic[cluster]'")
    from redis.exceptions import AuthenticationError, RedisError

    parts = urlsplit(url.get_secret_value())
    client, place = _client(url), f"{parts.hostname}:{parts.port or _PORT}"
    user, password = unquote(parts.username or ""), unquote(parts.password or "")
    name = f"geodesic-{sha256(token.encode()).hexdigest()[:16]}"
    claim = client.lock(f"{name}-claim", timeout=_LEASE_S)
    records = f"the records {name} in the Redis at {place}"
    try:
        is_durable = bool(client.info("persistence")["aof_enabled"])
        is_ours = claim.acquire(blocking_timeout=1.5 * _LEASE_S)
    except AuthenticationError as error:
        raise ClusterError(
            f"the Redis at {place} refuses this user or password: {error}; correct --redis"
        ) from error
    except RedisError as error:
        raise ClusterError(
            f"the Redis at {place} cannot be used: {error}; start it, or correct --redis"
        ) from error
    if not is_ours:
        raise ClusterError(f"another head uses {records}: stop it, or use another Redis")
    try:
        yield RedisRecords(
            place,
            name,
            is_durable,
            [f"--redis-username={user}", f"--redis-password={password}"],
            {
                "RAY_REDIS_ADDRESS": f"{parts.scheme}://{place}",
                "RAY_external_storage_namespace": name,
            },
            claim,
        )
    finally:
        with suppress(RedisError):  # it expires by itself
            claim.release()


def _client(url: SecretStr) -> "Redis":
    from redis import Redis

    return Redis.from_url(
        url.get_secret_value(),
        socket_timeout=_ANSWER_S,
        socket_connect_timeout=_ANSWER_S,
        retry=None,
    )
