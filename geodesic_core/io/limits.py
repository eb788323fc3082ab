"""Limits of mesh files: declared counts are held against the size of the file and a limit."""

from collections.abc import Mapping

from geodesic_core.errors import InvalidMesh, TooManyFaces


def check_declared_counts(
    counts: Mapping[str, int], least_bytes: Mapping[str, int], room: int
) -> None:
    """Refuse a header that declares more elements than fit into the bytes behind it.

    Parameters
    ----------
    counts
        Declared number of elements by name.
    least_bytes
        Least bytes of one element by name.
    room
        Bytes that follow the header.

    Raises
    ------
    InvalidMesh
        A count is negative, or the elements cannot fit.
    """
    # Less one: the last line of a text may have no end.
    least = sum(count * max(1, least_bytes[name]) for name, count in counts.items()) - 1
    if min(counts.values()) < 0 or least > room:
        raise InvalidMesh(
            f"the header declares {counts_in_words(counts)}, which take at least {least} bytes, "
            f"but {room} bytes follow"
        )


def counts_in_words(counts: Mapping[str, int]) -> str:
    """Return the counts as a part of a sentence."""
    return " and ".join(f"{count} {name} elements" for name, count in counts.items())


def check_face_count(faces: int, max_faces: int | None) -> None:
    """Refuse more faces than are allowed; None is no limit.

    Raises
    ------
    TooManyFaces
        There are more.
    """
    if max_faces is not None and faces > max_faces:
        raise TooManyFaces(faces, max_faces)
