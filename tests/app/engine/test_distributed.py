"""The engine over several machines: its promises, against links and hosts that fail."""

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable, Collection
from contextlib import asynccontextmanager
from dataclasses import dataclass, field, replace
from time import time_ns
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from structlog.testing import capture_logs

from app.engine.cluster import BEAT_S, LEASE_S, SILENCE_S
from app.engine.distributed import DistributedEngine
from app.engine.work import MeshFromSample, StoreMesh, Task, TaskResult
from app.errors import ProblemError, problem
from app.store.folder_store import FolderStore
from app.tracing import Period
from tests.support import virtual_time
from tests.support.fake_cluster import SETTINGS, STORE_ID, FakeCluster
from tests.support.virtual_time import now
from tests.support.workers import distances_query, run_query

MESH = 32 * "a"
WORK = Task(run_query(distances_query(MESH)), "alice", (MESH,))
PROMISED = replace(WORK, is_promised=True)


def different(count: int) -> list[Task]:
    """Return tasks of one mesh that no result has in common."""
    work = [replace(WORK.work, result_name=f"{MESH}/{i}") for i in range(count)]
    return [replace(WORK, work=each) for each in work]


@dataclass
class Replica:
    """An engine of a service, over a cluster that it may share with others."""

    cluster: FakeCluster
    engine: DistributedEngine
    shares: list[float] = field(default_factory=list)

    def ask(self, task: Task = WORK) -> "asyncio.Task[TaskResult]":
        return asyncio.create_task(self.engine.run(task, self.shares.append))

    def where(self) -> str:
        """Return the host that does something."""
        (name,) = (name for name, engine in self.cluster.engines.items() if engine.running)
        return name

    def other(self) -> str:
        (name,) = (name for name, engine in self.cluster.engines.items() if not engine.running)
        return name

    @property
    def begun(self) -> dict[str, int]:
        return {name: len(engine.begun) for name, engine in self.cluster.engines.items()}


class ClaimedStore(FolderStore):
    """A store of which only the id is used."""

    def identity(self) -> str:
        return STORE_ID


@asynccontextmanager
async def replica_of(cluster: FakeCluster) -> AsyncIterator[Replica]:
    await cluster.start()
    engine = DistributedEngine(cluster, SETTINGS, ClaimedStore(SETTINGS.folder))
    await engine.start()
    await asyncio.sleep(2 * BEAT_S)
    yield Replica(cluster, engine)
    await engine.stop()
    await cluster.close()


Scene = Callable[[Replica], Awaitable[None]]


def play(scene: Scene, *hosts: str) -> None:
    """Run a scene against some hosts, by default ``a`` and ``b``."""

    async def main() -> None:
        async with replica_of(FakeCluster(*(hosts or ("a", "b")))) as replica:
            await scene(replica)

    virtual_time.run(main())


async def code_of(asking: "asyncio.Task[TaskResult]") -> str:
    with pytest.raises(ProblemError) as caught:
        await asking
    return caught.value.problem.code


def test_a_task_is_done_with_progress_that_never_falls() -> None:
    async def scene(replica: Replica) -> None:
        result = await replica.ask()

        assert result.seconds["compute"] == 8.0
        assert replica.shares == [0.0, 0.25, 0.5, 0.75]
        assert replica.begun in ({"a": 1, "b": 0}, {"a": 0, "b": 1})

    play(scene)


def test_the_same_mesh_goes_to_the_same_host_until_that_is_full() -> None:
    async def scene(replica: Replica) -> None:
        for _ in range(3):
            await replica.ask()
        assert sorted(replica.begun.values()) == [0, 3]

        await asyncio.gather(replica.ask(), replica.ask())
        assert sorted(replica.begun.values()) == [1, 4]

    play(scene)


def test_work_of_other_replicas_counts() -> None:
    async def main() -> None:
        cluster = FakeCluster("a", "b")
        async with replica_of(cluster) as one, replica_of(cluster) as other:
            task, another = different(2)
            first = one.ask(task)
            await asyncio.sleep(2 * BEAT_S)
            await asyncio.gather(first, other.ask(another))
            assert one.begun == {"a": 1, "b": 1}

    virtual_time.run(main())


@pytest.mark.parametrize("later_s", [0.0, 0.1, 2 * BEAT_S, 7.0])
def test_one_result_is_computed_once_for_all_replicas(later_s: float) -> None:
    """The host is full from the first on, and another one has room."""

    async def main() -> None:
        cluster = FakeCluster("a", "b")
        async with replica_of(cluster) as one, replica_of(cluster) as other:
            first = one.ask()
            await asyncio.sleep(later_s)
            await asyncio.gather(first, other.ask())
            assert sum(one.begun.values()) == 1
            assert now() <= 8.0 + later_s + 6 * BEAT_S  # of which the replicas wait four

    virtual_time.run(main())


@pytest.mark.parametrize("busy", [0, 1])
def test_a_result_that_two_hosts_began_is_computed_by_one(busy: int) -> None:
    """A replica knows of work of its own that the other one has not heard of yet."""

    async def main() -> None:
        cluster = FakeCluster("a", "b")
        async with replica_of(cluster) as one, replica_of(cluster) as other:
            task, another = different(2)
            first = (one, other)[busy].ask(task)
            await asyncio.sleep(0)
            await asyncio.gather(one.ask(another), other.ask(another), first)
            assert sum(one.begun.values()) == 3, "else they chose the same host"
            ended = [end for engine in cluster.engines.values() for end in engine.ended]
            assert sorted(ended) == ["done", "done", "stopped"]
            assert now() <= 8.0 + 6 * BEAT_S  # of which the replicas wait four

    virtual_time.run(main())


def test_a_replica_that_stops_leaves_the_computation_to_the_others() -> None:
    async def main() -> None:
        cluster = FakeCluster("a")
        async with replica_of(cluster) as one, replica_of(cluster) as other:
            first, second = one.ask(), other.ask()
            await asyncio.sleep(1)
            first.cancel()
            await second
            assert cluster.engines["a"].ended == ["done"]
            assert max(other.shares) == 0.75
            third, fourth = one.ask(), other.ask()
            await asyncio.sleep(1)
            third.cancel()
            fourth.cancel()
            await asyncio.sleep(1)
            assert cluster.engines["a"].ended == ["done", "stopped"]

    virtual_time.run(main())


def test_cancelling_stops_the_work() -> None:
    async def scene(replica: Replica) -> None:
        asking = replica.ask()
        await asyncio.sleep(1)
        asking.cancel()
        await asyncio.sleep(0.1)

        assert replica.cluster.engines["a"].ended == ["stopped"]

    play(scene, "a")


def test_a_result_that_nobody_waits_for_is_reported_to_one_replica() -> None:
    async def main() -> None:
        cluster, reported = FakeCluster("a"), list[str]()

        async def note(name: str) -> None:
            reported.append(name)

        async with replica_of(cluster) as one, replica_of(cluster) as other:
            one.engine.on_unclaimed = other.engine.on_unclaimed = note
            await cluster.engines["a"].on_unclaimed(f"{MESH}/late")
            await asyncio.sleep(4 * BEAT_S)
            assert reported == [f"{MESH}/late"]

    virtual_time.run(main())


def test_a_stop_is_sent_again_until_it_is_answered() -> None:
    async def scene(replica: Replica) -> None:
        replica.cluster.unanswered_stops = 2
        asking = replica.ask()
        await asyncio.sleep(1)
        asking.cancel()
        await asyncio.sleep(LEASE_S / 2)

        assert replica.cluster.engines["a"].ended == ["stopped"]
        assert len(replica.cluster.stops) == 3
        assert len(set(replica.cluster.stops)) == 1

    play(scene, "a")


def test_a_stop_that_overtakes_its_task_counts() -> None:
    async def scene(replica: Replica) -> None:
        replica.cluster.slow_tasks = 1.0
        asking = replica.ask()
        await asyncio.sleep(0.1)
        asking.cancel()
        await asyncio.sleep(3)

        assert replica.begun == {"a": 0}

    play(scene, "a")


def test_a_dead_host_is_replaced_once() -> None:
    async def scene(replica: Replica) -> None:
        asking = replica.ask()
        await asyncio.sleep(5)
        replica.cluster.kill(replica.where())

        result = await asking
        assert result.seconds["compute"] == 8.0
        assert now() < 5 + 8 + 1
        assert replica.begun == {"a": 1, "b": 1}
        assert replica.shares == [0.0, 0.25, 0.5, 0.75], "nothing is told twice"

    play(scene)


def test_a_full_queue_does_not_refuse_what_a_lost_host_had_accepted() -> None:
    async def scene(replica: Replica) -> None:
        asking = replica.ask()
        await asyncio.sleep(5)
        lost = replica.where()
        other = replica.cluster.engines[replica.other()]
        other.is_full = True
        replica.cluster.kill(lost)
        await asking

        assert await code_of(replica.ask()) == "queue_full"
        assert [task.is_promised for task in other.begun] == [True]

    play(scene)


def test_a_second_loss_is_an_error() -> None:
    async def scene(replica: Replica) -> None:
        asking = replica.ask()
        for _ in range(2):
            await asyncio.sleep(2)
            replica.cluster.kill(replica.where())

        assert await code_of(asking) == "worker_died"
        assert sum(replica.begun.values()) == 2

    play(scene, "a", "b", "c")


def test_a_host_that_is_cut_off_is_lost_after_the_silence_and_its_work_ends() -> None:
    async def scene(replica: Replica) -> None:
        asking = replica.ask()
        await asyncio.sleep(1)
        lost = replica.where()
        replica.cluster.engines[lost].seconds = 100.0
        cut = now()
        replica.cluster.cut_off.add(lost)

        while replica.cluster.engines[lost].running and now() < 100:
            await asyncio.sleep(0.1)
            if replica.cluster.engines[replica_other(replica, lost)].running and not lost_at:
                lost_at.append(now())
        assert now() - cut <= LEASE_S + 2 * BEAT_S + 1, "no orphan runs on"
        assert SILENCE_S - 1 <= lost_at[0] - cut <= SILENCE_S + 1
        await asking

    lost_at: list[float] = []
    play(scene)


def replica_other(replica: Replica, name: str) -> str:
    (other,) = replica.cluster.engines.keys() - {name}
    return other


def test_a_host_that_was_cut_off_works_again() -> None:
    async def scene(replica: Replica) -> None:
        replica.cluster.cut_off.add("a")
        await asyncio.sleep(2 * SILENCE_S)
        assert not replica.engine.is_ready
        assert await code_of(replica.ask()) == "engine_unavailable"

        replica.cluster.cut_off.clear()
        await asyncio.sleep(2 * SILENCE_S)
        assert replica.engine.is_ready
        await replica.ask()

    play(scene, "a")


def test_hosts_are_looked_for_again_after_any_failure() -> None:
    class Failing(FakeCluster):
        is_broken = True

        async def hosts(self) -> Collection[str]:
            if self.is_broken:
                raise ValueError("nobody has thought of it")
            return await super().hosts()

    async def main() -> None:
        cluster = Failing("a")
        async with replica_of(cluster) as replica:
            assert not replica.engine.is_ready
            cluster.is_broken = False
            await asyncio.sleep(SILENCE_S)
            assert replica.engine.is_ready

    virtual_time.run(main())


def test_work_of_a_replica_that_is_gone_ends() -> None:
    async def main() -> None:
        cluster = FakeCluster("a")
        async with replica_of(cluster) as replica:
            cluster.engines["a"].seconds = 100.0
            asking = replica.ask()
            await asyncio.sleep(1)
            for background in replica.engine._background:
                background.cancel()  # as if its machine had stopped
            gone = now()
            while cluster.engines["a"].running and now() < 100:
                await asyncio.sleep(0.1)
            assert now() - gone <= LEASE_S + 2 * BEAT_S
            asking.cancel()

    virtual_time.run(main())


def test_a_worker_that_died_is_not_replaced() -> None:
    async def scene(replica: Replica) -> None:
        for engine in replica.cluster.engines.values():
            engine.refusal = problem("worker_died", "the worker process of this request died")

        asking = replica.ask()
        assert await code_of(asking) == "worker_died"
        assert replica.begun == {"a": 0, "b": 0}

    play(scene)


@pytest.mark.parametrize("code", ["queue_full", "draining", "engine_unavailable"])
def test_another_host_takes_what_one_refuses(code: str) -> None:
    async def scene(replica: Replica) -> None:
        await replica.ask()
        favourite = max(replica.begun, key=lambda name: replica.begun[name])
        replica.cluster.engines[favourite].refusal = problem(code, "not here")
        await replica.ask()
        assert replica.begun == {"a": 1, "b": 1}

        for engine in replica.cluster.engines.values():
            engine.refusal = problem(code, "not here")
        assert await code_of(replica.ask()) == code

    play(scene)


def test_a_draining_host_gets_no_more_work_and_ends_what_it_has() -> None:
    async def scene(replica: Replica) -> None:
        asking = replica.ask()
        await asyncio.sleep(1)
        name, other = replica.where(), replica.other()
        drained = asyncio.create_task(replica.cluster.machines[name].drain())
        await asyncio.sleep(1)
        await replica.ask()
        await asking
        await drained
        assert replica.begun == {name: 1, other: 1}

    play(scene)


def test_promised_work_waits_for_a_host() -> None:
    async def scene(replica: Replica) -> None:
        replica.cluster.kill("a")
        await asyncio.sleep(1)
        assert await code_of(replica.ask()) == "engine_unavailable"
        asking = replica.ask(PROMISED)
        await asyncio.sleep(30)
        replica.cluster.dead.clear()
        await asking

    play(scene, "a")


def test_a_mesh_is_written_elsewhere_the_second_time() -> None:
    """The host that is lost may still write, if it was only cut off."""
    folder = SETTINGS.store / "tmp/x/mesh"
    upload = Task(StoreMesh(MeshFromSample("knot", 100, "none"), folder), "alice")

    async def scene(replica: Replica) -> None:
        asking = replica.ask(upload)
        await asyncio.sleep(1)
        replica.cluster.kill(replica.where())
        await asking
        works = [task.work for engine in replica.cluster.engines.values() for task in engine.begun]
        folders = {work.folder for work in works if isinstance(work, StoreMesh)}
        assert folders == {folder, folder.with_name("mesh-2")}

    play(scene)


@pytest.mark.parametrize(
    ("claim", "remedy"),
    [
        ({"code": "0.0+old"}, "install the same release"),
        ({"store": "another one"}, "the same GEODESIC_STORE"),
    ],
)
def test_a_host_that_does_not_fit_is_not_used_and_named_once(
    claim: dict[str, str], remedy: str
) -> None:
    async def main() -> None:
        cluster = FakeCluster("a")
        cluster.claim = claim
        with capture_logs() as lines:
            async with replica_of(cluster) as replica:
                await asyncio.sleep(5)
                assert not replica.engine.is_ready
                assert await code_of(replica.ask()) == "engine_unavailable"
        errors = [line for line in lines if line["log_level"] == "error"]
        assert len(errors) == 1
        (claimed,) = claim.values()
        assert claimed in errors[0]["error"]
        assert remedy in errors[0]["error"]

    virtual_time.run(main())


def test_a_full_cluster_refuses_jobs() -> None:
    async def scene(replica: Replica) -> None:
        replica.engine.refuse_when_full("alice")
        asking = [replica.ask(task) for task in different(2 * (1 + SETTINGS.queue_size))]
        await asyncio.sleep(1)
        with pytest.raises(ProblemError) as caught:
            replica.engine.refuse_when_full("alice")
        assert caught.value.problem.code == "queue_full"
        await asyncio.gather(*asking)
        replica.engine.drain()
        with pytest.raises(ProblemError, match="about to stop"):
            replica.engine.refuse_when_full("alice")
        assert await code_of(replica.ask()) == "draining"

    play(scene)


def test_the_load_is_that_of_all_hosts() -> None:
    async def scene(replica: Replica) -> None:
        asking = [replica.ask(task) for task in different(3)]
        await asyncio.sleep(1)
        load = replica.engine.load
        assert (load.busy, load.waiting, load.idle) == (2, 1, 2)
        assert load.evictions == {"fields": 2}
        assert not load.pids
        await asyncio.gather(*asking)

    play(scene)


def test_seconds_of_work_that_began_before_its_replica_asked_are_not_negative() -> None:
    """It joined what another replica had asked for, which had waited in the queue for long."""

    async def scene(replica: Replica) -> None:
        seconds: list[float] = []
        replica.engine.on_wait = seconds.append
        replica.engine.on_work = lambda _client, each: seconds.append(each)
        for engine in replica.cluster.engines.values():
            engine.queue_s = 3600.0

        await replica.ask()
        assert len(seconds) == 2
        assert min(seconds) >= 0.0
        assert max(seconds) < 3600.0

    play(scene)


def test_seconds_are_reported_whatever_the_end() -> None:
    async def scene(replica: Replica) -> None:
        waits: list[float] = []
        work: list[str] = []
        replica.engine.on_wait = waits.append
        replica.engine.on_work = lambda client, _seconds: work.append(client)
        await replica.ask()
        asking = replica.ask()
        await asyncio.sleep(1)
        asking.cancel()
        await asyncio.wait({asking})
        assert (len(waits), work) == (2, ["alice", "alice"])

    play(scene)


@pytest.mark.parametrize("ahead_s", [-3600.0, 0.0, 3600.0])
def test_spans_name_the_host_and_lie_within_its_work_whatever_its_clock(
    ahead_s: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    spans: dict[str, tuple[Period, dict[str, Period], dict[str, Any]]] = {}

    def note(name: str, period: Period, parts: Any = None, **more: Any) -> None:
        spans[name] = period, parts or {}, more["attributes"]

    async def scene(replica: Replica) -> None:
        begin = time_ns() + round(ahead_s * 1e9)
        phases = {
            "load": Period(begin, begin + 2000),
            "compute": Period(begin + 2000, begin + 7000),
        }
        for engine in replica.cluster.engines.values():
            engine.periods = phases
        await replica.ask()
        (host,) = (name for name, begun in replica.begun.items() if begun)

        assert list(spans) == ["queue", "worker"]
        assert {attributes["host.id"] for _, _, attributes in spans.values()} == {host}
        assert spans["queue"][0].end == spans["worker"][0].start
        whole, parts, _ = spans["worker"]
        assert whole.start <= parts["load"].start
        assert parts["compute"].end <= whole.end
        assert parts["load"].end == parts["compute"].start
        lengths = {name: part.end - part.start for name, part in parts.items()}
        assert lengths == {"load": 2000, "compute": 5000}

    monkeypatch.setattr("app.engine.distributed.record_span", note)
    play(scene)


EVENTS = st.lists(
    st.tuples(
        st.floats(0, 20), st.sampled_from(["kill", "cut off", "join again"]), st.sampled_from("abc")
    ),
    max_size=6,
)


@given(EVENTS, st.lists(st.floats(0, 20), min_size=1, max_size=5))
def test_each_task_ends_and_none_is_begun_more_than_twice(
    events: list[Any], starts: list[float]
) -> None:
    async def scene(replica: Replica) -> None:
        begin = now()
        cluster = replica.cluster

        async def disturb(at: float, event: str, name: str) -> None:
            await asyncio.sleep(at)
            match event:
                case "kill":
                    cluster.kill(name)
                case "cut off":
                    cluster.cut_off.add(name)
                case _:
                    cluster.cut_off.discard(name)

        async def ask(at: float, number: int) -> str:
            await asyncio.sleep(at)
            task = replace(WORK, client=f"client {number}")
            try:
                await replica.engine.run(task, lambda _share: None)
            except ProblemError as error:
                return error.problem.code
            return "done"

        disturbing = [asyncio.create_task(disturb(*event)) for event in events]
        ends = await asyncio.gather(*(ask(at, number) for number, at in enumerate(starts)))

        assert set(ends) <= {"done", "worker_died", "engine_unavailable"}
        assert now() - begin <= 20 + 2 * (8 + LEASE_S) + 2
        for number in range(len(starts)):
            times = sum(
                task.client == f"client {number}"
                for engine in cluster.engines.values()
                for task in engine.begun
            )
            assert times <= 2
        await asyncio.gather(*disturbing)

    play(scene, "a", "b", "c")
