"""``geodesic cortex``: what mappers of brains compute, in their files and by their words."""

import csv
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from app.cli import files
from app.cli.arguments import (
    AbsoluteError,
    EffortOption,
    MethodOption,
    RelativeError,
    accuracy,
    writable,
)
from app.cli.output import AsJson, Output, print_json
from app.cli.steps import show_help_without_command, showing
from app.cli.summary import print_bound, print_size
from app.cli.tables import Threads
from app.cli.words import told_warnings

if TYPE_CHECKING:
    from geodesic_core import MatrixFile
    from geodesic_core.brain import Cortex, ParcelDistances, Parcellation

cortex = typer.Typer(
    help="Distances, parcels, searchlights and smoothing on cortical surfaces, in GIFTI, "
    "FreeSurfer and CIFTI-2 files.",
    rich_markup_mode=None,
)
cortex.callback(invoke_without_command=True)(show_help_without_command)

Surfaces = Annotated[
    list[str],
    typer.Argument(
        metavar="SURFACE...",
        help="A surface, or one of each hemisphere: GIFTI or FreeSurfer. Where neither its "
        "metadata nor its name tell the side, write left=FILE or right=FILE.",
    ),
]
Roi = Annotated[
    list[Path] | None,
    typer.Option(
        help="The vertices that count: a mask, labels or FreeSurfer's .label, for each surface in "
        "their order (repeat the option), or one CIFTI file for both. Needs --wall."
    ),
]
Wall = Annotated[
    Literal["blocks", "passes"] | None,
    typer.Option(
        help="What is outside of --roi. 'blocks': paths stay inside of it, and go along its rim; "
        "'passes': they may cross it, as with -roi of Workbench."
    ),
]
CorrectedAreas = Annotated[
    list[Path] | None,
    typer.Option(
        help="Areas of vertices to measure by, for an average surface: files as for --roi."
    ),
]
_OF_MAPS = (
    *(".dscalar.nii", ".func.gii", ".shape.gii"),
    *(".curv", ".sulc", ".thickness", ".area", ".volume"),
)
_OF_MATRICES = (".dconn.nii", ".npz", ".zarr", ".parquet", ".npy")


@cortex.command()
def distances(
    surfaces: Surfaces,
    out: Annotated[
        Path,
        typer.Option(
            help="Where they go: .dconn.nii, .npy or .zarr; .npz or .parquet for the finite "
            "distances only.",
            callback=writable(*_OF_MATRICES, to_stdout=False),
        ),
    ],
    roi: Roi = None,
    wall: Wall = None,
    limit: Annotated[
        float | None, typer.Option(min=0.0, help="Go no farther than this, in mm.")
    ] = None,
    corrected_areas: CorrectedAreas = None,
    method: MethodOption = "exact",
    relative_error: RelativeError = None,
    absolute_error: AbsoluteError = None,
    effort: EffortOption = None,
    threads: Threads = None,
    as_json: AsJson = False,
) -> None:
    """Compute the distances between all vertices; a stopped command goes on where it was."""
    options = accuracy(method, relative_error, absolute_error, effort)
    opened = _opened(surfaces, roi, wall, corrected_areas)
    _write_distances(opened, out, limit, options, threads, as_json)


@cortex.command()
def neighbours(
    surfaces: Surfaces,
    out: Annotated[
        Path,
        typer.Option(
            help="Where they go, as sparse rows: .npz or .parquet.",
            callback=writable(".npz", ".parquet", to_stdout=False),
        ),
    ],
    radius: Annotated[float, typer.Option(min=0.0, help="The radius of each searchlight, in mm.")],
    roi: Roi = None,
    wall: Wall = None,
    corrected_areas: CorrectedAreas = None,
    method: MethodOption = "exact",
    relative_error: RelativeError = None,
    absolute_error: AbsoluteError = None,
    effort: EffortOption = None,
    threads: Threads = None,
    as_json: AsJson = False,
) -> None:
    """Find the vertices within a radius of each, with their distances: searchlights."""
    options = accuracy(method, relative_error, absolute_error, effort)
    opened = _opened(surfaces, roi, wall, corrected_areas)
    _write_distances(opened, out, radius, options, threads, as_json)


@cortex.command()
def parcels(
    surfaces: Surfaces,
    labels: Annotated[
        list[Path],
        typer.Option(
            help="Parcels: .dlabel.nii of both surfaces, or .label.gii, .annot or .csv of each."
        ),
    ],
    out: Annotated[
        Path, typer.Option(metavar="FOLDER", help="Where the matrices and tables go; made if new.")
    ],
    roi: Roi = None,
    wall: Wall = None,
    corrected_areas: CorrectedAreas = None,
    method: MethodOption = "exact",
    relative_error: RelativeError = None,
    absolute_error: AbsoluteError = None,
    effort: EffortOption = None,
    threads: Threads = None,
    as_json: AsJson = False,
) -> None:
    """Compute mean, least and centroid distances of parcels; a stopped command goes on."""
    import geodesic_core as gc

    options = accuracy(method, relative_error, absolute_error, effort)
    opened = _opened(surfaces, roi, wall, corrected_areas)
    with told_warnings():
        parcellation = gc.brain.load_parcels(_one_or_all(labels), opened)
    with showing("Computing the distances") as step, files.writing(out):
        found = gc.brain.parcel_distances(
            parcellation,
            out,
            **_filled(options),
            threads=threads,
            progress=step.progress,
            cancel=step.cancel,
        )
        _write_table(found, out / "parcels.csv")
        _write_borders(parcellation, out / "borders.json")
    bound, count = asdict(found.error_bound), len(parcellation.names)
    output = Output(None, as_json)
    if as_json:
        print_json({"parcels": count, "wall": wall, "error_bound": bound, "written": str(out)})
    _print_cortex(output, opened)
    output.say(f"parcels     {count}, of {len(found.vertices)} vertices")
    _print_continued(output, len(found.vertices), found.swept)
    print_bound(output, bound)
    output.say(f"written     {out}")


@cortex.command()
def smooth(
    surfaces: Surfaces,
    values: Annotated[
        list[Path],
        typer.Option(help="Values at vertices: .dscalar.nii, or .func.gii and others of each."),
    ],
    fwhm: Annotated[float, typer.Option(help="Full width of the Gaussian at half maximum, in mm.")],
    out: Annotated[
        Path,
        typer.Option(
            help="Where they go: .dscalar.nii; for one hemisphere also .func.gii or .shape.gii, "
            "and for one map FreeSurfer's .curv, .sulc, .thickness, .area or .volume.",
            callback=writable(*_OF_MAPS, to_stdout=False),
        ),
    ],
    roi: Roi = None,
    wall: Wall = None,
    corrected_areas: CorrectedAreas = None,
    threads: Threads = None,
    as_json: AsJson = False,
) -> None:
    """Smooth values by Gaussians of the geodesic distance, which keep their mass."""
    import geodesic_core as gc

    opened = _opened(surfaces, roi, wall, corrected_areas)
    maps = gc.brain.load_maps(_one_or_all(values), opened)
    with showing("Smoothing") as step, files.writing(out):
        smoothed = gc.brain.smooth(
            opened, maps, fwhm, threads=threads, progress=step.progress, cancel=step.cancel
        )
        names = [f"smoothed by {fwhm:g} mm, map {number}" for number in range(1, len(maps) + 1)]
        gc.brain.write_maps(out, opened, smoothed, names)
    output = Output(None, as_json)
    if as_json:
        print_json({"maps": len(maps), "wall": wall, "written": str(out)})
    _print_cortex(output, opened)
    output.say(f"smoothed    {len(maps)} map{'s' * (len(maps) > 1)} by {fwhm:g} mm")
    output.say(f"written     {out}")


def _opened(
    surfaces: Sequence[str],
    roi: Sequence[Path] | None,
    wall: Literal["blocks", "passes"] | None,
    corrected_areas: Sequence[Path] | None,
) -> "Cortex":
    """Return the cortex that options name, and print warnings of the library."""
    if (wall is None) != (not roi):
        raise typer.BadParameter(
            "--roi needs --wall: 'blocks' keeps paths inside of it, 'passes' lets them through"
            if roi
            else "--wall needs --roi, outside of which it is"
        )
    named = [text.split("=", 1) for text in surfaces]
    are_named = [len(each) == 2 and each[0] in ("left", "right") for each in named]
    if any(are_named) and not all(are_named):
        raise typer.BadParameter("write left= or right= before each surface, or before none")
    with showing("Loading kernels (compiled on the first run)"):
        import geodesic_core as gc

        gc.warm_up(["exact"])
    given = {each[0]: each[1] for each in named} if any(are_named) else list(surfaces)
    with showing("Reading the surfaces"), told_warnings():
        areas = None if not corrected_areas else _one_or_all(corrected_areas)
        mask = None if not roi else _one_or_all(roi)
        return gc.brain.load_cortex(given, mask, wall, corrected_areas=areas)


def _one_or_all(paths: Sequence[Path]) -> Any:
    return paths[0] if len(paths) == 1 else list(paths)


def _filled(options: Mapping[str, Any]) -> dict[str, Any]:
    """Return arguments of the library: where an absolute error is given, no default holds."""
    without = {"relative_error": None} if "absolute_error" in options else {}
    return {**without, **options}


def _write_distances(
    opened: "Cortex",
    out: Path,
    limit: float | None,
    options: Mapping[str, Any],
    threads: int | None,
    as_json: bool,
) -> None:
    import geodesic_core as gc

    with showing("Computing the distances") as step, files.writing(out):
        written = gc.brain.write_distances(
            opened,
            out,
            **_filled(options),
            max_distance=limit,
            threads=threads,
            progress=step.progress,
            cancel=step.cancel,
        )
    _print_matrix(opened, written, as_json)


def _print_matrix(opened: "Cortex", written: "MatrixFile", as_json: bool) -> None:
    bound, output = asdict(written.error_bound), Output(None, as_json)
    if as_json:
        facts = {"shape": written.shape, "wall": opened.wall, "error_bound": bound}
        print_json({**facts, "sha256": written.sha256, "written": str(written.path)})
    _print_cortex(output, opened)
    output.say(f"matrix      {written.shape[0]} by {written.shape[1]}")
    _print_continued(output, written.shape[0], written.swept)
    print_bound(output, bound)
    output.say(f"sha256      {written.sha256}")
    output.say(f"written     {written.path}")


def _print_cortex(output: Output, opened: "Cortex") -> None:
    print_size(output, opened.mesh)
    for each in opened.structures:
        inside = len(opened.region_of(each))
        output.say(f"{each.side:11} {inside} of {each.count} vertices count")
    meaning = {
        "blocks": "blocks: paths stay inside of the roi",
        "passes": "passes: paths may cross what is outside of the roi",
        None: "none: all vertices count",
    }
    output.say(f"wall        {meaning[opened.wall]}")


def _print_continued(output: Output, sweeps: int, swept: int) -> None:
    if swept < sweeps:
        output.say(f"continued   {sweeps - swept} of {sweeps} sweeps were done before")


def _write_table(found: "ParcelDistances", path: Path) -> None:
    """Write a row for each parcel: its size, and its centroid by structure and vertex."""
    parcellation = found.parcels
    sizes = [int((parcellation.parcel_of == k).sum()) for k in range(len(parcellation.names))]
    with path.open("w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file)
        rows.writerow(["parcel", "key", "vertices", "area_mm2", "hemisphere", "centroid_vertex"])
        for name, key, size, area, vertex in zip(
            parcellation.names,
            parcellation.keys,
            sizes,
            parcellation.areas.tolist(),
            found.centroids.tolist(),
            strict=True,
        ):
            own = next(
                each
                for each in parcellation.cortex.structures
                if each.part.start <= vertex < each.part.stop
            )
            rows.writerow([name, key, size, area, own.side, vertex - own.first])


def _write_borders(parcellation: "Parcellation", path: Path) -> None:
    """Write the lines around each parcel, as lists of positions."""
    lines = {
        name: [{"closed": line.closed, "points": line.points.tolist()} for line in each]
        for name, each in zip(parcellation.names, parcellation.borders(), strict=True)
    }
    path.write_text(json.dumps(lines) + "\n", encoding="utf-8")
