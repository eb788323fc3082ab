"""Routes of meshes: upload, list, describe, read arrays, delete."""

import hashlib
from collections.abc import Mapping
from typing import Annotated

import orjson
from fastapi import APIRouter, Query, Request, Response

from app.encoding import NPY
from app.engine.work import MeshFromFile, MeshFromSample
from app.errors import Fault, over_limit, problem
from app.http.dependencies import (
    ContextDep,
    ServiceDep,
    note_work,
    refuse_idempotency_key,
    while_connected,
)
from app.http.prefix import prefix_of
from app.http.responses import (
    FILE_HEADERS,
    IMMUTABLE,
    REVALIDATED,
    WORK_PROBLEMS,
    StoredFileResponse,
    documented,
    etag_of,
    listed_mesh,
    mesh_document,
    not_modified,
    problems,
    server_timing,
)
from app.http.uploads import spool
from app.schemas.meshes import MeshDocument, MeshList, MeshListParameters, UploadParameters
from app.service.mesh_storing import StoredMesh
from app.service.request_context import RequestContext
from app.service.service import Service
from app.service.time_limit import time_limit

router = APIRouter(prefix="/meshes", tags=["meshes"])

_DEFAULT_SAMPLE_FACES = 20_000


def _triples(items: dict[str, object]) -> dict[str, object]:
    return {
        "type": "array",
        "items": {"type": "array", "items": items, "minItems": 3, "maxItems": 3},
    }


_BINARY = {"schema": {"type": "string", "format": "binary"}}
_BODIES = {
    "requestBody": {
        "content": {
            "application/octet-stream": _BINARY,
            "multipart/form-data": {
                "schema": {
                    "type": "object",
                    "additionalProperties": False,
                    "required": ["file"],
                    "properties": {"file": {"type": "string", "format": "binary"}},
                }
            },
            "application/json": {
                "schema": {
                    "type": "object",
                    "additionalProperties": False,
                    "required": ["faces"],
                    "properties": {
                        "vertices": _triples({"type": "number"}),
                        "faces": _triples({"type": "integer", "minimum": 0}),
                        "lengths": {
                            **_triples({"type": "number"}),
                            "description": "Lengths of the edges of each face, number i from "
                            "corner i to corner i + 1: in place of vertices, or beside them",
                        },
                    },
                },
            },
        }
    }
}


@router.post(
    "",
    operation_id="createMesh",
    summary="Upload a mesh, or make a sample",
    status_code=201,
    response_model=MeshDocument,
    responses={
        200: {
            "model": MeshDocument,
            "description": "The mesh was in the store already",
            "headers": documented("Location", "Server-Timing"),
        },
        201: {
            "description": "The mesh is new in the store",
            "headers": documented("Location", "Server-Timing"),
        },
        **problems(
            "malformed_body",
            "idempotency_key_unused",
            "upload_too_large",
            "unsupported_media_type",
            "invalid_mesh",
            "quota_exceeded",
            *WORK_PROBLEMS,
        ),
    },
    openapi_extra=_BODIES,
)
async def create_mesh(
    parameters: Annotated[UploadParameters, Query()],
    request: Request,
    response: Response,
    service: ServiceDep,
    context: ContextDep,
) -> Mapping[str, object]:
    """Read, check and store a mesh; the id is a hash of its content.

    The body is the file itself, a form with one file, or JSON. The file may be packed by gzip,
    bzip2, xz or zip; the body, except a form, may also have `Content-Encoding: gzip`. Vertices and
    triangles keep the order they have in the file; polygons become triangles in their place, and
    `face_map` leads back to them.

    A surface may be given by the lengths of its edges: as JSON with `faces` and `lengths`, or as an
    `.npz` file of these arrays, in both with `vertices` or without. Without, all that lies on the
    surface is answered, with `null` in place of positions; what needs space is refused as
    `not_embedded`. An `.npz` file of `vertices` and `faces` is a mesh like any other.
    """
    refuse_idempotency_key(request)
    with service.uploads.counting(context.caller):
        if parameters.sample is None:
            stored = await _add_upload(service, parameters, request, context)
        else:
            making = service.add_mesh(
                _sample(service, parameters), parameters.name or parameters.sample, context
            )
            stored = await while_connected(request, making)
    note_work(request, stored.manifest["id"], stored.seconds)
    response.status_code = 201 if stored.is_new else 200
    response.headers.update(server_timing(stored.seconds))
    prefix = prefix_of(request.scope)
    response.headers["Location"] = f"{prefix}/v1/meshes/{stored.manifest['id']}"
    return mesh_document(stored.manifest, prefix)


@router.get(
    "",
    operation_id="listMeshes",
    summary="List the meshes in the store",
    response_model=MeshList,
    responses=problems("invalid_request", "store_unavailable"),
)
async def list_meshes(
    parameters: Annotated[MeshListParameters, Query()], service: ServiceDep
) -> dict[str, object]:
    """List meshes, the newest first, `limit` at a time."""
    manifests, cursor = await service.mesh_index.page(
        parameters.limit, parameters.cursor or "", parameters.name
    )
    return {"meshes": [listed_mesh(each) for each in manifests], "next_cursor": cursor}


@router.get(
    "/{mesh_id}",
    operation_id="getMesh",
    summary="Describe a mesh",
    response_model=MeshDocument,
    responses={
        200: {"description": "The report", "headers": documented("ETag", "Cache-Control")},
        304: {"description": "The report has not changed", "headers": documented("ETag")},
        **problems("mesh_not_found", "mesh_damaged", "store_unavailable"),
    },
)
async def get_mesh(
    mesh_id: str, request: Request, response: Response, service: ServiceDep
) -> Response | dict[str, object]:
    """Return the report of a mesh, the same as after its upload."""
    document = mesh_document(await service.manifest(mesh_id), prefix_of(request.scope))
    # A mesh that is deleted and uploaded again has the same id, but perhaps another name.
    etag = etag_of(hashlib.blake2b(orjson.dumps(document), digest_size=16).hexdigest())
    headers = {**REVALIDATED, "ETag": etag}
    response.headers.update(headers)
    return not_modified(request, etag, headers) or document


@router.delete(
    "/{mesh_id}",
    operation_id="deleteMesh",
    summary="Remove a mesh and its results",
    status_code=204,
    responses=problems("mesh_not_found", "store_unavailable"),
)
async def delete_mesh(mesh_id: str, service: ServiceDep) -> None:
    """Remove a mesh; queries that run on it are still answered.

    Where keys are set, any key may remove it.
    """
    await service.delete_mesh(mesh_id)


@router.get(
    "/{mesh_id}/arrays/{name}",
    operation_id="getMeshArray",
    summary="Read an array of a mesh",
    response_class=Response,
    responses={
        200: {
            "content": {NPY: _BINARY},
            "description": "The array in numpy's own format",
            "headers": documented(*FILE_HEADERS),
        },
        206: {
            "content": {NPY: _BINARY},
            "description": "The requested range",
            "headers": documented("Content-Range", *FILE_HEADERS),
        },
        304: {"description": "The array has not changed", "headers": documented("ETag")},
        **problems(
            "mesh_not_found",
            "not_found",
            "range_not_satisfiable",
            "mesh_damaged",
            "store_unavailable",
        ),
    },
)
async def get_mesh_array(
    mesh_id: str, name: str, request: Request, service: ServiceDep
) -> Response:
    """Send `vertices`, `faces`, `lengths`, `vertex_map`, `face_map` or `components`, or a range."""
    path = await service.array_file(mesh_id, name)
    etag = etag_of(f"{mesh_id}-{name}")
    return not_modified(request, etag, IMMUTABLE) or StoredFileResponse(
        path, headers={"ETag": etag, **IMMUTABLE}, media_type=NPY
    )


async def _add_upload(
    service: Service, parameters: UploadParameters, request: Request, context: RequestContext
) -> StoredMesh:
    if parameters.faces is not None:
        fault = Fault("/query/faces", "the number of faces can be chosen for a sample only")
        raise problem("invalid_request", fault.message, errors=(fault,))
    service.engine.refuse_when_full(context.caller.name)  # before the body is read
    async with (
        service.scratch.folder(context.caller.name) as folder,
        time_limit(service.settings, context.deadline_s),
    ):
        limit = service.settings.max_upload_bytes
        upload = await spool(request, folder, parameters.format, limit)
        mesh_input = MeshFromFile(upload.path, upload.file_format, parameters.merge)
        name = parameters.name or upload.name
        return await while_connected(request, service.add_mesh(mesh_input, name, context))


def _sample(service: Service, parameters: UploadParameters) -> MeshFromSample:
    faces = parameters.faces or _DEFAULT_SAMPLE_FACES
    if faces > service.settings.max_faces:
        limit = service.settings.max_faces
        raise over_limit("limit_exceeded", "faces", faces, limit, "max_faces")
    return MeshFromSample(str(parameters.sample), faces, parameters.merge)
