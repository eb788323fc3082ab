"""What commands found, as answers that the service's own encoders write into files."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from app.encoding import Answer
    from geodesic_core import DistanceField, GeodesicPath, Isoline
    from geodesic_core.errors import NoPath


def of_distances(field: "DistanceField", *, gradient: bool = False) -> "Answer":
    """Return the distances of all vertices, with the directions in which they grow if wanted."""
    from app.encoding import Answer, Indices
    from app.queries.points import describe_source
    from app.queries.views import columns_of, surface_of, table_of_distances

    members = {
        "sources": [describe_source(field.mesh, source) for source in field.sources],
        "distances": field.distances,
        "nearest_source": Indices(field.nearest_source),
        **({"gradient": field.gradient} if gradient else {}),
        "error_bound": field.error_bound,
        "stats": field.stats.as_dict(),
    }
    columns = columns_of(members)
    return Answer(
        members,
        ("distances",),
        table=table_of_distances("vertex", columns),
        surface=surface_of(field.mesh, columns),
    )


def of_array(array: "NDArray[Any]") -> "Answer":
    """Return a bare array."""
    from app.encoding import Answer

    return Answer({"array": array}, ("array",))


def of_path(path: "GeodesicPath") -> "Answer":
    """Return a path."""
    from app.encoding import Answer
    from app.queries.outline import outline_of
    from app.queries.views import line_of

    outline = outline_of(path)
    members = outline if path.steps is None else {**outline, "steps": path.steps}
    return Answer(members, ("points",), lines=lambda: [line_of(outline)])


def of_paths(paths: "Sequence[GeodesicPath | NoPath]") -> "Answer":
    """Return paths, and why there are no others."""
    from app.encoding import Answer
    from app.queries.outline import no_outline, outline_of
    from app.queries.views import line_of

    outlines = [
        no_outline(path.reason) if isinstance(path, Exception) else outline_of(path)
        for path in paths
    ]
    return Answer(
        {"paths": outlines},
        shown=("paths",),
        lines=lambda: [line_of(outline, i) for i, outline in enumerate(outlines)],
    )


def of_isolines(
    field: "DistanceField", levels: Sequence[float], found: "Sequence[Sequence[Isoline]]"
) -> "Answer":
    """Return the lines of a field at some levels."""
    from app.encoding import Answer
    from app.queries.isolines import describe_level
    from app.queries.views import lines_of

    lines = [describe_level(level, each) for level, each in zip(levels, found, strict=True)]
    members = {"isolines": lines, "error_bound": field.error_bound}
    return Answer(members, shown=("isolines",), lines=lambda: lines_of(lines))


def of_matrix(distances: Any) -> "Answer":
    """Return a matrix: dense, sparse, or pairs."""
    from scipy.sparse import issparse

    from app.encoding import Answer
    from app.queries.views import table_of_matrix, table_of_sparse

    if not issparse(distances):
        return Answer({"distances": distances}, ("distances",), table=table_of_matrix(distances))
    table = distances.tocoo()
    members = {
        "shape": table.shape,
        "rows": table.row,
        "columns": table.col,
        "distances": table.data,
    }
    cells = table_of_sparse(table.row, table.col, table.data)
    return Answer(members, ("distances", "rows", "columns"), table=cells)
