"""Answers as files, each written as a whole or not at all."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

from app.cli.steps import Failure

if TYPE_CHECKING:
    from geodesic_core import DistanceField, GeodesicPath, Isoline
    from geodesic_core.arrays import Floats
    from geodesic_core.errors import NoPath

    Drawn = tuple[DistanceField, Sequence[float], Sequence[Sequence[Isoline]]]
    """Lines, their levels, and the field that they are of"""

Writer = Callable[[IO[bytes], Any], None]


def write_file(path: Path, write: Writer, what: Any) -> None:
    """Write a file as a whole or not at all."""
    part = path.with_name(f".{path.name}.part")
    try:
        with part.open("wb") as file:
            write(file, what)
        part.replace(path)
    except BaseException as error:
        with suppress(OSError):
            part.unlink()
        if isinstance(error, OSError):
            raise Failure(f"cannot write {path}: {error.strerror}") from error
        raise


def _distances_to_npy(file: IO[bytes], field: "DistanceField") -> None:
    import numpy as np

    np.save(file, field.distances)


def _distances_to_csv(file: IO[bytes], field: "DistanceField") -> None:
    file.write(b"vertex,distance,nearest_source\n")
    columns = zip(field.distances.tolist(), field.nearest_source.tolist(), strict=True)
    for vertex, (value, nearest) in enumerate(columns):
        file.write(b"%d,%a,%d\n" % (vertex, value, nearest))


def _distances_to_json(file: IO[bytes], field: "DistanceField") -> None:
    from app.points import described_source

    _dump_json(
        file,
        {
            "sources": [described_source(field.mesh, source) for source in field.sources],
            "distances": field.distances,  # infinity becomes null
            "nearest_source": field.nearest_source,
            "error_bound": field.error_bound,
            "stats": field.stats.as_dict(),
        },
    )


def _path_to_obj(file: IO[bytes], path: "GeodesicPath") -> None:
    _paths_to_obj(file, [path])


def _paths_to_obj(file: IO[bytes], paths: "Sequence[GeodesicPath | NoPath]") -> None:
    """Write a polyline for each path that there is."""
    _polylines_to_obj(
        file, ((path.points, False) for path in paths if not isinstance(path, Exception))
    )


def _isolines_to_obj(file: IO[bytes], what: "Drawn") -> None:
    """Write a group of polylines for each level; closed ones end at the vertex they begin with."""
    _, levels, found = what
    first = 1
    for level, lines in zip(levels, found, strict=True):
        file.write(b"g level_%a\n" % level)
        first = _polylines_to_obj(file, ((line.points, line.closed) for line in lines), first)


def _polylines_to_obj(
    file: IO[bytes], polylines: "Iterable[tuple[Floats, bool]]", first: int = 1
) -> int:
    """Write points, and whether the last is joined to the first; return the next vertex."""
    for points, closed in polylines:
        for x, y, z in points.tolist():
            file.write(b"v %a %a %a\n" % (x, y, z))
        count = len(points)
        element = b"l " if count > 1 else b"p "
        indices = [*range(first, first + count), *([first] if closed else ())]
        file.write(element + b" ".join(b"%d" % i for i in indices) + b"\n")
        first += count
    return first


def _isolines_to_json(file: IO[bytes], what: "Drawn") -> None:
    field, levels, found = what
    lines = [
        {
            "level": level,
            "lines": [
                {
                    "closed": line.closed,
                    "length": line.length,
                    "points": line.points,
                    "faces": line.faces,
                }
                for line in lines
            ],
        }
        for level, lines in zip(levels, found, strict=True)
    ]
    _dump_json(file, {"isolines": lines, "error_bound": field.error_bound})


def _path_to_json(file: IO[bytes], path: "GeodesicPath") -> None:
    _dump_json(file, {**_outline(path), "steps": path.steps})


def _paths_to_json(file: IO[bytes], paths: "Sequence[GeodesicPath | NoPath]") -> None:
    outlines = [
        {"status": "no_path", "reason": path.reason}
        if isinstance(path, Exception)
        else {"status": "ok", **_outline(path)}
        for path in paths
    ]
    _dump_json(file, {"paths": outlines})


def _outline(path: "GeodesicPath") -> dict[str, Any]:
    locations = [{"face": p.face_index, "barycentric": p.barycentric} for p in path.locations]
    return {
        "length": path.length,
        "points": path.points,
        "locations": locations,
        "faces": path.faces,
        "error_bound": path.error_bound,
    }


def _matrix_to_npy(file: IO[bytes], distances: Any) -> None:
    import numpy as np

    np.save(file, distances)


def _matrix_to_npz(file: IO[bytes], distances: Any) -> None:
    from scipy.sparse import save_npz

    save_npz(file, distances, compressed=False)


def _matrix_to_csv(file: IO[bytes], distances: Any) -> None:
    file.write(b"source,target,distance\n")
    for cell in zip(*(each.tolist() for each in _cells(distances)), strict=True):
        file.write(b"%d,%d,%a\n" % cell)


def _matrix_to_json(file: IO[bytes], distances: Any) -> None:
    members = {"distances": distances}  # infinity becomes null
    if _is_sparse(distances):
        rows, columns, values = _cells(distances)
        members = {
            "shape": distances.shape,
            "rows": rows,
            "columns": columns,
            "distances": values,
        }
    _dump_json(file, members)


def _cells(distances: Any) -> tuple[Any, Any, Any]:
    """Return source, target and distance of each cell of a matrix, or of each pair."""
    import numpy as np

    if _is_sparse(distances):
        table = distances.tocoo()
        return table.row, table.col, table.data
    if distances.ndim == 1:
        pairs = np.arange(len(distances))
        return pairs, pairs, distances
    rows, columns = np.indices(distances.shape)
    return rows.ravel(), columns.ravel(), distances.ravel()


def _is_sparse(distances: Any) -> bool:
    from scipy.sparse import issparse

    return bool(issparse(distances))


def _dump_json(file: IO[bytes], value: dict[str, Any]) -> None:
    import orjson

    file.write(orjson.dumps(value, option=orjson.OPT_SERIALIZE_NUMPY | orjson.OPT_APPEND_NEWLINE))


def write_ply(file: IO[bytes], mesh: tuple[Any, Any]) -> None:
    """Write vertices and triangles."""
    import numpy as np

    vertices, faces = mesh
    rows = np.empty(len(faces), np.dtype([("count", "u1"), ("corners", "<i4", 3)]))
    rows["count"], rows["corners"] = 3, faces
    file.write(
        b"ply\nformat binary_little_endian 1.0\nelement vertex %d\n"
        b"property double x\nproperty double y\nproperty double z\n"
        b"element face %d\nproperty list uchar int vertex_indices\nend_header\n"
        % (len(vertices), len(faces))
    )
    file.write(vertices.astype("<f8").tobytes())
    file.write(rows.tobytes())


DISTANCES: Mapping[str, Writer] = {
    ".npy": _distances_to_npy,
    ".csv": _distances_to_csv,
    ".json": _distances_to_json,
}
PATH: Mapping[str, Writer] = {
    ".obj": _path_to_obj,
    ".json": _path_to_json,
}
ISOLINES: Mapping[str, Writer] = {
    ".obj": _isolines_to_obj,
    ".json": _isolines_to_json,
}
PATHS: Mapping[str, Writer] = {
    ".obj": _paths_to_obj,
    ".json": _paths_to_json,
}
MATRIX: Mapping[str, Writer] = {
    ".npy": _matrix_to_npy,
    ".npz": _matrix_to_npz,
    ".csv": _matrix_to_csv,
    ".json": _matrix_to_json,
}
