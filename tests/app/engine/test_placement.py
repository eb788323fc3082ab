"""Placement: the host that gets a task."""

from collections import Counter

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.engine.placement import Occupancy, choose, preference

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
    chosen = choose(key, hosts, is_small=small)

    order = preference(key, hosts)
    with_room = [host for host in order if hosts[host].has_room(is_small=small)]
    if not hosts:
        assert chosen is None
    elif with_room:
        assert chosen == with_room[0]
    else:
        assert chosen is not None
        least = min(each.pending / each.workers for each in hosts.values())
        assert hosts[chosen].pending / hosts[chosen].workers == least


def test_meshes_are_spread_over_hosts() -> None:
    hosts = {f"host{i}": FREE for i in range(4)}

    counts = Counter(choose(f"mesh {i}", hosts, is_small=False) for i in range(4000))

    # Of 4000 throws into 4 places, 5 standard deviations are 137.
    assert all(abs(count - 1000) < 137 for count in counts.values())


def test_a_hot_mesh_spreads_in_the_order_of_its_preference() -> None:
    hosts = {f"host{i}": FREE for i in range(4)}
    order = preference("hot", hosts)
    used = []

    for _ in range(8):
        host = choose("hot", hosts, is_small=False)
        assert host is not None
        used.append(host)
        hosts[host] = Occupancy(hosts[host].pending + 1, 2)

    assert used == [host for host in order for _ in range(2)]


@pytest.mark.parametrize(("small", "goes"), [(True, "stays"), (False, "moves")])
def test_small_work_stays_beside_long_work(small: bool, goes: str) -> None:
    first, second = preference("mesh", {"a": FREE, "b": FREE})

    chosen = choose("mesh", {first: FULL, second: FREE}, is_small=small)

    assert chosen == {"stays": first, "moves": second}[goes]
