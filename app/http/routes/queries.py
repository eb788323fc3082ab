"""Routes of queries: one for each kind, made from a table."""

from collections.abc import Awaitable, Callable, Sequence
from typing import Annotated, Any, NamedTuple

from fastapi import APIRouter, Query, Request, Response
from pydantic import BaseModel

from app import queries
from app.encoding import CSV, JSON, NPY, NPZ, OBJ, OCTETS, PLY
from app.encoding.representation import ARRAYS, TEXTS
from app.http.query_form import REQUEST
from app.http.responses import FILE_HEADERS, QUERY_PROBLEMS, documented, problems
from app.http.routes.query_route import FORM, QueryHeaders, QueryRoute, answer
from app.queries import naming_parameters, written_request
from app.schemas import answers
from app.schemas.requests import AnswerParameters, PathParameters
from app.schemas.service import JobDocument

router = APIRouter(prefix="/meshes/{mesh_id}", tags=["queries"], route_class=QueryRoute)

Parameters = Annotated[AnswerParameters, Query()]

_CODES = (
    "idempotency_key_unused",
    "not_acceptable",
    *QUERY_PROBLEMS,
    "quota_exceeded",
    "range_not_satisfiable",
)
_BODY_CODES = ("malformed_body", "upload_too_large", "unsupported_media_type", *_CODES)
_TEXT = {"type": "string"}
_BINARY = {"type": "string", "format": "binary"}


class Operation(NamedTuple):
    """A kind of query, as the interface document describes it."""

    path: str
    kind: type[queries.Query[Any]]
    answer: type[BaseModel]
    name: str
    summary: str
    description: str
    content: str
    """What the answer is"""
    others: Sequence[str] = ()
    """Media types beside JSON, which hold only a part of the answer"""
    makes_mesh: bool = False
    """Whether the answer names a mesh that is then in the store"""


_LINES = OBJ, CSV
_PATH = Operation(
    "/path",
    queries.PathQuery,
    answers.PathAnswer,
    "computePath",
    "The shortest path between two points, exact or within a chosen error",
    "Return the points of the path, from source to target, and the faces it crosses.",
    "The path; its points in binary",
    (NPY, OCTETS, *_LINES),
)
OPERATIONS = (
    Operation(
        "/distances",
        queries.DistancesQuery,
        answers.DistancesAnswer,
        "computeDistances",
        "Distances from sources to all vertices, exact or within a chosen error",
        "Return the distance along the surface from the nearest source to each vertex.",
        "The distances; as PLY, the mesh with the distances at its vertices, for all vertices "
        "only; with `certify`, as an archive of numpy, what proves them, for `geodesic-verify`",
        (NPY, NPZ, OCTETS, CSV, PLY),
    ),
    _PATH,
    Operation(
        "/path/steps",
        queries.StepsQuery,
        answers.StepsAnswer,
        "computePathSteps",
        "The steps of the search for a path",
        "Return what the search does to find the exact path: the faces that each step visits.",
        "The steps, in order",
    ),
    Operation(
        "/sweep",
        queries.SweepQuery,
        answers.SweepAnswer,
        "followSweep",
        "The windows of an exact sweep, step by step, on a mesh of at most 5000 faces",
        "Return when each window comes, crosses a face and is trimmed, to teach and to draw it.\n\n"
        "The first steps are one operation each: a vertex leaves the queue, or the windows of one "
        "edge cross a face.",
        "The windows, the front, and the counts of each step",
    ),
    Operation(
        "/paths",
        queries.PathsQuery,
        answers.PathsAnswer,
        "computePaths",
        "Shortest paths from one point to many, from one solve",
        "Return a path to each target, or the reason why there is none.",
        "The paths, in the order of the targets",
        _LINES,
    ),
    Operation(
        "/isolines",
        queries.IsolinesQuery,
        answers.IsolinesAnswer,
        "computeIsolines",
        "Lines of equal distance from sources, or of equal values",
        "Return the polylines of points at each level, exact where they cross edges.\n\nThe values "
        "are your own, one for each vertex, and of any sign. What is at a level itself counts as "
        "below it.",
        "The lines of each level, closed and open",
        _LINES,
    ),
    Operation(
        "/borders",
        queries.BordersQuery,
        answers.BordersAnswer,
        "computeBorders",
        "Borders between the territories of sources",
        "Return polylines of points that are equally near to two sources, and no nearer to a "
        "third.\n\nThey are exact where they cross edges and where they meet.",
        "The lines, closed and open",
        _LINES,
    ),
    Operation(
        "/boundaries",
        queries.BoundariesQuery,
        answers.BoundariesAnswer,
        "computeBoundaries",
        "The boundary of the surface, as curves along its edges",
        "Return the curves of edges with one face, longest first, with the surface on their left.",
        "The lines, closed and open",
        _LINES,
    ),
    Operation(
        "/samples",
        queries.SamplesQuery,
        answers.SamplesAnswer,
        "samplePoints",
        "Points spread over the surface, each the farthest from those before",
        "Return points until there are `count` of them or each vertex is within `radius` of "
        "one.\n\nThey are vertices, but for those of `starts`. With `iterations` they then move to "
        "the middle of what is nearest\nto each, and are points in faces.",
        "The points, in the order in which they were added",
        (NPY, OCTETS, CSV),
    ),
    Operation(
        "/cells",
        queries.CellsQuery,
        answers.CellsAnswer,
        "computeCells",
        "Areas, centroids and neighbours of the parts that are nearest to each source",
        "Return what the borders between the territories of sources enclose.\n\nAreas sum to that "
        "of the surface, or of what is within `max_distance`.",
        "The cells, in the order of the sources",
        (CSV,),
    ),
    Operation(
        "/mean",
        queries.MeanQuery,
        answers.MeanAnswer,
        "findMean",
        "The mean of points on the surface",
        "Return the point whose squared distances from some points sum to the least.\n\nIt is "
        "also called their Karcher or Fréchet mean.",
        "The point, and whether no other near it is better",
    ),
    Operation(
        "/loop",
        queries.LoopQuery,
        answers.LoopAnswer,
        "findLoops",
        "Loops that cannot be shrunk to a point, and curves pulled tight",
        "Return the shortest loop `through` a point, of all that do not shrink to a point; or "
        "`curves` pulled tight;\nor, with neither, two loops for each handle of the surface.\n\n"
        "Where every loop shrinks to a point, or a closed curve does, the request is refused.",
        "The lines, closed and open",
        _LINES,
    ),
    Operation(
        "/cut",
        queries.CutQuery,
        answers.CutAnswer,
        "cutMesh",
        "The mesh cut along curves, as a new mesh",
        "Make a mesh of which the curves are edges, and store it like an upload.\n\nThe "
        "`locations` of paths, isolines, borders, boundaries and traces can be curves. Old "
        "vertices keep their\nnumbers; faces that no curve meets stay as they are. The new mesh "
        "has arrays that lead back to the old one,\nand its id is a hash of these, too.",
        "The mesh was in the store already",
        makes_mesh=True,
    ),
    Operation(
        "/matrix",
        queries.MatrixQuery,
        answers.MatrixAnswer,
        "computeMatrix",
        "Exact distances from many points to many others",
        "Return a distance for each source and target, or for each pair.\n\nIn binary, a dense "
        "matrix and pairs come as npy and octets, a sparse matrix as npz. As a job, a\ndense "
        "matrix in npy may be as large as the store has room for; its rows are read in ranges.",
        "The distances; in binary, a sparse matrix has the format that `scipy.sparse.load_npz` "
        "reads",
        (NPY, NPZ, OCTETS, CSV),
    ),
    Operation(
        "/nearest",
        queries.NearestQuery,
        answers.NearestAnswer,
        "findNearest",
        "The candidates that are nearest to a point along the surface",
        "Return the `k` nearest candidates, or fewer if fewer can be reached.",
        "The candidates, nearest first",
        (CSV,),
    ),
    Operation(
        "/log-map",
        queries.LogMapQuery,
        answers.LogMapAnswer,
        "computeLogMap",
        "How far all vertices are from a point, and in which direction: its exact log map",
        "Return the distance of each vertex, the angle at which its shortest path leaves the "
        "source, and its coordinates in\nthe tangent plane.\n\nShortest paths bend at saddles and "
        "at the boundary. All that lies behind the first bend is seen in its\ndirection; `bends` "
        "tells where.",
        "The map. In binary, a row for each vertex: distance, angle, two coordinates, bends (-1 "
        "where unreachable); as PLY, the mesh with these at its vertices",
        (NPY, OCTETS, CSV, PLY),
    ),
    Operation(
        "/trace",
        queries.TraceQuery,
        answers.TraceAnswer,
        "traceLines",
        "Straightest lines from points in directions",
        "Return the lines that go straight on over faces and edges, and at equal angles through "
        "vertices.\n\nThey end at their length, at the boundary, at barriers, and where more than "
        "two faces meet.",
        "The lines. In binary, a row for each point, with the numbers of CSV: line, length, "
        "end_direction, point, x, y, z, face, u, v, w",
        (NPY, OCTETS, *_LINES),
    ),
    Operation(
        "/locate",
        queries.LocateQuery,
        answers.LocateAnswer,
        "locatePoints",
        "The points of the surface that are nearest to positions",
        "Return the nearest point for each position, `null` where it is farther than "
        "`max_distance`.\n\nA point counts as on a vertex or an edge if it is within 1e-12 of the "
        "bounding box from it.",
        "The points, in the order of the positions",
        (CSV,),
    ),
)


def _handler_of(kind: type[queries.Query[Any]]) -> Callable[..., Awaitable[Response]]:
    async def handler(
        mesh_id: str, request: Request, header: QueryHeaders, query: Parameters, body: Any
    ) -> Response:
        return await answer(kind, mesh_id, request, header, query, body)

    handler.__annotations__["body"] = kind.model
    return handler


def _responses(operation: Operation) -> dict[int | str, dict[str, Any]]:
    """Return the answers of an operation, for OpenAPI."""
    others = operation.others
    described = documented("Vary", "Server-Timing", *FILE_HEADERS)
    if any(name in ARRAYS for name in others):
        described |= documented("Geodesic-Dtype", "Geodesic-Shape")
    content = operation.content
    if others:
        content += (
            ". In formats other than JSON the rest comes as `Geodesic-…` headers; "
            "`Geodesic-Omitted` names what is too long for one"
        )
    whole = {"model": operation.answer, "description": content, "headers": described}
    made: dict[int | str, dict[str, Any]] = {}
    if operation.makes_mesh:
        described |= documented("Location")
        made[201] = {**whole, "description": "The mesh is new in the store"}
    return {
        200: {
            **whole,
            "content": {name: {"schema": _TEXT if name in TEXTS else _BINARY} for name in others},
        },
        **made,
        202: {
            "model": JobDocument,
            "description": "With `Prefer: respond-async`: the job",
            "headers": documented("Location", "Preference-Applied", "Cache-Control"),
        },
        206: {
            "content": {name: {"schema": _BINARY} for name in (JSON, *others)},
            "description": "The requested range",
            "headers": documented("Vary", "Server-Timing", "Content-Range", *FILE_HEADERS),
        },
    }


def _also_as_form(operation: Operation) -> dict[str, Any]:
    """Return the further kind of body of a query that may have arrays, for OpenAPI."""
    arrays = operation.kind.model.arrays
    if not arrays:
        return {}
    body = {"$ref": f"#/components/schemas/{operation.kind.model.__name__}"}
    array = {**_BINARY, "description": "A list of numbers in numpy's format (`.npy`)"}
    form = {
        "type": "object",
        "additionalProperties": False,
        "required": [REQUEST],
        "properties": {REQUEST: body, **dict.fromkeys(arrays, array)},
    }
    encoding = {REQUEST: {"contentType": JSON}, **{name: {"contentType": NPY} for name in arrays}}
    return {"requestBody": {"content": {FORM: {"schema": form, "encoding": encoding}}}}


for each in OPERATIONS:
    router.add_api_route(
        each.path,
        _handler_of(each.kind),
        methods=["POST"],
        operation_id=each.name,
        summary=each.summary,
        description=each.description,
        response_class=Response,
        responses={**_responses(each), **problems(*_BODY_CODES, quota_exceeded=507)},
        openapi_extra=_also_as_form(each),
    )


@router.get(
    _PATH.path,
    operation_id="getPath",
    summary="The shortest path between two points, as a link",
    response_class=Response,
    responses={
        **_responses(_PATH),
        304: {
            "description": "The answer has not changed",
            "headers": documented("ETag", "Cache-Control", "Vary"),
        },
        **problems(*_CODES, quota_exceeded=507),
    },
)
async def get_path(
    mesh_id: str, request: Request, header: QueryHeaders, query: Annotated[PathParameters, Query()]
) -> Response:
    """Return the same as `POST`, for points written as `12`, `v12` or `f7:0.2,0.3,0.5`."""
    with naming_parameters():
        body = written_request(query)
        parameters = AnswerParameters(format=query.format)
        return await answer(_PATH.kind, mesh_id, request, header, parameters, body)
