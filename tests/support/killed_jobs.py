"""A service that is killed at each step of its jobs, and started again: ``python killed_jobs.py``.

Each service is a process forked from this one, which has loaded kernels and has no threads. It does
the work of its workers itself, so that the steps come in one order. It ends with an error where
something is lost, left behind, or answered otherwise.
"""

import asyncio
import gc
import shutil
import signal
import sqlite3
import sys
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager, closing
from io import BytesIO
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import orjson

import geodesic_core
from app.access import Caller
from app.encoding import JSON, NPY, OCTETS, Representation
from app.engine import worker
from app.jobs import Job, read_jobs
from app.queries import DistancesQuery, MeshSize, code_version, field_cache
from app.schemas.requests import DistancesRequest
from app.service.maintenance import inspect, jobs_of, leftovers
from app.service.request_context import RequestContext
from app.service.service import Service
from app.settings import Settings
from app.state import Database
from tests.support.direct_engine import DirectEngine
from tests.support.killing import Killer, in_child
from tests.support.service import store_mesh
from tests.support.workers import new_worker

MESH = geodesic_core.samples.plane(50)
SIZE = MeshSize(len(MESH.vertices), len(MESH.faces), MESH.report.mean_edge_length)
CONTEXT = RequestContext(Caller("127.0.0.1", has_key=False), 60.0, "a request")
EXPECTED = geodesic_core.exact_distance(MESH, 3).distances
KILLED = -signal.SIGKILL


class Store:
    """A store, and beside it what clients were told, line by line."""

    def __init__(self, root: Path, mesh_id: str) -> None:
        self.root = root
        self.mesh_id = mesh_id
        self.database = Database(root / "jobs.sqlite3")
        self._told = root.with_suffix(".told")
        self._left_running: set[tuple[str, int]] = set()

    def tell(self, job_id: str, what: str) -> None:
        """Note what a client was told of a job, or what it asked."""
        with self._told.open("a") as file:
            file.write(f"{job_id} {what}\n")

    def told(self) -> dict[str, str]:
        """Return the last that was told of each job."""
        if not self._told.exists():
            return {}
        return dict(line.split() for line in self._told.read_text().splitlines())

    def copy(self, root: Path) -> "Store":
        shutil.copytree(self.root, root)
        copied = Store(root, self.mesh_id)
        if self._told.exists():
            shutil.copy(self._told, copied._told)
        return copied

    @asynccontextmanager
    async def service(
        self, before_work: Callable[[], Awaitable[None]] | None = None
    ) -> AsyncIterator[tuple[Service, DirectEngine]]:
        """Run a service; each piece of work waits, by default until its job is recorded as running.

        Jobs that are run again may begin before this yields.
        """
        self._left_running = self.running()
        service = Service(Settings(store=self.root))
        wait = before_work or self.until_running_is_recorded
        engine = DirectEngine(new_worker(self.root), wait)
        service.engine = service.answering.engine = engine
        async with service.running():
            yield service, engine

    async def until_running_is_recorded(self) -> None:
        """Wait until a job runs, and until those that a killed service left are accepted again."""
        while not (running := self.running()) or running & self._left_running:
            await asyncio.sleep(0)

    def running(self) -> set[tuple[str, int]]:
        """Return the jobs that are recorded as running, each with its version."""
        return {
            (job.id, job.version) for job in read_jobs(self.database) if job.status == "running"
        }

    def query(self, media_type: str) -> DistancesQuery:
        query = DistancesQuery.ask(self.mesh_id, SIZE, DistancesRequest(sources=[{"vertex": 3}]))
        return query.answered_as(Representation(media_type))

    async def submit(self, service: Service, media_type: str, key: str | None = None) -> str:
        job = await service.query_jobs.submit(self.query(media_type), CONTEXT, key)
        return job.id


async def end_of(service: Service, job_id: str) -> Job:
    """Return the last state of a job."""
    job = await service.jobs.find(job_id)
    states = [state async for state in service.jobs.watch(job, 0)]
    return states[-1]


async def live(store: Store) -> None:
    """Have jobs accepted, finished, dismissed and deleted, and tell so."""
    async with store.service() as (service, engine):
        for media_type in (JSON, NPY):
            job_id = await store.submit(service, media_type)
            store.tell(job_id, "accepted")
            await end_of(service, job_id)
            store.tell(job_id, "successful")
        store.tell(job_id, "deleting")
        await service.jobs.remove(job_id)
        store.tell(job_id, "deleted")

        has_begun = asyncio.Event()

        async def stay() -> None:
            has_begun.set()
            await asyncio.Event().wait()

        engine.before_work = stay
        job_id = await store.submit(service, OCTETS)  # not the answer that is stored by now
        store.tell(job_id, "accepted")
        await has_begun.wait()
        store.tell(job_id, "deleting")
        await service.jobs.cancel(job_id)
        store.tell(job_id, "dismissed")


async def finish(store: Store) -> None:
    """Let all jobs finish."""
    async with store.service() as (service, _):
        for job_id in await service.jobs._repository.unfinished():
            await end_of(service, job_id)


async def verify(store: Store) -> None:
    """Check that all jobs finish with right answers, that what was told holds, and all files."""
    async with store.service() as (service, _):
        jobs, _more = await service.jobs.page(100, None)
        ends = {job.id: await end_of(service, job.id) for job in jobs}
        for job in ends.values():
            if job.status == "successful":
                await check_answer(service, job)
        for job_id, told in store.told().items():
            check_told(told, ends.get(job_id))
        assert all(job.status in ("successful", "dismissed") for job in ends.values())
        bodies = sum(path.stat().st_size for path in store.root.glob("results/*/*.body"))
        assert service.results.nbytes == bodies, "each file is counted"
    assert [damage for damage in inspect(store.root) if damage is not None] == []
    jobs = jobs_of(store.root, None)
    assert list(leftovers(store.root, code_version(), jobs)) == []
    with closing(sqlite3.connect(store.root / "jobs.sqlite3")) as database:
        assert database.execute("SELECT * FROM queries").fetchall() == []


def check_told(told: str, job: Job | None) -> None:
    match told:
        case "accepted" | "successful":
            assert job is not None
            assert job.status == "successful"
        case "dismissed":
            assert job is not None
            assert job.status == "dismissed"
        case "deleted":
            assert job is None
        case "deleting":
            pass  # done or not


async def check_answer(service: Service, job: Job) -> None:
    """Check an answer to the bit."""
    _, result = await service.jobs.result(job.id)
    body = service.results.body(result).read_bytes()
    service.results.release(result)
    match job.spec.media_type:
        case "application/json":
            assert orjson.loads(body)["distances"] == EXPECTED.tolist()
        case "application/x-npy":
            np.testing.assert_array_equal(np.load(BytesIO(body)), EXPECTED)
        case "application/octet-stream":
            assert body == EXPECTED.tobytes()


async def die_of_a_job(store: Store) -> None:
    """Run whichever of two jobs is first, which kills the service; both are accepted only once."""

    async def die() -> None:
        await store.until_running_is_recorded()
        while len(store.told()) < 2:
            await asyncio.sleep(0)
        signal.raise_signal(signal.SIGKILL)

    async with store.service(die) as (service, _):
        for media_type in (JSON, NPY):
            store.tell(await store.submit(service, media_type, key=media_type), "accepted")
        await asyncio.Event().wait()


async def give_up(store: Store, fatal: str) -> None:
    """Check that the job that ran at three deaths has failed, and that the other one has not."""
    async with store.service() as (service, _):
        media_types = dict(zip(store.told(), (JSON, NPY), strict=True))
        own = media_types.pop(fatal)
        ((other, others),) = media_types.items()
        job = await end_of(service, fatal)
        assert job.status == "failed"
        assert job.problem is not None
        assert job.problem.code == "engine_unavailable"
        assert "while the job ran, 3 times" in job.problem.detail
        assert await store.submit(service, others, key=others) == other
        await check_answer(service, await end_of(service, other))
        assert await store.submit(service, own, key=own) != fatal, "it can be sent again"


def kill_by_a_job(store: Store) -> None:
    """Have two jobs kill the service, until one of them has done so as often as it may."""
    versions: dict[str, list[int]] = {}
    while max(map(len, versions.values()), default=0) < 3:
        assert in_child(lambda: asyncio.run(die_of_a_job(store))) == KILLED
        jobs = read_jobs(store.database)
        assert [job.id for job in jobs] == list(store.told())
        fatal, other = sorted(jobs, key=lambda job: job.status != "running")
        assert (fatal.status, other.status) == ("running", "accepted")
        versions.setdefault(fatal.id, []).append(fatal.version)
    for of_one in versions.values():
        assert all(after > before for before, after in pairwise(of_one))
    assert in_child(lambda: asyncio.run(give_up(store, fatal.id))) == 0


def kill_at_each_step(
    killer: Killer, before: Store, folder: Path, scenario: str, every: int
) -> int:
    """Kill a service at each step of a scenario, one in ``every``; return about how many it has."""
    for step in range(1, 1000, every):
        store = before.copy(folder / f"{scenario}-{step}")

        def run(store: Store = store, step: int = step) -> None:
            killer.arm(store.root, step)
            asyncio.run(SCENARIOS[scenario](store))

        code = in_child(run)
        assert code in (0, KILLED), f"{scenario}, step {step}"
        verified = in_child(lambda store=store: asyncio.run(verify(store)))
        assert verified == 0, f"{scenario}, after step {step}: {store.told()}"
        if code == 0:
            return step
    raise AssertionError("it never ends")


SCENARIOS = {"live": live, "finish": finish}


def main(compute: str, every: str) -> None:
    # Answers that took long are written by workers, and so are their fields.
    worker.SMALL_SECONDS = field_cache._WORTH_WRITING_S = {"cheap": 1e9, "dear": 0.0}[compute]
    killer = Killer()
    gc.collect()
    gc.freeze()  # or else each service looks at all objects of this process
    with TemporaryDirectory() as folder:
        root = Path(folder)
        new = Store(root / "new", store_mesh(root / "new", MESH))
        assert in_child(lambda: asyncio.run(finish(new))) == 0  # the first start writes more
        steps = kill_at_each_step(killer, new, root, "live", int(every))
        stopped = new.copy(root / "stopped")
        assert in_child(lambda: asyncio.run(die_of_a_job(stopped))) == KILLED
        more = kill_at_each_step(killer, stopped, root, "finish", int(every))
        kill_by_a_job(new.copy(root / "thrice"))
    sys.stdout.write(f"{steps} {more}\n")


if __name__ == "__main__":
    main(*sys.argv[1:])
