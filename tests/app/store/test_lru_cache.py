"""The LRU cache: its items fit, also when one has grown, and none is measured without need."""

import pytest

from app.store.lru_cache import LRUCache


class Value:
    def __init__(self, size: int) -> None:
        self.size = size
        self.measured = 0

    def measure(self) -> int:
        self.measured += 1
        return self.size


def kept(capacity: int) -> LRUCache[str, Value]:
    return LRUCache(capacity, Value.measure)


def test_the_least_recently_used_go_first() -> None:
    values = kept(10)
    for key in "abac":
        values.find(key, lambda: Value(4))

    assert values.evict() == ["b"]
    assert list(values) == ["a", "c"]
    assert values.nbytes == 8


def test_a_value_is_made_once_while_it_is_kept() -> None:
    values = kept(10)
    first = values.find("a", lambda: Value(4))

    assert values.find("a", lambda: Value(5)) is first
    values.drop("a")
    assert values.find("a", lambda: Value(5)) is not first


def test_what_has_grown_since_is_measured_anew() -> None:
    values = kept(10)
    values.find("a", lambda: Value(1))
    values.find("b", lambda: Value(1)).size = 20

    values.find("c", lambda: Value(1))

    assert values.nbytes == 22
    assert values.evict() == ["a", "b"]
    assert values.nbytes == 1


def test_the_last_may_stay_though_it_is_too_large() -> None:
    values = kept(10)
    for key in "ab":
        values.find(key, lambda: Value(20))

    assert values.evict(spare=1) == ["a"]
    assert values.evict() == ["b"]
    assert (list(values), values.nbytes) == ([], 0)


def test_a_thousand_others_are_not_measured() -> None:
    values = kept(10**6)
    others = [values.find(str(i), lambda: Value(1)) for i in range(1000)]
    before = [each.measured for each in others[:-1]]

    for _ in range(10):
        values.find("one", lambda: Value(1))

    assert [each.measured for each in others[:-1]] == before
    assert values.nbytes == 1001


def test_what_cannot_be_made_leaves_nothing() -> None:
    values = kept(10)
    with pytest.raises(ZeroDivisionError):
        values.find("a", lambda: Value(1 // 0))

    assert (list(values), values.nbytes) == ([], 0)
