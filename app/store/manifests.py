"""Manifests of meshes: JSON files that hold a checksum of themselves."""

import zlib
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

import orjson

from app.store.verified import FileVersion, version_of

MANIFEST = "manifest.json"

_CHECKSUM = "checksum"


def encode_manifest(manifest: Mapping[str, Any]) -> bytes:
    """Return a manifest as it is stored, with its checksum."""
    return orjson.dumps({**manifest, _CHECKSUM: _checksum(manifest)})


def manifest_of(path: str) -> Mapping[str, Any]:
    """Return the manifest in a file, read at most once for each version of it.

    Raises
    ------
    ValueError
        It is not what was written.
    OSError
        The file is missing, or cannot be read.
    """
    version = version_of(path)
    if version is None:
        raise FileNotFoundError(path)
    return _manifest_of_version(path, version)


def read_manifest(path: str) -> Mapping[str, Any]:
    """Return the manifest in a file as it is now; raises as `manifest_of` does."""
    return decode_manifest(Path(path).read_bytes())


def decode_manifest(content: bytes) -> Mapping[str, Any]:
    """Return the manifest that `encode_manifest` wrote; raises ``ValueError`` for anything else."""
    manifest = orjson.loads(content)
    if not isinstance(manifest, dict) or manifest.pop(_CHECKSUM, None) != _checksum(manifest):
        raise ValueError("its checksum does not match its content")
    return manifest


@lru_cache(maxsize=256)
def _manifest_of_version(path: str, _version: FileVersion) -> Mapping[str, Any]:
    return read_manifest(path)


def _checksum(manifest: Mapping[str, Any]) -> str:
    return f"{zlib.crc32(orjson.dumps(manifest, option=orjson.OPT_SORT_KEYS)):08x}"
