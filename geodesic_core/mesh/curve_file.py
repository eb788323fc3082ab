"""Files of curves, one format for each suffix."""

import csv
import io
import json
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np

from geodesic_core import plotting
from geodesic_core.arrays import Floats, Ints
from geodesic_core.extras import extra
from geodesic_core.files import as_output, written


class CurveRecord(NamedTuple):
    """A curve as files hold it."""

    points: Floats
    """(K, 3) mesh units"""
    location_faces: Ints
    """(K,)"""
    location_weights: Floats
    """(K, 3)"""
    faces: Ints
    """(K - 1,), of a closed curve (K,): the face of the segment that begins at each point"""
    closed: bool
    properties: dict[str, Any]
    """Length, and whatever else is known of it, as JSON has it"""

    @property
    def joined(self) -> list[int]:
        """The points in the order in which a line joins them: a closed one ends as it begins."""
        return [*range(len(self.points)), *([0] if self.closed else [])]


def write_curve_file(path: str | Path, record: CurveRecord) -> None:
    """Write a curve in the format that the suffix names.

    Raises
    ------
    InvalidArgument
        The suffix is none of these formats', or the file cannot be written.
    MissingExtra
        The package that writes the format is not installed.
    """
    target = as_output(path, *_WRITERS)
    content = _WRITERS[target.suffix.lower()](record)
    with written(target) as file:
        file.write(content)


def _obj(record: CurveRecord) -> bytes:
    rows = [f"v {x!r} {y!r} {z!r}" for x, y, z in record.points.tolist()]
    rows.append(" ".join(["l" if len(rows) > 1 else "p", *(str(i + 1) for i in record.joined)]))
    return _lines(rows)


def _ply(record: CurveRecord) -> bytes:
    edges = list(pairwise(record.joined))
    rows = ["ply", "format ascii 1.0", f"element vertex {len(record.points)}"]
    rows += [f"property double {axis}" for axis in "xyz"]
    rows += [f"element edge {len(edges)}", "property int vertex1", "property int vertex2"]
    rows += ["end_header", *(f"{x!r} {y!r} {z!r}" for x, y, z in record.points.tolist())]
    rows += [f"{i} {j}" for i, j in edges]
    return _lines(rows)


def _dxf(record: CurveRecord) -> bytes:
    with extra("dxf", "ezdxf", "SurfaceCurve.save"):
        import ezdxf.document
    drawing = ezdxf.document.Drawing.new()
    drawing.modelspace().add_polyline3d(record.points.tolist(), close=record.closed)
    text = io.StringIO()
    drawing.write(text)
    return bytes(drawing.encode(text.getvalue()))


def _vtp(record: CurveRecord) -> bytes:
    line = plotting.line_of(record.points, "SurfaceCurve.save", closed=record.closed)
    line.point_data["face"] = record.location_faces
    line.point_data["barycentric"] = record.location_weights
    line.field_data["length"] = [record.properties["length"]]
    with TemporaryDirectory() as folder:  # VTK writes to a path alone
        file = Path(folder) / "curve.vtp"
        line.save(file)
        return file.read_bytes()


def _npz(record: CurveRecord) -> bytes:
    data = io.BytesIO()
    np.savez(
        data,
        points=record.points,
        location_faces=record.location_faces,
        location_weights=record.location_weights,
        faces=record.faces,
        closed=record.closed,
        length=record.properties["length"],
    )
    return data.getvalue()


def _csv(record: CurveRecord) -> bytes:
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


def _json(record: CurveRecord) -> bytes:
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


def _geojson(record: CurveRecord) -> bytes:
    points = record.points[record.joined].tolist()
    geometry = (
        {"type": "LineString", "coordinates": points}
        if len(points) > 1
        else {"type": "Point", "coordinates": points[0]}
    )
    return json.dumps(
        {"type": "Feature", "geometry": geometry, "properties": record.properties}
    ).encode()


def _npy(record: CurveRecord) -> bytes:
    data = io.BytesIO()
    np.save(data, record.points, allow_pickle=False)
    return data.getvalue()


def _lines(rows: list[str]) -> bytes:
    return ("\n".join(rows) + "\n").encode()


_WRITERS: dict[str, Callable[[CurveRecord], bytes]] = {
    ".obj": _obj,
    ".ply": _ply,
    ".vtp": _vtp,
    ".dxf": _dxf,
    ".csv": _csv,
    ".json": _json,
    ".geojson": _geojson,
    ".npz": _npz,
    ".npy": _npy,
}
