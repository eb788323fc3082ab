"""Spans of a request: its wait in the queue, and the work of a worker.

FastAPI makes the span of a request itself. The spans below it are recorded when they are over, and
by the API process: a worker that is killed could not send its own. Without a span to belong to,
nothing is recorded.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from opentelemetry import trace
from opentelemetry.trace import StatusCode

_TRACER = trace.get_tracer("geodesic")


@dataclass(frozen=True)
class Period:
    """A period of time, in nanoseconds of the system's clock (``time_ns``)."""

    start: int
    end: int


def trace_fields() -> dict[str, str]:
    """Return the id of the present trace, as a field of log lines; nothing without one."""
    context = trace.get_current_span().get_span_context()
    return {"trace_id": trace.format_trace_id(context.trace_id)} if context.is_valid else {}


def record_span(
    name: str,
    period: Period,
    parts: Mapping[str, Period] | None = None,
    *,
    failed: bool = False,
    attributes: Mapping[str, int | str] = {},
) -> None:
    """Record a span below the present one, and a span below it for each of its ``parts``."""
    if not trace.get_current_span().get_span_context().is_valid:
        return  # of a job the span of its request has ended: it is valid, but not recording
    span = _TRACER.start_span(name, start_time=period.start, attributes=attributes)
    if failed:
        span.set_status(StatusCode.ERROR)
    inside = trace.set_span_in_context(span)
    for part, part_period in (parts or {}).items():
        child = _TRACER.start_span(part, inside, start_time=part_period.start)
        child.end(part_period.end)
    span.end(period.end)
