"""Records of a head in Redis: what is said where it cannot be used, and whose they are."""

import pytest
from pydantic import SecretStr, ValidationError

from app.engine import head_records
from app.engine.cluster import ClusterError
from app.engine.head_records import in_redis
from app.settings import Settings
from tests.support.redis import SECRET, Redis

pytestmark = pytest.mark.service
pytest.importorskip("redis", reason="needs the extra cluster")

TOKEN = "a-token-of-tests-only"  # noqa: S105 - of no other use


def refusal(url: str) -> str:
    with pytest.raises(ClusterError) as refused, in_redis(SecretStr(url), TOKEN):
        pass
    message = str(refused.value)
    assert SECRET not in message
    assert "\n" not in message
    return message


@pytest.fixture(autouse=True)
def long_lease(monkeypatch: pytest.MonkeyPatch) -> None:
    """A claim that does not run out while a test holds it: no head renews its own here."""
    monkeypatch.setattr(head_records, "_LEASE_S", 3600.0)


def test_a_server_that_does_not_exist() -> None:
    assert "the Redis at 127.0.0.1:1 cannot be used" in refusal("redis://127.0.0.1:1")


@pytest.mark.parametrize("secret", [":wrong@", ":@", ""])
def test_a_wrong_password(redis_server: Redis, secret: str) -> None:
    place = f"{redis_server.host}:{redis_server.port}"
    assert f"the Redis at {place} refuses this user or password" in refusal(
        f"redis://{secret}{place}"
    )


@pytest.mark.parametrize(
    "url", ["10.0.0.1:6379", "http://10.0.0.1", "redis://", "redis://h/1", "redis://h?db=1"]
)
def test_a_url_of_something_else(url: str) -> None:
    with pytest.raises(ValidationError, match="not a URL such as redis://user:secret@host:6379"):
        Settings(redis=SecretStr(url))


def test_ray_is_told_where_they_are_and_nobody_else(redis_server: Redis) -> None:
    with in_redis(SecretStr(redis_server.url()), TOKEN) as records:
        assert records.environment["RAY_REDIS_ADDRESS"].endswith(f":{redis_server.port}")
        assert f"--redis-password={SECRET}" in records.options
        assert SECRET not in repr(records)


def test_it_is_told_whether_they_are_durable(redis_server: Redis) -> None:
    url = SecretStr(redis_server.url())
    with in_redis(url, TOKEN) as records:
        assert f"in the Redis at {redis_server.host}:{redis_server.port}" in records.durability
        assert "crash" not in records.durability
    redis_server.keep_no_log()
    with in_redis(url, TOKEN) as records:
        assert "but a crash of that Redis loses them" in records.durability


def test_records_belong_to_one_head_at_a_time(
    redis_server: Redis, monkeypatch: pytest.MonkeyPatch
) -> None:
    url = SecretStr(redis_server.url())
    with in_redis(url, TOKEN), in_redis(url, "another-token-of-tests") as other:
        other.renew()
        monkeypatch.setattr(head_records, "_LEASE_S", 0.1)  # and so the wait of another head
        assert "another head uses the records geodesic-" in refusal(redis_server.url())
        redis_server.forget("geodesic-*-claim")
        with in_redis(url, TOKEN):
            pass


def test_a_head_whose_claim_has_run_out_takes_it_again_or_ends(redis_server: Redis) -> None:
    url = SecretStr(redis_server.url())
    with in_redis(url, TOKEN) as records:
        redis_server.forget("geodesic-*")
        records.renew()
        redis_server.forget("geodesic-*")
        with in_redis(url, TOKEN) as successor:
            with pytest.raises(ClusterError, match="another head has taken over the records"):
                records.renew()
            successor.renew()
