"""Metrics for operators: requests are counted, and the service's state is read when scraped."""

from collections.abc import Iterator, Mapping
from time import perf_counter
from typing import get_args

from prometheus_client import CollectorRegistry, Counter, Histogram, Info
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric
from prometheus_client.exposition import choose_encoder
from prometheus_client.registry import Collector
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app import __version__
from app.schemas.service import JobStatus
from app.service.service import Service

_NONE = "none"
"""Operation of a request that reached none"""
_BUCKETS = (0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1, 2.5, 5, 10, 30, 60, 120)


class Metrics(Collector):
    """The metrics of one service, in a registry of its own."""

    def __init__(self, service: Service) -> None:
        self._service = service
        self._jobs: Mapping[str, int] = {}
        self._registry = CollectorRegistry()
        self._requests = Counter(
            "geodesic_requests",
            "Requests that were answered, by operation id and status",
            ["operation", "status"],
            registry=self._registry,
        )
        self._seconds = Histogram(
            "geodesic_request_seconds",
            "From the head of a request to the end of its answer",
            ["operation"],
            buckets=_BUCKETS,
            registry=self._registry,
        )
        Info("geodesic_build", "Version of the service", registry=self._registry).info(
            {"version": __version__}
        )
        self._registry.register(self)

    def note(self, operation: str, status: int, seconds: float) -> None:
        """Count a request, and its seconds."""
        self._requests.labels(operation, str(status)).inc()
        self._seconds.labels(operation).observe(seconds)

    async def exposition(self, accept: str) -> tuple[bytes, str]:
        """Return all metrics in the text format that ``accept`` asks for, and its media type."""
        self._jobs = await self._service.jobs.count()
        write, media_type = choose_encoder(accept)
        return write(self._registry), media_type

    def describe(self) -> Iterator[Metric]:
        """Yield nothing: names are distinct, and a service that has not started has no state."""
        return iter(())

    def collect(self) -> Iterator[Metric]:
        """Yield the state of the service."""
        service, load = self._service, self._service.engine.load
        catalog = service.mesh_catalog
        yield _gauge("geodesic_queue_length", "Requests that wait for a worker", load.waiting)
        workers = {"idle": load.idle, "busy": load.busy, "missing": load.missing}
        yield _gauges("geodesic_workers", "Slots for worker processes", "state", workers)
        yield _counter("geodesic_workers_lost", "Workers that died or were killed", load.lost)
        stopped = "Tasks stopped while they ran: by hang-up, deadline, or dismissal of a job"
        yield _counter("geodesic_cancellations", stopped, load.cancelled)
        lookups = "Lookups of answers in the store"
        yield _counters("geodesic_results_lookups", lookups, "outcome", service.lookups)
        answered, took = "Queries that workers answered", "Seconds that solving them took"
        yield _counters("geodesic_solves", answered, "kind", service.solves)
        yield _counters("geodesic_solve_seconds", took, "kind", service.solve_seconds)
        files = service.results.nbytes
        yield _gauge("geodesic_results_bytes", "Size of the stored answers that are files", files)
        yield _gauge("geodesic_meshes", "Meshes in the store", len(catalog.ids))
        yield _gauge("geodesic_meshes_bytes", "Size of the meshes in the store", catalog.total)
        jobs = {status: self._jobs.get(status, 0) for status in get_args(JobStatus)}
        yield _gauges("geodesic_jobs", "Jobs that have not been removed", "status", jobs)


class MetricsMiddleware:
    """Middleware that counts requests, and measures their time."""

    def __init__(self, app: ASGIApp, metrics: Metrics) -> None:
        self.app = app
        self.metrics = metrics

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        start = perf_counter()
        status = 500

        async def send_noted(message: Message) -> None:
            nonlocal status
            if message["type"] == "http.response.start":
                status = message["status"]
            await send(message)

        try:
            await self.app(scope, receive, send_noted)
        finally:
            operation = getattr(scope.get("route"), "operation_id", None) or _NONE
            self.metrics.note(operation, status, perf_counter() - start)


def _gauge(name: str, meaning: str, value: float) -> Metric:
    return GaugeMetricFamily(name, meaning, value)


def _counter(name: str, meaning: str, value: float) -> Metric:
    return CounterMetricFamily(name, meaning, value)


def _gauges(name: str, meaning: str, label: str, values: Mapping[str, float]) -> Metric:
    family = GaugeMetricFamily(name, meaning, labels=[label])
    for value in values:
        family.add_metric([value], values[value])
    return family


def _counters(name: str, meaning: str, label: str, values: Mapping[str, float]) -> Metric:
    family = CounterMetricFamily(name, meaning, labels=[label])
    for value in values:
        family.add_metric([value], values[value])
    return family
