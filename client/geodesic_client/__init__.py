"""A client of the service geodesic: `Client` for threads, `AsyncClient` for coroutines."""

from geodesic_client.answers import (
    Border,
    Boundary,
    Cut,
    Distances,
    ErrorBound,
    Isoline,
    IsolineLevel,
    Isolines,
    Job,
    ListedMesh,
    LocatedPoint,
    LogMap,
    Matrix,
    Mesh,
    Neighbour,
    Path,
    Step,
    StoredMatrix,
    StraightLine,
)
from geodesic_client.async_client import AsyncClient
from geodesic_client.bars import progress_bar
from geodesic_client.client import Client
from geodesic_client.errors import GeodesicClientError, ProblemError, UnreachableError
from geodesic_client.points import curve, edge, face, position, starting_at

__all__ = [
    "AsyncClient",
    "Border",
    "Boundary",
    "Client",
    "Cut",
    "Distances",
    "ErrorBound",
    "GeodesicClientError",
    "Isoline",
    "IsolineLevel",
    "Isolines",
    "Job",
    "ListedMesh",
    "LocatedPoint",
    "LogMap",
    "Matrix",
    "Mesh",
    "Neighbour",
    "Path",
    "ProblemError",
    "Step",
    "StoredMatrix",
    "StraightLine",
    "UnreachableError",
    "curve",
    "edge",
    "face",
    "position",
    "progress_bar",
    "starting_at",
]
