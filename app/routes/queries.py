"""Queries on a mesh: one handler for each kind."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any

from fastapi import APIRouter, Depends, Header, Query, Request, Response

from app.dependencies import (
    TimeoutHeader,
    asker_of,
    form_of,
    prefers_async,
    service_of,
    while_connected,
)
from app.encoding import CSV, GEOJSON, JSON, NPY, NPZ, OBJ, OCTETS, PLY, SVG
from app.encoding.form import ARRAYS, TEXTS
from app.queries import (
    DistancesQuery,
    IsolinesQuery,
    LocateQuery,
    MatrixQuery,
    NearestQuery,
    PathQuery,
    PathsQuery,
    naming_parameters,
    result_key,
    written_request,
)
from app.queries import Query as ValidQuery
from app.responses import (
    CACHED,
    ENDS,
    NEGOTIATED,
    OF_FILES,
    UNSTORED,
    accepted_response,
    documented,
    estimate_response,
    etag_of,
    not_modified,
    problems,
    result_response,
)
from app.routes.bodies import QueryRoute, beside_the_loop
from app.schemas import (
    AnswerParameters,
    DistancesAnswer,
    DistancesRequest,
    Estimate,
    IsolinesAnswer,
    IsolinesRequest,
    JobDocument,
    LocateAnswer,
    LocateRequest,
    MatrixAnswer,
    MatrixRequest,
    NearestAnswer,
    NearestRequest,
    PathAnswer,
    PathAnswerParameters,
    PathParameters,
    PathRequest,
    PathsAnswer,
    PathsRequest,
)
from app.service import Asker

router = APIRouter(prefix="/meshes/{mesh_id}", tags=["queries"], route_class=QueryRoute)

_CODES = ("not_acceptable", *ENDS, "range_not_satisfiable")
_BODY_CODES = ("malformed_body", "upload_too_large", "unsupported_media_type", *_CODES)


def _answers(model: type, description: str, *others: str) -> dict[int | str, dict[str, Any]]:
    """Describe an answer in JSON, and in ``others``, which have no room for all of it."""
    description += ". In formats other than JSON the rest comes as `Geodesic-…` headers"
    content = {name: {"schema": _TEXT if name in TEXTS else _BINARY} for name in others}
    described = documented("Vary", "Server-Timing", *OF_FILES)
    accepted = documented("Location", "Preference-Applied", "Cache-Control")
    if any(name in ARRAYS for name in others):
        described |= documented("Geodesic-Dtype", "Geodesic-Shape")
    return {
        200: {
            "model": model | Estimate,
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
            "description": "The range asked for",
            "headers": documented("Vary", "Server-Timing", "Content-Range", *OF_FILES),
        },
    }


_TEXT = {"type": "string"}
_BINARY = {"type": "string", "format": "binary"}
_LINES = OBJ, CSV, SVG, GEOJSON
_PATH = "The path; its points in binary"


def _posted(name: str, summary: str, answers: Mapping[int | str, Any]) -> dict[str, Any]:
    """Return what is said of a query whose points come as JSON."""
    return {
        "operation_id": name,
        "summary": summary,
        "response_class": Response,
        "responses": {**answers, **problems(*_BODY_CODES)},
    }


@dataclass(frozen=True)
class Asked:
    """Of what a query is asked, by whom, and how it is to be answered."""

    mesh_id: str
    request: Request
    asker: Asker
    is_async: bool
    key: str | None

    async def answer(
        self, kind: type[ValidQuery[Any]], body: Any, parameters: AnswerParameters
    ) -> Response:
        """Answer the query of a kind that a body asks, or tell what that would take."""
        request, asker = self.request, self.asker
        service = service_of(request)
        size = service.size(self.mesh_id)

        def ask() -> ValidQuery[Any]:
            query = kind.ask(self.mesh_id, size, body, service.settings)
            query.written  # noqa: B018 - kept by it
            return query

        query = await beside_the_loop(request, ask)
        form = form_of(request, parameters, query.offers)
        if parameters.estimate:
            estimating = service.estimate(query, size, form, asker)
            estimate, seconds = await while_connected(request, estimating)
            return estimate_response(self.mesh_id, estimate, form.media_type, seconds)
        if self.is_async:
            return accepted_response(await service.submit(query, size, form, asker, self.key))
        is_cacheable = request.method == "GET" and query.is_repeatable
        headers = {**NEGOTIATED, **(CACHED if is_cacheable else UNSTORED)}
        if is_cacheable:
            unchanged = not_modified(request, etag_of(result_key(query, form)), headers)
            if unchanged is not None:
                return unchanged
        answering = service.answer(query, size, form, asker, as_file="range" in request.headers)
        answered = await while_connected(request, answering)
        return result_response(request, answered, form.media_type, service.results, headers)


async def get_asked(
    mesh_id: str,
    request: Request,
    prefer: Annotated[
        str | None,
        Header(description="`respond-async`: answer at once with a job, RFC 7240"),
    ] = None,
    idempotency_key: Annotated[
        str | None,
        Header(
            min_length=1,
            max_length=255,
            description="Of a job, freely chosen: what is sent again with it is the same job",
        ),
    ] = None,
    x_timeout_ms: TimeoutHeader = None,
) -> Asked:
    """Return what a request for a query says beside the query."""
    asker = asker_of(request, x_timeout_ms)
    return Asked(mesh_id, request, asker, prefers_async(prefer), idempotency_key)


AskedDep = Annotated[Asked, Depends(get_asked)]
Parameters = Annotated[AnswerParameters, Query()]


@router.post(
    "/distances",
    **_posted(
        "computeDistances",
        "Distances from sources to all vertices, exact or within a chosen error",
        _answers(
            DistancesAnswer,
            "The distances; as PLY the mesh with them at its vertices, for all vertices only",
            NPY,
            OCTETS,
            CSV,
            PLY,
        ),
    ),
)
async def compute_distances(
    body: DistancesRequest, parameters: Parameters, asked: AskedDep
) -> Response:
    """Return the distance along the surface from the nearest source to each vertex."""
    return await asked.answer(DistancesQuery, body, parameters)


@router.post(
    "/path",
    **_posted(
        "computePath",
        "The shortest path between two points, exact or within a chosen error",
        _answers(PathAnswer, _PATH, NPY, OCTETS, *_LINES),
    ),
)
async def compute_path(
    body: PathRequest,
    parameters: Annotated[PathAnswerParameters, Query()],
    asked: AskedDep,
) -> Response:
    """Return the points of the path, from source to target, and the faces it crosses."""
    explain = body.explain or parameters.explain
    return await asked.answer(PathQuery, body.model_copy(update={"explain": explain}), parameters)


@router.get(
    "/path",
    operation_id="getPath",
    summary="The shortest path between two points, cacheable",
    response_class=Response,
    responses={
        **_answers(PathAnswer, _PATH, NPY, OCTETS, *_LINES),
        304: {
            "description": "The answer is the one that is known",
            "headers": documented("ETag", "Cache-Control", "Vary"),
        },
        **problems(*_CODES),
    },
)
async def get_path(parameters: Annotated[PathParameters, Query()], asked: AskedDep) -> Response:
    """Return the same as `POST`, for points written as `v12` or `f7:0.2,0.3,0.5`."""
    with naming_parameters():
        return await asked.answer(PathQuery, written_request(parameters), parameters)


@router.post(
    "/paths",
    **_posted(
        "computePaths",
        "Shortest paths from one point to many, from one solve",
        _answers(PathsAnswer, "The paths, in the order of the targets", *_LINES),
    ),
)
async def compute_paths(body: PathsRequest, parameters: Parameters, asked: AskedDep) -> Response:
    """Return a path to each target, or the reason why there is none."""
    return await asked.answer(PathsQuery, body, parameters)


@router.post(
    "/isolines",
    **_posted(
        "computeIsolines",
        "Lines of equal distance from sources",
        _answers(IsolinesAnswer, "The lines of each level, closed and open", *_LINES),
    ),
)
async def compute_isolines(
    body: IsolinesRequest, parameters: Parameters, asked: AskedDep
) -> Response:
    """Return the polylines of points at each level, exact where they cross edges."""
    return await asked.answer(IsolinesQuery, body, parameters)


@router.post(
    "/matrix",
    **_posted(
        "computeMatrix",
        "Exact distances from many points to many others",
        _answers(
            MatrixAnswer,
            "The distances; a sparse matrix in binary as `scipy.sparse.load_npz` reads it",
            NPY,
            NPZ,
            OCTETS,
            CSV,
        ),
    ),
)
async def compute_matrix(body: MatrixRequest, parameters: Parameters, asked: AskedDep) -> Response:
    """Return a distance for each source and target, or for each pair.

    In binary, a dense matrix and pairs come as npy and octets, a sparse matrix as npz.
    """
    return await asked.answer(MatrixQuery, body, parameters)


@router.post(
    "/nearest",
    **_posted(
        "findNearest",
        "The candidates that are nearest to a point along the surface",
        _answers(NearestAnswer, "The candidates, nearest first", CSV, GEOJSON),
    ),
)
async def find_nearest(body: NearestRequest, parameters: Parameters, asked: AskedDep) -> Response:
    """Return the `k` nearest candidates, or as many as can be reached."""
    return await asked.answer(NearestQuery, body, parameters)


@router.post(
    "/locate",
    **_posted(
        "locatePoints",
        "The points of the surface that are nearest to positions",
        _answers(LocateAnswer, "The points, in the order of the positions", CSV, GEOJSON),
    ),
)
async def locate_points(body: LocateRequest, parameters: Parameters, asked: AskedDep) -> Response:
    """Return the nearest point for each position, `null` where it is farther than `max_distance`.

    A point that is nearer to a vertex or an edge than 1e-12 of the bounding box is on it.
    """
    return await asked.answer(LocateQuery, body, parameters)
