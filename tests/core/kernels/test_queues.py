"""The two queues against Python's own sorting and lists."""

from collections import deque

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from geodesic_core.kernels.front.counters import HEAP_SIZE, RING_SIZE
from geodesic_core.kernels.front.queues import pop_nearest, push_or_raise, ring_pop, ring_push
from geodesic_core.kernels.front.state import new_wavefront
from tests.support import zoo
from tests.support.invariants import check_heap
from tests.support.stepping import topology_of, view_of_arrays

pytestmark = pytest.mark.plain

TOPOLOGY = topology_of(zoo.SMALL["crags"])
VERTICES, HALF_EDGES = len(TOPOLOGY.total_angle), len(TOPOLOGY.links)


def empty():
    wave = new_wavefront(TOPOLOGY)
    return wave, view_of_arrays(TOPOLOGY, wave)


def drained(view) -> list[int]:
    return [int(pop_nearest(view.queues, view.counters)) for _ in range(view.counters[HEAP_SIZE])]


@given(st.lists(st.integers(0, 5), min_size=VERTICES, max_size=VERTICES), st.randoms())
def test_vertices_leave_by_distance_and_then_by_number(distances, random):
    wave, view = empty()
    wave.vertices.distance[:] = distances
    order = list(range(VERTICES))
    random.shuffle(order)
    for v in order:
        push_or_raise(view.queues, view.counters, v, view.vertices.distance[v])
    check_heap(wave)
    assert drained(view) == sorted(range(VERTICES), key=lambda v: (distances[v], v))
    assert (wave.queues.heap_place == -1).all()


@given(st.lists(st.tuples(st.integers(0, VERTICES - 1), st.floats(0, 1)), max_size=150))
def test_distances_decrease_while_others_leave(offers):
    """After each third offer the nearest leaves; it may come back when it is improved."""
    wave, view = empty()
    waiting = {}
    for i, (v, distance) in enumerate(offers):
        if distance < wave.vertices.distance[v]:
            wave.vertices.distance[v] = distance
            push_or_raise(view.queues, view.counters, v, view.vertices.distance[v])
            waiting[v] = distance
        check_heap_order(wave)
        if i % 3 == 2 and waiting:
            nearest = min(waiting, key=lambda u: (waiting[u], u))
            assert pop_nearest(view.queues, view.counters) == nearest
            del waiting[nearest]
    assert drained(view) == sorted(waiting, key=lambda u: (waiting[u], u))


def check_heap_order(wave):
    heap = wave.queues.heap[: wave.counters[HEAP_SIZE]].tolist()
    keys = [(wave.vertices.distance[v], v) for v in heap]
    assert all(keys[(i - 1) // 4] <= keys[i] for i in range(1, len(keys)))
    assert [int(wave.queues.heap_place[v]) for v in heap] == list(range(len(heap)))


def test_ring_is_first_in_first_out_all_the_way_around():
    _, view = empty()
    model, rng, h = deque(), np.random.default_rng(1), 0
    for _ in range(20 * HALF_EDGES):
        if len(model) < HALF_EDGES and (not model or rng.random() < 0.6):
            ring_push(view, h)
            model.append(h)
            h = (h + 1) % HALF_EDGES
        else:
            assert ring_pop(view) == model.popleft()
        assert view.counters[RING_SIZE] == len(model)


def test_ring_holds_every_half_edge_at_once():
    _, view = empty()
    for turn in range(3):
        for h in range(HALF_EDGES):
            ring_push(view, h)
        assert [ring_pop(view) for _ in range(HALF_EDGES)] == list(range(HALF_EDGES)), turn
