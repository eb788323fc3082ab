"""Uploads: the body goes to a file of the store, without being held in memory."""

import gzip
import re
import zlib
from collections.abc import AsyncIterator
from email.message import EmailMessage
from pathlib import Path
from typing import NamedTuple

from anyio import to_thread
from starlette.requests import Request

from app.errors import problem, too_large_unpacked
from app.http.form_file import FormFile
from app.schemas.meshes import LONGEST_NAME
from app.store.scratch import ScratchFolder, most_unpacked

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
    "model/gltf+json": "gltf",
    "model/vtk": "vtk",
}
_PACKED = (b"\x1f\x8b", b"BZh", b"\xfd7zXZ\0", b"PK\x03\x04")
"""What files begin with that gzip, bzip2, xz or zip have packed"""
_BLOCK = 2**20
_ENDING = re.compile(r"(?:\.[A-Za-z0-9]{1,10}){1,2}$")
"""Up to two suffixes, as .gii.gz has; others are not for file names"""
_CONTROL = re.compile(r"[\x00-\x1f\x7f-\x9f]")


class Upload(NamedTuple):
    """A mesh file that came with a request."""

    path: Path
    """Ends as the client's name of the file does"""
    file_format: str | None
    """None where the request does not tell: then the library goes by name and content"""
    name: str | None


async def spool(
    request: Request, folder: ScratchFolder, file_format: str | None, max_bytes: int
) -> Upload:
    """Write the mesh file of a request into a folder.

    Parameters
    ----------
    request
        The request.
    folder
        The folder, which is empty.
    file_format
        The format that the client named, if it did.
    max_bytes
        Largest size of a body that comes compressed, once it is not.
    """
    path = folder.path / "upload"
    media_type = _media_type(request.headers.get("content-type"))
    coding = request.headers.get("content-encoding", "identity").strip().lower()
    is_form = media_type == "multipart/form-data"
    if coding not in ("identity", "gzip") or (is_form and coding == "gzip"):
        detail = f"the service cannot read a body with Content-Encoding {coding}"
        hint = "send the file uncompressed, or compressed with gzip"
        headers = {"Accept-Encoding": "gzip, identity"}
        raise problem("unsupported_media_type", detail, hint=hint, headers=headers)
    declared = int(request.headers.get("content-length", "0"))
    folder.reserve(min(declared, max_bytes))
    if is_form:
        form = FormFile(request.headers["content-type"])
        await _write(path, form.content(request.stream()), folder)
        media_type, name = _media_type(form.content_type), form.name
    else:
        await _write(path, request.stream(), folder)
        name = _named_in(request.headers.get("content-disposition"))
    if coding == "gzip":
        await _decompress(path, max_bytes, folder)
    if path.stat().st_size == 0:
        raise problem("invalid_mesh", "the body is empty: there is no mesh in it")
    name = _CONTROL.sub("", Path(name).name)
    ending = _ENDING.search(name)
    if ending is not None:
        path = path.rename(path.with_name(f"upload{ending[0]}"))
    by_type = "json" if path.suffix.lower() == ".json" else _FORMAT_OF_TYPE.get(media_type)
    return Upload(path, file_format or by_type, name[:LONGEST_NAME] or None)


def _named_in(disposition: str | None) -> str:
    """Return the file name in a `Content-Disposition`, empty where there is none."""
    message = EmailMessage()
    message["Content-Disposition"] = _CONTROL.sub("", disposition or "attachment")
    return message.get_filename("")


async def _write(path: Path, chunks: AsyncIterator[bytes], folder: ScratchFolder) -> None:
    # In large blocks: a hop to a thread costs as much as writing a hundred kilobytes.
    block = bytearray()
    with path.open("wb") as file:

        async def write_block() -> None:
            folder.reserve(max(folder.reserved, file.tell() + len(block)))
            await to_thread.run_sync(file.write, bytes(block))
            block.clear()

        async for chunk in chunks:
            block += chunk
            if len(block) >= _BLOCK:
                await write_block()
        await write_block()


async def _decompress(path: Path, max_bytes: int, folder: ScratchFolder) -> None:
    """Replace a file by its content, which gzip has compressed."""
    compressed = path.rename(path.with_name("compressed"))
    size = compressed.stat().st_size
    limit = most_unpacked(size, max_bytes)
    folder.reserve(size + limit)
    try:
        with gzip.open(compressed) as source, path.open("wb") as target:
            while block := await to_thread.run_sync(source.read, _BLOCK):
                if target.tell() + len(block) > limit:
                    raise too_large_unpacked(limit, max_bytes)
                await to_thread.run_sync(target.write, block)
    except (gzip.BadGzipFile, EOFError, zlib.error) as error:
        raise problem("malformed_body", f"the body is not valid gzip data: {error}") from error
    with path.open("rb") as source:
        if source.read(6).startswith(_PACKED):  # the ratios would multiply
            detail = "the file is packed, and so is the body"
            hint = "send a packed file without Content-Encoding"
            raise problem("unsupported_media_type", detail, hint=hint)
    compressed.unlink()
    folder.reserve(path.stat().st_size)


def _media_type(header: str | None) -> str:
    return (header or "").partition(";")[0].strip().lower()
