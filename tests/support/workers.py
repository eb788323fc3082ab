"""A worker in this process: it does what a worker process does, one piece of work at a time."""

from itertools import count
from pathlib import Path
from typing import Any

from app.encoding import Representation
from app.engine.signals import Signals
from app.engine.work import Outcome, RunQuery
from app.engine.worker import Worker, WorkerConfig
from app.errors import Problem
from app.queries import DistancesQuery, Query, result_key
from app.schemas.requests import DistancesRequest
from app.settings import Settings
from app.store.results import result_name

numbers = count(1)


def worker_config(store: Path, **settings: Any) -> WorkerConfig:
    return WorkerConfig(Settings(store=store, **settings), store / "results")


def new_worker(store: Path, **settings: Any) -> Worker:
    return Worker(worker_config(store, **settings), Signals())


def distances_query(
    mesh_id: str, *barriers: int, vertex: int = 0, start_distance: float = 0.0, **members: Any
) -> DistancesQuery:
    """Return a query for the distances from a vertex."""
    source = {"vertex": vertex, "start_distance": start_distance}
    return DistancesQuery(
        mesh_id, DistancesRequest(sources=[source], barriers=list(barriers), **members)
    )


def run_query(query: Query[Any], media_type: str = "application/json") -> RunQuery:
    """Return the work of answering a query."""
    query = query.answered_as(Representation(media_type))
    return RunQuery(query, result_name(query.mesh_id, result_key(query)))


def outcome_of(worker: Worker, query: Query[Any], media_type: str = "application/json") -> Outcome:
    """Have a worker answer a query."""
    return worker.do(next(numbers), run_query(query, media_type))


def code_of(worker: Worker, query: Query[Any]) -> str | None:
    """Have a worker answer a query; return the code of the problem, if there is one."""
    outcome = outcome_of(worker, query)
    return outcome.code if isinstance(outcome, Problem) else None
