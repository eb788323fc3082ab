"""Limits of mesh files: declared counts are held against the size of the file and a limit."""

from collections.abc import Mapping

from geodesic_core.errors import InvalidMesh, TooManyFaces


def check_declared_counts(
    counts: Mapping[str, int], least_bytes: Mapping[str, int], room: int, slack: int = 0
) -> None:
    """Refuse a header that declares more elements than fit into the ``room`` bytes behind it.

    ``least_bytes`` are those of one element. The last element may lack ``slack`` of them: in a
    text, its line need not end.
    """
    least = sum(count * max(1, least_bytes[name]) for name, count in counts.items()) - slack
    if min(counts.values()) < 0 or least > room:
        raise InvalidMesh(
            f"the header declares {counts_in_words(counts)}, which take at least {least} bytes, "
            f"but {room} bytes follow"
        )


def check_row_count(counts: Mapping[str, int], rows: int) -> None:
    """Refuse a text with fewer rows than its header declares."""
    if sum(counts.values()) > rows:
        raise InvalidMesh(f"the header declares {counts_in_words(counts)}, but {rows} rows follow")


def counts_in_words(counts: Mapping[str, int]) -> str:
    """Return the counts as a part of a sentence."""
    return " and ".join(f"{count} {name} elements" for name, count in counts.items())


def check_face_count(faces: int, max_faces: int | None) -> None:
    """Refuse more faces than are allowed; None is no limit."""
    if max_faces is not None and faces > max_faces:
        raise TooManyFaces(faces, max_faces)


def check_vertex_count(what: str, vertices: int, max_faces: int | None) -> None:
    """Refuse more vertices than the faces that are allowed can have."""
    if max_faces is not None and vertices > 3 * max_faces:
        raise InvalidMesh(
            f"{what} has {vertices} vertices, but {max_faces} faces have at most {3 * max_faces}"
        )
