"""Uploads: the body goes to a file of the store, without being held in memory."""

import shutil
from collections.abc import AsyncIterator
from pathlib import Path
from typing import get_args

from anyio import to_thread
from starlette.datastructures import UploadFile
from starlette.requests import Request

from app.errors import problem
from app.schemas.meshes import MeshFormat

MESH_FORMATS = get_args(MeshFormat)
_FORMAT_OF_TYPE = {
    "application/json": "json",
    "model/obj": "obj",
    "model/off": "off",
    "model/ply": "ply",
    "application/ply": "ply",
    "model/stl": "stl",
    "model/x.stl-binary": "stl",
    "model/x.stl-ascii": "stl",
    "application/sla": "stl",
    "model/gltf-binary": "glb",
}
_BLOCK = 2**20


async def spool(request: Request, path: Path, file_format: str | None) -> str:
    """Write the mesh file of a request to ``path``, and return its format."""
    media_type = _media_type(request.headers.get("content-type"))
    if media_type == "multipart/form-data":
        guess = await _spool_form(request, path)
    else:
        await _write(path, request.stream())
        guess = _FORMAT_OF_TYPE.get(media_type)
    if path.stat().st_size == 0:
        raise problem("invalid_mesh", "the body is empty: there is no mesh in it")
    chosen = file_format or guess
    if chosen is None:
        hint = (
            f"say ?format= with one of {', '.join(MESH_FORMATS)}, or send a Content-Type of a mesh"
        )
        detail = f"{media_type or 'no Content-Type'} does not tell the format of the mesh"
        raise problem("unsupported_media_type", detail, hint=hint)
    return chosen


async def _spool_form(request: Request, path: Path) -> str | None:
    async with request.form(max_files=1, max_fields=0) as form:
        file = next((part for part in form.values() if isinstance(part, UploadFile)), None)
        if file is None:
            raise problem("malformed_body", "the form has no file")
        with path.open("wb") as target:
            await to_thread.run_sync(shutil.copyfileobj, file.file, target, _BLOCK)
        suffix = Path(file.filename or "").suffix.lower().removeprefix(".")
        by_suffix = suffix if suffix in (*MESH_FORMATS, "json") else None
        return by_suffix or _FORMAT_OF_TYPE.get(_media_type(file.content_type))


async def _write(path: Path, chunks: AsyncIterator[bytes]) -> None:
    # In large blocks: a hop to a thread costs as much as writing a hundred kilobytes.
    block = bytearray()
    with path.open("wb") as file:
        async for chunk in chunks:
            block += chunk
            if len(block) >= _BLOCK:
                await to_thread.run_sync(file.write, bytes(block))
                block.clear()
        await to_thread.run_sync(file.write, bytes(block))


def _media_type(header: str | None) -> str:
    return (header or "").partition(";")[0].strip().lower()
