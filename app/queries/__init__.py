"""What can be asked of a mesh: one module per kind of question, and what all of them share.

A `Query` is a request that has been validated. Its kind says all that is known of it: what is
checked before a worker is asked, the formats it is answered in, how it is answered, and what that
is likely to cost.
"""

from app.queries.base import (
    SMALL_SECONDS,
    ExecutionContext,
    Query,
    code_version,
    fingerprint,
    result_key,
)
from app.queries.distances import DistancesQuery
from app.queries.estimate import Estimate, estimate
from app.queries.field_cache import FieldCache
from app.queries.isolines import IsolinesQuery
from app.queries.locate import LocateQuery
from app.queries.matrix import MatrixQuery
from app.queries.nearest import NearestQuery
from app.queries.path import PathQuery, naming_parameters, written_request
from app.queries.paths import PathsQuery
from app.queries.validation import MeshSize

__all__ = [
    "SMALL_SECONDS",
    "DistancesQuery",
    "Estimate",
    "ExecutionContext",
    "FieldCache",
    "IsolinesQuery",
    "LocateQuery",
    "MatrixQuery",
    "MeshSize",
    "NearestQuery",
    "PathQuery",
    "PathsQuery",
    "Query",
    "code_version",
    "estimate",
    "fingerprint",
    "naming_parameters",
    "result_key",
    "written_request",
]
