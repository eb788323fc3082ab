"""``geodesic terrain``: ways over elevation models, from the files of maps and into them."""

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.cli.arguments import writable
from app.cli.output import AsJson, Output, print_json
from app.cli.steps import Failure, show_help_without_command, showing
from app.cli.summary import print_bound, print_size
from app.cli.words import told_warnings

if TYPE_CHECKING:
    from geodesic_core import CheapestPath, GeodesicPath, SurfaceCurve, SurfacePoint
    from geodesic_core.terrain import Terrain

terrain = typer.Typer(
    help="Paths and isochrones over elevation models, in GeoTIFF, GeoJSON, GPX and CSV files.",
    rich_markup_mode=None,
)
terrain.callback(invoke_without_command=True)(show_help_without_command)

_WGS84 = "EPSG:4326"

Dem = Annotated[
    Path,
    typer.Argument(metavar="DEM", help="A raster of heights: GeoTIFF, .asc, or what GDAL reads."),
]
Place = Annotated[str, typer.Option("--to", metavar="X,Y", help="Where the path ends, as --from.")]
Block = Annotated[
    list[Path] | None,
    typer.Option(
        help="Polygons that no path may enter: GeoJSON, GeoPackage, Shapefile. Repeat for more."
    ),
]
CostOption = Annotated[
    list[str] | None,
    typer.Option(
        metavar="slope:tobler|slope:naismith|FILE.npy",
        help="What counts in the place of length: seconds by a walker's rule, a factor for each "
        "face of the raster's surface, or both (repeat the option).",
    ),
]
Crs = Annotated[
    str | None, typer.Option(help="The CRS of the raster, as EPSG:32632, where it tells none.")
]
Lonlat = Annotated[bool, typer.Option(help="Places are longitudes and latitudes in WGS 84.")]
OutOption = Annotated[
    Path,
    typer.Option(
        help="Where it goes: .geojson, .gpx or .csv.",
        callback=writable(".geojson", ".gpx", ".csv", to_stdout=False),
    ),
]


@terrain.command()
def path(
    dem: Dem,
    start: Annotated[
        str,
        typer.Option(
            "--from", metavar="X,Y", help="Where the path begins, in the coordinates of the raster."
        ),
    ],
    end: Place,
    out: OutOption,
    block: Block = None,
    cost: CostOption = None,
    crs: Crs = None,
    lonlat: Lonlat = False,
    as_json: AsJson = False,
) -> None:
    """Find the shortest path, or the cheapest one where there are costs."""
    import geodesic_core as gc

    ground, costs = _opened(dem, block, cost, crs)
    source, target = _located(ground, [start, end], lonlat)
    found: CheapestPath | GeodesicPath
    with showing("Looking for the path") as step, told_warnings():
        controls: Any = {"progress": step.progress, "cancel": step.cancel}
        if costs is None:
            found = gc.shortest_path(ground.open_mesh(), source, target, **controls)
        else:
            found = gc.cheapest_path(ground.mesh, source, target, costs, **controls)
        ground.save(out, found)
    profile = found.profile()
    facts: dict[str, Any] = {"length": found.length}
    if costs is not None:
        facts["cost"] = found.cost  # type: ignore[union-attr]
    facts |= {"ascent": profile.ascent, "descent": profile.descent}
    bound = asdict(found.error_bound)
    output = Output(None, as_json)
    if as_json:
        print_json({**facts, "error_bound": bound, "notes": ground.notes, "written": str(out)})
    _print_ground(output, ground)
    for name, figure in facts.items():
        output.say(f"{name:11} {figure!r}")
    print_bound(output, bound)
    output.say(f"written     {out}")


@terrain.command()
def reach(
    dem: Dem,
    start: Annotated[
        list[str],
        typer.Option(
            "--from",
            metavar="X,Y",
            help="A start, in the coordinates of the raster. Repeat it for more of them.",
        ),
    ],
    levels: Annotated[
        str, typer.Option(metavar="L,L…", help="Lengths, or costs where --cost is given.")
    ],
    out: OutOption,
    block: Block = None,
    cost: CostOption = None,
    towards: Annotated[
        bool, typer.Option(help="Count the way to the places, not from them. Needs --cost.")
    ] = False,
    crs: Crs = None,
    lonlat: Lonlat = False,
    as_json: AsJson = False,
) -> None:
    """Draw lines of equal distance, or of equal cost: isochrones, where costs are times."""
    import geodesic_core as gc

    heights = _numbers("--levels", levels)
    if towards and not cost:
        raise typer.BadParameter("--towards needs --cost: lengths are the same both ways")
    ground, costs = _opened(dem, block, cost, crs)
    sources = _located(ground, start, lonlat)
    with showing("Drawing the lines") as step, told_warnings():
        controls: Any = {"progress": step.progress, "cancel": step.cancel}
        by_level: Sequence[Sequence[SurfaceCurve]]
        if costs is None:
            field = gc.exact_distance(ground.open_mesh(), sources, retain="windows", **controls)
            by_level, bound = field.isolines(heights), asdict(field.error_bound)
        else:
            direction: Any = "to" if towards else "from"
            priced = gc.cost_distance(ground.mesh, sources, costs, direction=direction, **controls)
            by_level, bound = priced.isochrones(heights), asdict(priced.error_bound)
        pairs = zip(heights, by_level, strict=True)
        lines = [(line, {"level": level}) for level, each in pairs for line in each]
        if not lines:
            raise Failure(f"nothing on this terrain is at {levels}")
        ground.save(out, [line for line, _ in lines], [facts for _, facts in lines])
    output = Output(None, as_json)
    if as_json:
        counts = [len(each) for each in by_level]
        print_json({"levels": heights, "lines": counts, "error_bound": bound, "written": str(out)})
    _print_ground(output, ground)
    for level, each in zip(heights, by_level, strict=True):
        output.say(f"level       {level:g}: {len(each)} line{'s' * (len(each) != 1)}")
    print_bound(output, bound)
    output.say(f"written     {out}")


def _opened(
    dem: Path, block: Sequence[Path] | None, cost: Sequence[str] | None, crs: str | None
) -> "tuple[Terrain, Any]":
    """Return the terrain that options name, and what its ways cost; None for their length."""
    rules, factors = _split_costs(cost or [])
    with showing("Loading kernels (compiled on the first run)"):
        import geodesic_core as gc

        gc.warm_up(["exact", "paths", *(["cuts"] if block else []), *(["costs"] if cost else [])])
    with showing(f"Reading {dem.name}"), told_warnings():
        ground = gc.terrain.from_dem(dem, crs=crs)
        if factors:
            ground = ground.with_costs(_loaded(factors[0]))
        for file in block or []:
            ground = gc.terrain.burn(ground, file, float("inf"))
    if rules:
        return ground, (ground.costs, gc.SlopeCost(rules[0]))
    return ground, ground.costs if factors else None


def _split_costs(given: Sequence[str]) -> tuple[list[Any], list[Path]]:
    """Return the rules and the files that costs name, one of each at most."""
    rules = [each.removeprefix("slope:") for each in given if each.startswith("slope:")]
    paths = [Path(each) for each in given if not each.startswith("slope:")]
    if any(each not in ("tobler", "naismith") for each in rules):
        raise typer.BadParameter("--cost slope: takes tobler or naismith")
    if any(each.suffix != ".npy" for each in paths):
        raise typer.BadParameter("--cost must be slope:tobler, slope:naismith or end in .npy")
    if max(len(rules), len(paths)) > 1:
        raise typer.BadParameter("--cost takes one rule and one file")
    return rules, paths


def _loaded(path: Path) -> Any:
    import numpy as np

    try:
        return np.load(path, allow_pickle=False)
    except (OSError, ValueError) as error:
        raise Failure(f"cannot read {path}: {error}") from error


def _located(ground: "Terrain", texts: Sequence[str], lonlat: bool) -> "list[SurfacePoint]":
    places = []
    for text in texts:
        places.append(_numbers("a place", text))
        if len(places[-1]) != 2:
            raise typer.BadParameter(f"{text}: a place is X,Y")
    points: list[SurfacePoint] = ground.locate_xy(places, _WGS84 if lonlat else None)
    return points


def _numbers(name: str, text: str) -> list[float]:
    try:
        return [float(each) for each in text.split(",")]
    except ValueError:
        message = f"{text}: {name} must be numbers with commas between them"
        raise typer.BadParameter(message) from None


def _print_ground(output: Output, ground: "Terrain") -> None:
    print_size(output, ground.mesh)
    for note in ground.notes:
        output.say(f"note        {note}")
