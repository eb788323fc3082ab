"""Placement: the host that gets a task."""

from collections import Counter

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.engine.placement import Occupancy, preference, ranked

FREE, FULL = Occupancy(0, 2), Occupancy(2, 2)

names = st.lists(
    st.text("abcdef0123", min_size=1, max_size=8), min_size=1, max_size=12, unique=True
)
occupancies = st.builds(Occupancy, st.integers(0, 9), st.integers(1, 4))


@pytest.mark.slow
@given(names, st.text(max_size=8))
def test_a_host_that_leaves_changes_nothing_among_the_others(hosts: list[str], key: str) -> None:
    order = preference(key, dict.fromkeys(hosts, FREE))

    for gone in hosts:
        rest = preference(key, dict.fromkeys(set(hosts) - {gone}, FREE))
        assert rest == [host for host in order if host != gone]


@given(st.dictionaries(st.text(max_size=3), occupancies), st.text(max_size=8), st.booleans())
def test_the_first_with_room_or_else_the_least_full(
    hosts: dict[str, Occupancy], key: str, small: bool
) -> None:
    order = ranked(key, hosts, is_small=small)

    preferred = preference(key, hosts)
    with_room = [host for host in preferred if hosts[host].has_room(is_small=small)]
    assert order[: len(with_room)] == with_room
    assert sorted(order) == sorted(hosts)
    full = [hosts[host].pending / hosts[host].workers for host in order[len(with_room) :]]
    assert full == sorted(full)


def test_meshes_are_spread_over_hosts() -> None:
    hosts = {f"host{i}": FREE for i in range(4)}

    counts = Counter(ranked(f"mesh {i}", hosts, is_small=False)[0] for i in range(4000))

    # Of 4000 throws into 4 places, 5 standard deviations are 137.
    assert all(abs(count - 1000) < 137 for count in counts.values())


def test_a_hot_mesh_spreads_in_the_order_of_its_preference() -> None:
    hosts = {f"host{i}": FREE for i in range(4)}
    order = preference("hot", hosts)
    used = []

    for _ in range(8):
        host = ranked("hot", hosts, is_small=False)[0]
        used.append(host)
        hosts[host] = Occupancy(hosts[host].pending + 1, 2)

    assert used == [host for host in order for _ in range(2)]


@pytest.mark.parametrize(("small", "goes"), [(True, "stays"), (False, "moves")])
def test_small_work_stays_beside_long_work(small: bool, goes: str) -> None:
    first, second = preference("mesh", {"a": FREE, "b": FREE})

    order = ranked("mesh", {first: FULL, second: FREE}, is_small=small)

    assert order[0] == {"stays": first, "moves": second}[goes]
