"""The model of scaling, held against closed forms of queueing and of caches."""

import math
from collections import OrderedDict

import numpy as np
import pytest

from benchmarks.scaling.model import Model, Question, ReplicaTimes, Shape
from benchmarks.scaling.traffic import Assumed, Cache, cell_of

COUNT = 40_000


def arrivals(rate: float) -> np.ndarray:
    return np.cumsum(np.random.default_rng(1).exponential(1 / rate, COUNT))


def mean_wait(model: Model, questions: list[Question]) -> float:
    answers = model.answer_all(questions)
    assert len(answers) == len(questions)
    return float(np.mean([each.waited_s for each in answers]))


@pytest.mark.slow
@pytest.mark.parametrize(("workers", "load"), [(1, 0.5), (2, 0.7), (4, 0.8)])
def test_long_work_waits_as_erlang_s_formula_says(workers: int, load: float) -> None:
    times, work = arrivals(load * workers), np.random.default_rng(2).exponential(1.0, COUNT)
    questions = [Question(*each) for each in zip(times.tolist(), work.tolist(), strict=True)]
    offered = load * workers
    last = offered**workers / math.factorial(workers) / (1 - load)
    waiting = last / (sum(offered**k / math.factorial(k) for k in range(workers)) + last)
    expected = waiting / (workers * (1 - load))
    assert mean_wait(Model(Shape(1, workers)), questions) == pytest.approx(expected, rel=0.12)


@pytest.mark.slow
def test_a_replica_s_core_is_a_queue_of_its_own() -> None:
    """Work of one length waits half as long as work of random length: Pollaczek and Khinchine."""
    questions = [Question(at, 0.0, is_stored=True) for at in arrivals(0.6).tolist()]
    model = Model(Shape(1, 1), ReplicaTimes(request_s=1.0))
    assert mean_wait(model, questions) == pytest.approx(0.6 / (2 * 0.4), rel=0.1)


def test_small_work_passes_long_work_but_takes_no_more_slots_than_workers() -> None:
    long = [Question(0.0, 10.0), Question(0.1, 10.0)]
    small = [Question(1.0 + i / 10, 1.0, is_small=True) for i in range(2)]
    answers = Model(Shape(1, 1)).answer_all([*long, *small])
    ends = sorted((each.arrival, each.arrival + each.seconds) for each in answers)
    np.testing.assert_allclose(ends, [(0.0, 10.0), (0.1, 20.0), (1.0, 2.0), (1.1, 3.0)])


@pytest.mark.parametrize("host", [0, 1])
def test_a_mesh_is_at_home_at_one_host_until_that_is_busy(host: int) -> None:
    mesh = next(Model(Shape(2, 1)).meshes_of(host))
    alone, crowded = Model(Shape(2, 1)), Model(Shape(2, 1))
    alone.answer_all([Question(10.0 * i, 1.0, mesh=mesh) for i in range(3)])
    assert alone.hosts[host].busy_s == 3.0
    crowded.answer_all([Question(i / 10, 10.0, mesh=mesh) for i in range(2)])
    assert crowded.hosts[host].busy_s == crowded.hosts[1 - host].busy_s == 10.0


def test_a_mesh_is_pulled_once_by_each_host_that_needs_it() -> None:
    questions = [Question(i / 10, 1.0, mesh=7, pull_s=5.0) for i in range(3)]
    model = Model(Shape(1, 3), has_mesh=lambda _: False)
    answers = model.answer_all(questions)
    ends = [each.arrival + each.seconds for each in answers]
    np.testing.assert_allclose(ends, [6.0, 6.0, 6.0])
    assert [each.waited_s for each in answers] == pytest.approx([0.0, 0.0, 0.0])


def test_busy_clients_are_answered_as_fast_as_all_workers_work() -> None:
    model = Model(Shape(hosts=2, workers=2))
    answers = model.keep_busy(16, [Question(0.0, 0.5, mesh=i) for i in range(800)])
    assert max(each.arrival + each.seconds for each in answers) == pytest.approx(100.0, rel=0.05)


def test_caches_have_what_a_least_recently_used_cache_has() -> None:
    assumed, meshes, room = Assumed(), 2_000, 200
    ranks = assumed.ranks(meshes, np.random.default_rng(3).uniform(size=60_000))
    kept: OrderedDict[int, None] = OrderedDict()
    hits = 0
    for rank in ranks.tolist():
        hits += rank in kept
        kept[rank] = None
        kept.move_to_end(rank)
        if len(kept) > room:
            kept.popitem(last=False)
    cache = Cache.of(assumed, meshes, rate=1.0, caches=1, room=room, mesh_bytes=1.0)
    assert cache.has(ranks.astype(float)).mean() == pytest.approx(hits / len(ranks), abs=0.02)


def test_questions_follow_zipf_s_law_and_cells_share_meshes_evenly() -> None:
    assumed, meshes = Assumed(), 1_000_000
    ranks = assumed.ranks(meshes, np.random.default_rng(4).uniform(size=200_000))
    share = assumed.share_of(np.arange(1.0, meshes + 1.0), meshes)
    assert share.sum() == pytest.approx(1.0)
    assert (ranks == 1).mean() == pytest.approx(share[0], rel=0.05)
    counts = np.bincount(cell_of(np.arange(100_000), 10))
    np.testing.assert_allclose(counts, 10_000, rtol=0.05)
