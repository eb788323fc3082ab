"""What a mesh file claims to hold, held against its size and a limit before anything is read."""

from collections.abc import Mapping
from typing import Any

from geodesic_core.errors import InvalidMesh, TooManyFaces


def refuse_claim(counts: Mapping[str, int], least_bytes: Mapping[str, int], room: int) -> None:
    """Refuse a header that declares more elements than fit into the ``room`` bytes behind it.

    Parameters
    ----------
    counts
        How many elements of each name are declared.
    least_bytes
        How many bytes one of that name takes at least.
    room
        How many bytes follow the header.
    """
    # Less one: the last line of a text may have no end.
    least = sum(count * max(1, least_bytes[name]) for name, count in counts.items()) - 1
    if min(counts.values()) < 0 or least > room:
        raise InvalidMesh(
            f"the header declares {claim_of(counts)}, which take at least {least} bytes, but "
            f"{room} bytes follow"
        )


def claim_of(counts: Mapping[str, int]) -> str:
    """Return the counts as a part of a sentence."""
    return " and ".join(f"{count} {name} elements" for name, count in counts.items())


def refuse_more_faces(faces: int, max_faces: int | None) -> None:
    """Refuse more faces than are allowed, where there is a limit."""
    if max_faces is not None and faces > max_faces:
        raise TooManyFaces(faces, max_faces)


def glb_faces(tree: Mapping[str, Any]) -> int:
    """Return the triangles of a glTF document: those in its meshes, or shown, if that is more.

    Parts may share their numbers, and nodes their meshes: a small file can show any amount.
    """
    sizes: list[int] = [
        sum(_primitive_faces(tree["accessors"], part) for part in mesh["primitives"])
        for mesh in tree.get("meshes", [])
    ]
    shown: int = sum(sizes[node["mesh"]] for node in tree.get("nodes", []) if "mesh" in node)
    return max(sum(sizes), shown)


_TRIANGLES, _TRIANGLE_STRIP = 4, 5


def _primitive_faces(accessors: Any, primitive: Mapping[str, Any]) -> int:
    corners = accessors[primitive.get("indices", primitive["attributes"]["POSITION"])]["count"]
    mode = primitive.get("mode", _TRIANGLES)
    if mode == _TRIANGLES:
        return int(corners) // 3
    return max(0, int(corners) - 2) if mode == _TRIANGLE_STRIP else 0
