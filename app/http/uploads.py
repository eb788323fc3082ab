"""Uploads: the body goes to a file of the store, without being held in memory."""

import gzip
import re
import shutil
import zlib
from collections.abc import AsyncIterator
from pathlib import Path
from typing import get_args

from anyio import to_thread
from starlette.datastructures import UploadFile
from starlette.requests import Request

from app.errors import problem
from app.schemas.meshes import LONGEST_NAME, MeshFormat
from app.settings import variable_of

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
_CONTROL = re.compile(r"[\x00-\x1f\x7f-\x9f]")


async def spool(
    request: Request, path: Path, file_format: str | None, max_bytes: int
) -> tuple[str, str | None]:
    """Write the mesh file of a request to ``path``, and return its format and its name, if any.

    Parameters
    ----------
    request
        The request.
    path
        The file to write.
    file_format
        The format that the client named, if it did.
    max_bytes
        Largest size of a body that comes compressed, once it is not.
    """
    media_type = _media_type(request.headers.get("content-type"))
    coding = request.headers.get("content-encoding", "identity").strip().lower()
    is_form = media_type == "multipart/form-data"
    if coding not in ("identity", "gzip") or (is_form and coding == "gzip"):
        detail = f"the service cannot read a body with Content-Encoding {coding}"
        hint = "send the file uncompressed, or compressed with gzip"
        headers = {"Accept-Encoding": "gzip, identity"}
        raise problem("unsupported_media_type", detail, hint=hint, headers=headers)
    name = None
    if is_form:
        guess, name = await _spool_form(request, path)
    else:
        await _write(path, request.stream())
        guess = _FORMAT_OF_TYPE.get(media_type)
    if coding == "gzip":
        await _decompress(path, max_bytes)
    if path.stat().st_size == 0:
        raise problem("invalid_mesh", "the body is empty: there is no mesh in it")
    chosen = file_format or guess
    if chosen is None:
        hint = (
            f"add ?format= with one of {', '.join(MESH_FORMATS)}, or send the Content-Type of a "
            "mesh format"
        )
        detail = f"{media_type or 'no Content-Type'} does not tell the format of the mesh"
        raise problem("unsupported_media_type", detail, hint=hint)
    return chosen, name


async def _spool_form(request: Request, path: Path) -> tuple[str | None, str | None]:
    async with request.form(max_files=1, max_fields=0) as form:
        file = next((part for part in form.values() if isinstance(part, UploadFile)), None)
        if file is None:
            raise problem("malformed_body", "the form has no file")
        with path.open("wb") as target:
            await to_thread.run_sync(shutil.copyfileobj, file.file, target, _BLOCK)
        name = _CONTROL.sub("", Path(file.filename or "").name)
        suffix = Path(name).suffix.lower().removeprefix(".")
        by_suffix = suffix if suffix in (*MESH_FORMATS, "json") else None
        guess = by_suffix or _FORMAT_OF_TYPE.get(_media_type(file.content_type))
        return guess, name[:LONGEST_NAME] or None


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


async def _decompress(path: Path, max_bytes: int) -> None:
    """Replace a file by its content, which gzip has compressed."""
    compressed = path.rename(path.with_name("compressed"))
    try:
        with gzip.open(compressed) as source, path.open("wb") as target:
            while block := await to_thread.run_sync(source.read, _BLOCK):
                if target.tell() + len(block) > max_bytes:
                    detail = f"the body is larger than {max_bytes} bytes after decompression"
                    setting = variable_of("max_upload_bytes")
                    raise problem("upload_too_large", detail, limit=max_bytes, setting=setting)
                await to_thread.run_sync(target.write, block)
    except (gzip.BadGzipFile, EOFError, zlib.error) as error:
        raise problem("malformed_body", f"the body is not valid gzip data: {error}") from error
    compressed.unlink()


def _media_type(header: str | None) -> str:
    return (header or "").partition(";")[0].strip().lower()
