"""The kinds of queries to a mesh, one module each, and what they share.

A `Query` is a validated request. Its class knows all of its kind: the checks before a worker is
asked, the formats of the answer, how it is computed, and its expected cost.
"""

from collections.abc import Mapping
from typing import Any

from app.queries.base import (
    SMALL_SECONDS,
    ExecutionContext,
    Query,
    code_version,
    fingerprint,
    result_key,
)
from app.queries.borders import BordersQuery
from app.queries.boundaries import BoundariesQuery
from app.queries.cells import CellsQuery
from app.queries.cut import CutQuery
from app.queries.distances import DistancesQuery
from app.queries.field_cache import FieldCache, Unwritten
from app.queries.isolines import IsolinesQuery
from app.queries.locate import LocateQuery
from app.queries.log_map import LogMapQuery
from app.queries.loop import LoopQuery
from app.queries.matrix import MatrixQuery
from app.queries.mean import MeanQuery
from app.queries.nearest import NearestQuery
from app.queries.path import PathQuery, naming_parameters, written_request
from app.queries.paths import PathsQuery
from app.queries.samples import SamplesQuery
from app.queries.steps import StepsQuery
from app.queries.sweep import SweepQuery
from app.queries.trace import TraceQuery
from app.queries.validation import MeshSize, check_lengths

KINDS: Mapping[str, type[Query[Any]]] = {
    kind.kind: kind
    for kind in (
        DistancesQuery,
        PathQuery,
        StepsQuery,
        SweepQuery,
        PathsQuery,
        IsolinesQuery,
        BordersQuery,
        BoundariesQuery,
        CutQuery,
        CellsQuery,
        SamplesQuery,
        MeanQuery,
        LoopQuery,
        MatrixQuery,
        NearestQuery,
        LogMapQuery,
        TraceQuery,
        LocateQuery,
    )
}
"""The kinds of queries, by name."""

__all__ = [
    "KINDS",
    "SMALL_SECONDS",
    "BordersQuery",
    "BoundariesQuery",
    "CellsQuery",
    "CutQuery",
    "DistancesQuery",
    "ExecutionContext",
    "FieldCache",
    "IsolinesQuery",
    "LocateQuery",
    "LogMapQuery",
    "LoopQuery",
    "MatrixQuery",
    "MeanQuery",
    "MeshSize",
    "NearestQuery",
    "PathQuery",
    "PathsQuery",
    "Query",
    "SamplesQuery",
    "StepsQuery",
    "SweepQuery",
    "TraceQuery",
    "Unwritten",
    "check_lengths",
    "code_version",
    "fingerprint",
    "naming_parameters",
    "result_key",
    "written_request",
]
