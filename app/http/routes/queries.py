"""Routes of queries: one handler for each kind."""

from collections.abc import Mapping
from typing import Annotated, Any

from fastapi import APIRouter, Query, Response

from app.encoding import CSV, JSON, NPY, NPZ, OBJ, OCTETS, PLY
from app.encoding.representation import ARRAYS, TEXTS
from app.http.responses import FILE_HEADERS, QUERY_PROBLEMS, documented, problems
from app.http.routes.query_request import AnswerDep
from app.http.routes.query_route import QueryRoute
from app.queries import (
    BordersQuery,
    DistancesQuery,
    IsolinesQuery,
    LocateQuery,
    MatrixQuery,
    NearestQuery,
    PathQuery,
    PathsQuery,
    StepsQuery,
    naming_parameters,
    written_request,
)
from app.schemas.answers import (
    BordersAnswer,
    DistancesAnswer,
    IsolinesAnswer,
    LocateAnswer,
    MatrixAnswer,
    NearestAnswer,
    PathAnswer,
    PathsAnswer,
    StepsAnswer,
)
from app.schemas.requests import (
    AnswerParameters,
    BordersRequest,
    DistancesRequest,
    IsolinesRequest,
    LocateRequest,
    MatrixRequest,
    NearestRequest,
    PathParameters,
    PathRequest,
    PathsRequest,
    StepsRequest,
)
from app.schemas.service import JobDocument

router = APIRouter(prefix="/meshes/{mesh_id}", tags=["queries"], route_class=QueryRoute)

_CODES = (
    "idempotency_key_unused",
    "not_acceptable",
    *QUERY_PROBLEMS,
    "quota_exceeded",
    "range_not_satisfiable",
)
_BODY_CODES = ("malformed_body", "upload_too_large", "unsupported_media_type", *_CODES)


def _answers(model: type, description: str, *others: str) -> dict[int | str, dict[str, Any]]:
    """Return an answer for OpenAPI: in JSON, and in ``others``, which hold only a part of it."""
    description += (
        ". In formats other than JSON the rest comes as `Geodesic-…` headers; `Geodesic-Omitted` "
        "names what is too long for one"
    )
    content = {name: {"schema": _TEXT if name in TEXTS else _BINARY} for name in others}
    described = documented("Vary", "Server-Timing", *FILE_HEADERS)
    accepted = documented("Location", "Preference-Applied", "Cache-Control")
    if any(name in ARRAYS for name in others):
        described |= documented("Geodesic-Dtype", "Geodesic-Shape")
    return {
        200: {
            "model": model,
            "content": content,
            "description": description,
            "headers": described,
        },
        202: {
            "model": JobDocument,
            "description": "With `Prefer: respond-async`: the job",
            "headers": accepted,
        },
        206: {
            "content": {name: {"schema": _BINARY} for name in (JSON, *others)},
            "description": "The requested range",
            "headers": documented("Vary", "Server-Timing", "Content-Range", *FILE_HEADERS),
        },
    }


_TEXT = {"type": "string"}
_BINARY = {"type": "string", "format": "binary"}
_LINES = OBJ, CSV
_PATH = "The path; its points in binary"


def _posted(name: str, summary: str, answers: Mapping[int | str, Any]) -> dict[str, Any]:
    """Return the description of a query whose points come as JSON."""
    return {
        "operation_id": name,
        "summary": summary,
        "response_class": Response,
        "responses": {**answers, **problems(*_BODY_CODES, quota_exceeded=507)},
    }


Parameters = Annotated[AnswerParameters, Query()]


@router.post(
    "/distances",
    **_posted(
        "computeDistances",
        "Distances from sources to all vertices, exact or within a chosen error",
        _answers(
            DistancesAnswer,
            "The distances; as PLY, the mesh with the distances at its vertices, for all vertices "
            "only",
            NPY,
            OCTETS,
            CSV,
            PLY,
        ),
    ),
)
async def compute_distances(
    body: DistancesRequest, parameters: Parameters, answer: AnswerDep
) -> Response:
    """Return the distance along the surface from the nearest source to each vertex."""
    return await answer(DistancesQuery, body, parameters)


@router.post(
    "/path",
    **_posted(
        "computePath",
        "The shortest path between two points, exact or within a chosen error",
        _answers(PathAnswer, _PATH, NPY, OCTETS, *_LINES),
    ),
)
async def compute_path(body: PathRequest, parameters: Parameters, answer: AnswerDep) -> Response:
    """Return the points of the path, from source to target, and the faces it crosses."""
    return await answer(PathQuery, body, parameters)


@router.get(
    "/path",
    operation_id="getPath",
    summary="The shortest path between two points, as a link",
    response_class=Response,
    responses={
        **_answers(PathAnswer, _PATH, NPY, OCTETS, *_LINES),
        304: {
            "description": "The answer has not changed",
            "headers": documented("ETag", "Cache-Control", "Vary"),
        },
        **problems(*_CODES, quota_exceeded=507),
    },
)
async def get_path(parameters: Annotated[PathParameters, Query()], answer: AnswerDep) -> Response:
    """Return the same as `POST`, for points written as `12`, `v12` or `f7:0.2,0.3,0.5`."""
    with naming_parameters():
        body = written_request(parameters)
        return await answer(PathQuery, body, AnswerParameters(format=parameters.format))


@router.post(
    "/path/steps",
    **_posted(
        "computePathSteps",
        "The steps of the search for a path",
        _answers(StepsAnswer, "The steps, in order"),
    ),
)
async def compute_path_steps(
    body: StepsRequest, parameters: Parameters, answer: AnswerDep
) -> Response:
    """Return what the search does to find the exact path: the faces that each step visits."""
    return await answer(StepsQuery, body, parameters)


@router.post(
    "/paths",
    **_posted(
        "computePaths",
        "Shortest paths from one point to many, from one solve",
        _answers(PathsAnswer, "The paths, in the order of the targets", *_LINES),
    ),
)
async def compute_paths(body: PathsRequest, parameters: Parameters, answer: AnswerDep) -> Response:
    """Return a path to each target, or the reason why there is none."""
    return await answer(PathsQuery, body, parameters)


@router.post(
    "/isolines",
    **_posted(
        "computeIsolines",
        "Lines of equal distance from sources",
        _answers(IsolinesAnswer, "The lines of each level, closed and open", *_LINES),
    ),
)
async def compute_isolines(
    body: IsolinesRequest, parameters: Parameters, answer: AnswerDep
) -> Response:
    """Return the polylines of points at each level, exact where they cross edges."""
    return await answer(IsolinesQuery, body, parameters)


@router.post(
    "/borders",
    **_posted(
        "computeBorders",
        "Borders between the territories of sources",
        _answers(BordersAnswer, "The lines, closed and open", *_LINES),
    ),
)
async def compute_borders(
    body: BordersRequest, parameters: Parameters, answer: AnswerDep
) -> Response:
    """Return polylines of points that are equally near to two sources, and no nearer to a third.

    They are exact where they cross edges and where they meet.
    """
    return await answer(BordersQuery, body, parameters)


@router.post(
    "/matrix",
    **_posted(
        "computeMatrix",
        "Exact distances from many points to many others",
        _answers(
            MatrixAnswer,
            "The distances; in binary, a sparse matrix has the format that `scipy.sparse.load_npz` "
            "reads",
            NPY,
            NPZ,
            OCTETS,
            CSV,
        ),
    ),
)
async def compute_matrix(
    body: MatrixRequest, parameters: Parameters, answer: AnswerDep
) -> Response:
    """Return a distance for each source and target, or for each pair.

    In binary, a dense matrix and pairs come as npy and octets, a sparse matrix as npz. As a job, a
    dense matrix in npy may be as large as the store has room for; its rows are read in ranges.
    """
    return await answer(MatrixQuery, body, parameters)


@router.post(
    "/nearest",
    **_posted(
        "findNearest",
        "The candidates that are nearest to a point along the surface",
        _answers(NearestAnswer, "The candidates, nearest first", CSV),
    ),
)
async def find_nearest(body: NearestRequest, parameters: Parameters, answer: AnswerDep) -> Response:
    """Return the `k` nearest candidates, or fewer if fewer can be reached."""
    return await answer(NearestQuery, body, parameters)


@router.post(
    "/locate",
    **_posted(
        "locatePoints",
        "The points of the surface that are nearest to positions",
        _answers(LocateAnswer, "The points, in the order of the positions", CSV),
    ),
)
async def locate_points(body: LocateRequest, parameters: Parameters, answer: AnswerDep) -> Response:
    """Return the nearest point for each position, `null` where it is farther than `max_distance`.

    A point counts as on a vertex or an edge if it is within 1e-12 of the bounding box from it.
    """
    return await answer(LocateQuery, body, parameters)
