"""Types of files by their first bytes, whatever their names say."""

import re
from typing import NamedTuple

_HEAD = 4096
"""Bytes of a file that are looked at"""
_XML = rb"\s*(?:<\?xml[^>]*>\s*)?(?:<!DOCTYPE[^>]*>\s*)?(?:<!--.*?-->\s*)*"


class Signature(NamedTuple):
    """A type of file, and what its files begin with."""

    file_type: str
    """As `load_mesh` names it; empty for what is no mesh that it reads"""
    words: str
    """For messages"""
    begins: re.Pattern[bytes]


def _signature(file_type: str, words: str, pattern: bytes) -> Signature:
    return Signature(file_type, words, re.compile(pattern, re.IGNORECASE | re.DOTALL))


_SIGNATURES = (
    _signature("ply", "a PLY file", rb"\s*ply\s+(?:format|comment|obj_info)\b"),
    _signature("off", "an OFF file", rb"\s*(?:ST)?C?N?4?OFF\b"),
    _signature("stl", "a text STL file", rb"\s*solid\b[^\0]*\bfacet\b"),
    _signature("glb", "a GLB file", rb"glTF"),
    _signature("vtk", "a VTK file", rb"# vtk DataFile|" + _XML + rb"<VTKFile\b"),
    _signature("gii", "a GIFTI file", _XML + rb"<GIFTI\b"),
    _signature("freesurfer", "a FreeSurfer surface", rb"\xff\xff[\xfd-\xff]|#!ascii version of"),
    _signature("asc", "an Esri ASCII grid", rb"\s*ncols\s"),
    _signature(
        "",
        "a Git LFS pointer, which stands for the file: run 'git lfs pull'",
        rb"version https://git-lfs",
    ),
    _signature("", "an HTML page: download the file again", rb"\s*(?:<!DOCTYPE\s+html|<html)\b"),
    _signature("", "a COLLADA file: save the mesh in another format", _XML + rb"<COLLADA\b"),
    _signature("", "an FBX file: save the mesh in another format", rb"Kaydara FBX"),
    _signature("", "a Blender file: export the mesh from it", rb"BLENDER"),
    _signature("", "an HDF5 file: save the mesh in another format", rb"\x89HDF\r\n"),
    _signature("", "a picture", rb"\x89PNG|\xff\xd8\xff|GIF8|II\*\0|MM\0\*"),
    _signature("", "a PDF document", rb"%PDF"),
)
_BINARY_STL = _signature("stl", "a binary STL file", rb"")


def signature_of(data: bytes) -> Signature | None:
    """Return what a file is by its content; None where that does not tell."""
    head = data[:_HEAD]
    found = next((each for each in _SIGNATURES if each.begins.match(head)), None)
    if found is None and len(data) == 84 + 50 * int.from_bytes(data[80:84], "little"):
        return _BINARY_STL
    return found
