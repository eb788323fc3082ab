"""Files of paths, one format for each suffix."""

import csv
import io
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from geodesic_core.arrays import Floats, Ints
from geodesic_core.files import as_output, written


class PathRecord(NamedTuple):
    """A path as files hold it."""

    points: Floats
    """(K, 3) mesh units"""
    location_faces: Ints
    """(K,)"""
    location_weights: Floats
    """(K, 3)"""
    faces: Ints
    """(K - 1,) the face between each point and the next"""
    properties: dict[str, Any]
    """Length and error bound, as JSON has them"""


def write_path_file(path: str | Path, record: PathRecord) -> None:
    """Write a path in the format that the suffix names.

    Raises
    ------
    InvalidArgument
        The suffix is none of these formats', or the file cannot be written.
    """
    target = as_output(path, *_WRITERS)
    with written(target) as file:
        file.write(_WRITERS[target.suffix.lower()](record))


def _obj(record: PathRecord) -> bytes:
    rows = [f"v {x!r} {y!r} {z!r}" for x, y, z in record.points.tolist()]
    count = len(rows)
    rows.append(" ".join(["l" if count > 1 else "p", *map(str, range(1, count + 1))]))
    return _lines(rows)


def _ply(record: PathRecord) -> bytes:
    count = len(record.points)
    rows = ["ply", "format ascii 1.0", f"element vertex {count}"]
    rows += [f"property double {axis}" for axis in "xyz"]
    rows += [f"element edge {count - 1}", "property int vertex1", "property int vertex2"]
    rows += ["end_header", *(f"{x!r} {y!r} {z!r}" for x, y, z in record.points.tolist())]
    rows += [f"{i} {i + 1}" for i in range(count - 1)]
    return _lines(rows)


def _csv(record: PathRecord) -> bytes:
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(["x", "y", "z", "face", "u", "v", "w"])
    for point, face, weights in zip(
        record.points.tolist(),
        record.location_faces.tolist(),
        record.location_weights.tolist(),
        strict=True,
    ):
        rows.writerow([*point, face, *weights])
    return text.getvalue().encode()


def _json(record: PathRecord) -> bytes:
    locations = [
        {"face": face, "barycentric": weights}
        for face, weights in zip(
            record.location_faces.tolist(), record.location_weights.tolist(), strict=True
        )
    ]
    document = {
        **record.properties,
        "points": record.points.tolist(),
        "locations": locations,
        "faces": record.faces.tolist(),
    }
    return json.dumps(document).encode()


def _geojson(record: PathRecord) -> bytes:
    points = record.points.tolist()
    geometry = (
        {"type": "LineString", "coordinates": points}
        if len(points) > 1
        else {"type": "Point", "coordinates": points[0]}
    )
    return json.dumps(
        {"type": "Feature", "geometry": geometry, "properties": record.properties}
    ).encode()


def _npy(record: PathRecord) -> bytes:
    data = io.BytesIO()
    np.save(data, record.points, allow_pickle=False)
    return data.getvalue()


def _lines(rows: list[str]) -> bytes:
    return ("\n".join(rows) + "\n").encode()


_WRITERS: dict[str, Callable[[PathRecord], bytes]] = {
    ".obj": _obj,
    ".ply": _ply,
    ".csv": _csv,
    ".json": _json,
    ".geojson": _geojson,
    ".npy": _npy,
}
