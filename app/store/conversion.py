"""Conversion of older stores.

Up to layout 5, manifests had no checksum of their own, and the checksums in them were those of
arrays without the headers of their files.
"""

import zlib
from pathlib import Path
from typing import Any

import numpy as np
import orjson

from app.store.atomic import atomic_write, remove_partial, sync
from app.store.layout import MESHES
from app.store.log import warn
from app.store.manifests import MANIFEST, encode_manifest, read_manifest
from app.store.meshes import content_hash
from app.store.verified import read_checksum
from geodesic_core import TriangleMesh


def convert(root: Path) -> None:
    """Convert the meshes of the store ``root`` to the present layout, after reading each once.

    A damaged mesh stays as it is, and is as damaged in the present layout. A conversion that was
    interrupted can be begun again.
    """
    warn("store converted to the present layout: all meshes are read once", path=root)
    remove_partial(root / MESHES)
    for path in (root / MESHES).glob(f"*/{MANIFEST}"):
        if _is_converted(path):
            continue
        try:
            manifest = _converted(path)
        except (OSError, ValueError, TypeError, KeyError, AttributeError) as error:
            warn("damaged mesh not converted", mesh_id=path.parent.name, error=repr(error))
            continue
        with atomic_write(path) as file:
            file.write(encode_manifest(manifest))
        sync(path)
        sync(path.parent)


def _is_converted(path: Path) -> bool:
    try:
        read_manifest(str(path))
    except (OSError, ValueError):
        return False
    return True


def _converted(path: Path) -> dict[str, Any]:
    """Return the manifest of a mesh for the present layout; raise where the mesh is damaged."""
    old = orjson.loads(path.read_bytes())
    files = {name: path.with_name(f"{name}.npy") for name in old["crc32"]}
    arrays = {name: np.load(file, mmap_mode="r").view(np.ndarray) for name, file in files.items()}
    for name, checksum in old["crc32"].items():
        array = np.ascontiguousarray(arrays[name])
        if (zlib.crc32(array.data) if array.size else 0) != checksum:
            raise ValueError(f"its array {name} has changed since it was written")
    if content_hash(arrays) != old["id"] or path.parent.name != old["id"]:
        raise ValueError("its id does not match its content")
    return {
        "id": old["id"],
        "owner": old.get("owner"),
        "created": old["created"],
        "report": TriangleMesh.from_arrays(arrays).report.as_dict(),
        "warnings": old["warnings"],
        "crc32": {name: read_checksum(str(file)) for name, file in files.items()},
    }
