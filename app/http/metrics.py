"""Metrics for operators: events are counted, and the service's state is read when scraped."""

from collections.abc import Iterator, Mapping
from contextlib import suppress
from functools import partial
from typing import get_args

from anyio import to_thread
from prometheus_client import CollectorRegistry, Counter, Histogram, Info
from prometheus_client.core import CounterMetricFamily as Count
from prometheus_client.core import GaugeMetricFamily as Gauge
from prometheus_client.core import Metric
from prometheus_client.exposition import choose_encoder
from prometheus_client.registry import Collector

from app import __version__
from app.access import Caller
from app.schemas.service import JobStatus
from app.service.resources import Resources, measure
from app.service.service import Service

_BUCKETS = (0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1, 2.5, 5, 10, 30, 60, 120)
_LAG_BUCKETS = _BUCKETS[: _BUCKETS.index(5) + 1]


class Metrics(Collector):
    """The metrics of one service, in a registry of its own."""

    def __init__(self, service: Service) -> None:
        self._service = service
        self._jobs: Mapping[str, int] = {}
        self._resources: Resources | None = None
        self._registry = registry = CollectorRegistry()
        counter = partial(Counter, registry=registry)
        histogram = partial(Histogram, buckets=_BUCKETS, registry=registry)
        answered = "Requests that were answered, by operation id and status"
        self._requests = counter("geodesic_requests", answered, ["operation", "status"])
        took = "From the head of a request to the end of its answer"
        self._seconds = histogram("geodesic_request_seconds", took, ["operation"])
        late = "How much later than asked for the event loop wakes a coroutine"
        self._lag = histogram("geodesic_event_loop_lag_seconds", late, buckets=_LAG_BUCKETS)
        waited = "Wait of a request or job for a worker, until it has one or gives up"
        service.engine.on_wait = histogram("geodesic_queue_wait_seconds", waited).observe
        of_key = "Requests that were answered, by the name of the API key"
        self._caller_requests = counter("geodesic_caller_requests", of_key, ["caller"])
        worked = "Seconds that workers were busy with requests and jobs, by the name of the API key"
        self._caller_seconds = counter("geodesic_caller_worker_seconds", worked, ["caller"])
        self._callers = {key.name for key in service.settings.api_keys}
        for name in self._callers:  # from 0 on: Prometheus sees no growth in a first value
            self._caller_requests.labels(name)
            self._caller_seconds.labels(name)
        service.engine.on_work = self._note_work
        build = Info("geodesic_build", "Version of the service", registry=registry)
        build.info({"version": __version__})
        registry.register(self)

    def note(self, operation: str, status: int, seconds: float, caller: Caller) -> None:
        """Count a request, and its seconds."""
        self._requests.labels(operation, str(status)).inc()
        self._seconds.labels(operation).observe(seconds)
        if caller.has_key:
            self._caller_requests.labels(caller.name).inc()

    def note_lag(self, seconds: float) -> None:
        """Count a measurement of the event loop's lag."""
        self._lag.observe(seconds)

    def _note_work(self, client: str, seconds: float) -> None:
        if client in self._callers:  # without keys, clients are addresses: any number of them
            self._caller_seconds.labels(client).inc(seconds)

    async def exposition(self, accept: str) -> tuple[bytes, str]:
        """Return all metrics in the text format that ``accept`` asks for, and its media type."""
        service = self._service
        with suppress(OSError):  # the last counts stay while the database is away
            self._jobs = await service.jobs.count()
        pids, store = service.engine.load.pids, service.settings.folder
        self._resources = await to_thread.run_sync(measure, pids, store)
        write, media_type = choose_encoder(accept)
        return write(self._registry), media_type

    def describe(self) -> Iterator[Metric]:
        """Yield nothing: names are distinct, and a service that has not started has no state."""
        return iter(())

    def collect(self) -> Iterator[Metric]:
        """Yield the state of the service."""
        service, load = self._service, self._service.engine.load
        catalog = service.mesh_catalog
        yield Gauge("geodesic_queue_length", "Requests that wait for a worker", load.waiting)
        workers = {"idle": load.idle, "busy": load.busy, "missing": load.missing}
        yield _gauges("geodesic_workers", "Slots for worker processes", "state", workers)
        yield Count("geodesic_workers_lost", "Workers that died or were killed", load.lost)
        stopped = "Tasks stopped while they ran: by hang-up, deadline, or the end of its job"
        yield Count("geodesic_cancellations", stopped, load.cancelled)
        lookups = "Lookups of answers in the store"
        yield _counters("geodesic_results_lookups", lookups, "outcome", service.answering.lookups)
        answered, took = "Queries that workers answered", "Seconds that solving them took"
        yield _counters("geodesic_solves", answered, "kind", service.answering.solves)
        yield _counters("geodesic_solve_seconds", took, "kind", service.answering.solve_seconds)
        files = service.results.nbytes
        yield Gauge("geodesic_results_bytes", "Size of the stored answers that are files", files)
        yield Gauge("geodesic_meshes", "Meshes in the store", len(catalog.ids))
        yield Gauge("geodesic_meshes_bytes", "Size of the meshes in the store", catalog.total)
        jobs = {status: self._jobs.get(status, 0) for status in get_args(JobStatus)}
        yield _gauges("geodesic_jobs", "Jobs that have not been removed", "status", jobs)
        evictions = {
            "meshes": catalog.evictions,
            "results": service.results.evictions,
            "results_memory": service.results.memory_evictions,
            **load.evictions,
        }
        evicted = "What was removed to make room, by store or cache"
        yield _counters("geodesic_evictions", evicted, "cache", evictions)
        if self._resources is not None:
            yield from _of_resources(self._resources)


def _of_resources(resources: Resources) -> Iterator[Metric]:
    resident = "Resident memory, by kind of process; shared pages count in each"
    yield _gauges("geodesic_resident_memory_bytes", resident, "process", resources.memory)
    is_open, most = "Open file descriptors of the API process", "Most descriptors it may have"
    yield Gauge("geodesic_open_fds", is_open, resources.open_fds)
    yield Gauge("geodesic_max_fds", most, resources.max_fds)
    free = "Bytes that can still be written to the disk of the store"
    yield Gauge("geodesic_store_free_bytes", free, resources.free_bytes)


def _family(
    kind: type[Count | Gauge],
    name: str,
    meaning: str,
    label: str,
    values: Mapping[str, float],
) -> Metric:
    family = kind(name, meaning, labels=[label])
    for value in values:
        family.add_metric([value], values[value])
    return family


_gauges = partial(_family, Gauge)
_counters = partial(_family, Count)
