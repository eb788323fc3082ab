"""Queries on a mesh: distances, paths, and where positions are on it."""

from typing import Annotated, Any

from fastapi import APIRouter, Depends, Query, Request, Response

from app.dependencies import (
    Deadline,
    ServiceDep,
    media_type_of,
    require_json,
    while_connected,
)
from app.encoding import JSON, NPY, OCTETS
from app.queries import Query as ValidQuery
from app.queries import (
    distances_query,
    locate_query,
    naming_parameters,
    path_query,
    result_key,
    written_request,
)
from app.responses import CACHED, ResultResponse, etag_of, not_modified, problems
from app.schemas import (
    AnswerParameters,
    DistancesAnswer,
    DistancesRequest,
    LocateAnswer,
    LocateRequest,
    PathAnswer,
    PathAnswerParameters,
    PathParameters,
    PathRequest,
)
from app.service import Service

router = APIRouter(prefix="/meshes/{mesh_id}", tags=["queries"])

_BINARY = {"schema": {"type": "string", "format": "binary"}}
_CODES = (
    "mesh_not_found",
    "not_acceptable",
    "result_too_large",
    "invalid_request",
    "invalid_point",
    "limit_exceeded",
    "memory_limit",
    "worker_died",
    "mesh_damaged",
    "queue_full",
    "engine_unavailable",
    "deadline_exceeded",
    "storage_full",
)
_PROBLEMS = problems(*_CODES)
_BODY_PROBLEMS = problems("malformed_body", "upload_too_large", "unsupported_media_type", *_CODES)
_UNSTORED = {"Cache-Control": "no-store"}


def _answers(model: type, array: str) -> dict[int | str, dict[str, Any]]:
    binary = {NPY: _BINARY, OCTETS: _BINARY}
    description = f"The answer; in binary the {array}, the rest as `Geodesic-…` headers"
    return {200: {"model": model, "content": binary, "description": description}}


@router.post(
    "/distances",
    operation_id="computeDistances",
    summary="Distances from sources to all vertices, exact or within a chosen error",
    response_class=Response,
    responses={**_answers(DistancesAnswer, "distances"), **_BODY_PROBLEMS},
    dependencies=[Depends(require_json)],
)
async def compute_distances(
    mesh_id: str,
    body: DistancesRequest,
    parameters: Annotated[AnswerParameters, Query()],
    request: Request,
    service: ServiceDep,
    deadline: Deadline,
) -> Response:
    """Return the distance along the surface from the nearest source to each vertex."""
    query = distances_query(mesh_id, service.size(mesh_id), body, service.settings)
    media_type = media_type_of(request, parameters.format)
    return await _respond(service, request, query, media_type, deadline)


@router.post(
    "/path",
    operation_id="computePath",
    summary="The shortest path between two points, exact or within a chosen error",
    response_class=Response,
    responses={**_answers(PathAnswer, "points"), **_BODY_PROBLEMS},
    dependencies=[Depends(require_json)],
)
async def compute_path(
    mesh_id: str,
    body: PathRequest,
    parameters: Annotated[PathAnswerParameters, Query()],
    request: Request,
    service: ServiceDep,
    deadline: Deadline,
) -> Response:
    """Return the points of the path, from source to target, and the faces it crosses."""
    query = path_query(mesh_id, service.size(mesh_id), body, parameters, service.settings)
    media_type = media_type_of(request, parameters.format)
    return await _respond(service, request, query, media_type, deadline)


@router.get(
    "/path",
    operation_id="getPath",
    summary="The shortest path between two points, cacheable",
    response_class=Response,
    responses={**_answers(PathAnswer, "points"), **_PROBLEMS},
)
async def get_path(
    mesh_id: str,
    parameters: Annotated[PathParameters, Query()],
    request: Request,
    service: ServiceDep,
    deadline: Deadline,
) -> Response:
    """Return the same as `POST`, for points written as `v12` or `f7:0.2,0.3,0.5`."""
    with naming_parameters():
        body = written_request(parameters)
        query = path_query(mesh_id, service.size(mesh_id), body, parameters, service.settings)
        media_type = media_type_of(request, parameters.format)
        unchanged = not_modified(request, etag_of(result_key(query, media_type)), CACHED)
        return unchanged or await _respond(service, request, query, media_type, deadline)


@router.post(
    "/locate",
    operation_id="locatePoints",
    summary="The points of the surface that are nearest to positions",
    response_class=Response,
    responses={
        200: {"model": LocateAnswer, "description": "The points, in the order of the positions"},
        **_BODY_PROBLEMS,
    },
    dependencies=[Depends(require_json)],
)
async def locate_points(
    mesh_id: str,
    body: LocateRequest,
    parameters: Annotated[AnswerParameters, Query()],
    request: Request,
    service: ServiceDep,
    deadline: Deadline,
) -> Response:
    """Return the nearest point for each position, `null` where it is farther than `max_distance`.

    A point that is nearer to a vertex or an edge than 1e-12 of the bounding box is on it.
    """
    media_type = media_type_of(request, parameters.format, [JSON])
    query = locate_query(mesh_id, body)
    return await _respond(service, request, query, media_type, deadline)


async def _respond(
    service: Service, request: Request, query: ValidQuery, media_type: str, deadline: float
) -> Response:
    answering = service.answer(query, media_type, deadline)
    answered = await while_connected(request, answering)
    is_cacheable = request.method == "GET" and query.is_repeatable
    headers = CACHED if is_cacheable else _UNSTORED
    return ResultResponse(answered, media_type, service.results, headers)
