"""Routes of the service itself: index, health, limits, metrics and error codes."""

from typing import get_args

from fastapi import APIRouter, Request, Response
from starlette.responses import PlainTextResponse

from app import __version__
from app.encoding import FORMATS, JSON
from app.errors import CODES, draining, problem
from app.http import page
from app.http.dependencies import ServiceDep
from app.http.metrics import Metrics
from app.http.prefix import prefix_of
from app.http.responses import UNSTORED, documented, problems
from app.schemas.meshes import MESH_FORMATS, SampleName
from app.schemas.requests import Method
from app.schemas.service import About, Health, Index, ProblemCode
from app.settings import Settings

router = APIRouter(tags=["service"])

_LIMITS = (
    "store_bytes",
    "max_upload_bytes",
    "max_query_bytes",
    "max_faces",
    "max_vertices",
    "max_sources",
    "max_matrix_cells",
    "max_waypoints",
    "max_levels",
    "max_json_values",
    "query_memory_bytes",
    "worker_memory_bytes",
    "queue_size",
    "deadline_s",
    "job_deadline_s",
    "job_ttl",
    "rate_limit",
    "max_concurrent",
    "quota_results_bytes",
    "quota_uploads",
)


@router.get(
    "/",
    operation_id="getIndex",
    summary="Links to the parts of the service",
    response_model=Index,
    responses={
        200: {
            "content": {"text/html": {}},
            "description": "The links; for browsers, the page",
            "headers": documented("Vary"),
        }
    },
)
async def get_index(request: Request, response: Response) -> Response | Index:
    """Return links to the parts of the service; to a browser, the page."""
    if page.is_built() and page.wants_page(request.headers):
        return page.page_response(request.scope)
    response.headers["Vary"] = "Accept"
    prefix = prefix_of(request.scope)
    links = {
        "about": f"{prefix}/v1",
        "meshes": f"{prefix}/v1/meshes",
        "openapi": f"{prefix}/openapi.json",
        "docs": f"{prefix}/docs",
    }
    shown = "for browsers" if page.is_built() else "not part of this package"
    return Index(service="geodesic", version=__version__, page=shown, links=links)


@router.get("/docs", include_in_schema=False)
async def get_reference(request: Request) -> Response:
    """Return the page that shows the interface document."""
    if not page.is_built():
        detail = "this package has no reference page; openapi.json beside it has the same document"
        raise problem("not_found", detail)
    return page.page_response(request.scope, "docs.html")


@router.get("/livez", operation_id="getLiveness", summary="Liveness")
async def get_liveness() -> Health:
    """Return 200 as soon as the service listens."""
    return Health(status="ok")


@router.get(
    "/readyz",
    operation_id="getReadiness",
    summary="Readiness",
    response_model=Health,
    responses=problems("engine_unavailable", "draining"),
)
async def get_readiness(service: ServiceDep) -> Health:
    """Return 200 once a worker has its kernels compiled; 503 before, and when the service stops."""
    if service.is_leaving:
        raise draining()
    if not service.engine.is_ready:
        detail = "no worker is ready yet: kernels are being compiled or loaded"
        raise problem("engine_unavailable", detail, headers={"Retry-After": "1"})
    return Health(status="ok")


def about(settings: Settings) -> bytes:
    """Return what `get_about` answers, which does not change while the service runs."""
    limits = {name: getattr(settings, name) for name in _LIMITS}
    document = About(
        version=__version__,
        methods=list(get_args(Method)),
        mesh_formats=[*MESH_FORMATS, "json"],
        answer_formats=dict(FORMATS),
        samples=list(get_args(SampleName)),
        limits={name: limit for name, limit in limits.items() if limit is not None},
    )
    return document.model_dump_json().encode()


@router.get(
    "/v1",
    operation_id="getAbout",
    summary="Version, formats and limits in force",
    response_model=About,
)
async def get_about(request: Request) -> Response:
    """Return version, methods, formats and samples, and the limits in force."""
    return Response(request.app.state.about, media_type=JSON)


@router.get(
    "/metrics",
    operation_id="getMetrics",
    summary="Metrics in Prometheus's text format",
    response_class=PlainTextResponse,
    responses={
        200: {
            "description": "Metrics named `geodesic_…`, in Prometheus's text format",
            "headers": documented("Cache-Control"),
        }
    },
)
async def get_metrics(request: Request) -> Response:
    """Return metrics for operators: requests, workers, queue, results, jobs."""
    metrics: Metrics = request.app.state.metrics
    text, media_type = await metrics.exposition(request.headers.get("accept", ""))
    return Response(text, headers={**UNSTORED, "Content-Type": media_type})


@router.get(
    "/problems/{code}",
    operation_id="getProblem",
    summary="Meaning of an error code",
    response_model=ProblemCode,
    responses={
        200: {"description": "The meaning", "headers": documented("Cache-Control")},
        **problems("not_found"),
    },
)
async def get_problem(code: str, response: Response) -> ProblemCode:
    """Return the row of the error table; the `type` of a problem leads here."""
    if code not in CODES:
        raise problem("not_found", f"there is no code {code!r}; the codes are {', '.join(CODES)}")
    response.headers["Cache-Control"] = "public, max-age=86400"
    return ProblemCode(code=code, **vars(CODES[code]))
