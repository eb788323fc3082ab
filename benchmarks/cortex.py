"""Small discs, whole rows and parcels of a real cortex, beside Connectome Workbench."""

import math
import os
import re
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from statistics import median
from typing import Any

import nibabel
import numpy as np

import geodesic_core as gc
from benchmarks.inputs import Inputs
from benchmarks.tables import Section, verdict
from geodesic_core.arrays import Floats, Longs

brain: Any = nibabel  # of whose types little is declared

COMMAND = "wb_command"
"""Of Connectome Workbench: the package ``connectome-workbench`` of Debian"""
SURFACE, THICKNESS = "white_right.gii.gz", "thick_right.gii.gz"
"""Of fsaverage5, which comes with nilearn"""
RADII = {0.5: "", 10.0: "discs", 20.0: ""}
"""Millimetres"""
GEODESIC = str(Path(sys.executable).with_name("geodesic"))
PARCELS = 100
PERIOD_S = 0.02
"""Between two looks at the memory of a command"""
ROWS = 200
"""Whole rows, of sources all over the surface"""
METHODS: dict[str, dict[str, Any]] = {
    "exact": {},
    "fast, effort=1": {"method": "fast", "effort": 1},
    "approximate": {"method": "approximate"},
}
AT_MOST = {"exact": 3.5, "fast, effort=1": 1.2}
"""Times of Workbench's processor time for discs of 10 mm"""


def run(_inputs: Inputs, runs: int) -> Section:
    """Time all pairs within some radii, whole rows, and all pairs, each method by turns."""
    folder = _data()
    mesh = gc.load_mesh(folder / SURFACE)
    thickness = brain.load(folder / THICKNESS).agg_data()
    cortex = np.flatnonzero(thickness > 0)
    gc.warm_up()
    peer = shutil.which(COMMAND)
    if peer is None:
        print(f"{COMMAND} is not installed: the column of Connectome Workbench stays empty")
    with tempfile.TemporaryDirectory() as scratch:
        workbench = None if peer is None else _Workbench(Path(scratch), mesh, cortex)
        rows = [_discs(mesh, cortex, radius, workbench, runs) for radius in RADII]
        rows.append(_whole(mesh, cortex, workbench, runs))
        if workbench is not None:
            rows.append(_parcels(mesh, cortex, workbench))
    rows.append(_symmetric(mesh, cortex))
    return Section(
        "Cortex",
        f"Distances on the right white surface of fsaverage5 ({len(mesh.vertices):,} vertices) "
        f"between its {len(cortex):,} vertices of cortex, in one thread: all pairs within a radius "
        f"as a sparse matrix, {ROWS} whole rows, and all pairs beside as many rows of the full "
        "square; microseconds of processor time for each source, medians of "
        f"{runs} by turns. Workbench writes a dense file within that time. Its errors are the mean "
        "and the largest one, as a share of the exact distance. Memory is the peak of a command: "
        f"geodesic cortex, exact, and wb_command. Parcels are {PARCELS} of about the same area; "
        "Workbench parcellates its matrix of all rows. The surface has so many sharp saddles that "
        "approximate sweeps are exact ones.",
        ["distances", "pairs a source", *METHODS, "Workbench", "its error", "MiB: ours, its"],
        rows,
    )


def _data() -> Path:
    """Return the folder of fsaverage5 in the package nilearn, which need not be imported."""
    spec = find_spec("nilearn")
    if spec is None or spec.origin is None:
        raise SystemExit("cortex: nilearn is not installed: run scripts/bench cortex")
    return Path(spec.origin).parent / "datasets" / "data" / "fsaverage5"


def _discs(
    mesh: gc.TriangleMesh,
    cortex: Longs,
    radius: float,
    workbench: "_Workbench | None",
    runs: int,
) -> list[str]:
    calls: dict[str, Callable[[], Any]] = {
        name: partial(
            gc.distance_matrix,
            mesh,
            cortex,
            max_distance=radius,
            layout="sparse",
            threads=1,
            **options,
        )
        for name, options in METHODS.items()
    }
    if workbench is not None:
        calls["Workbench"] = partial(workbench.all_to_all, radius)
    seconds, results = _by_turns(calls, runs)
    exact = results["exact"].tocoo()
    cells = _cells(seconds, len(cortex), AT_MOST if RADII[radius] else {})
    rest = ["", ""]
    if workbench is not None:
        theirs = workbench.matrix()[exact.row, exact.col]
        is_known = (exact.data > 0.0) & (theirs >= 0.0)
        rest = [
            _error(theirs[is_known], exact.data[is_known]),
            _memory(workbench.distances(radius), results["Workbench"]),
        ]
    return [f"within {radius:g} mm", f"{exact.nnz / len(cortex):.0f}", *cells, *rest]


def _whole(
    mesh: gc.TriangleMesh, cortex: Longs, workbench: "_Workbench | None", runs: int
) -> list[str]:
    some = cortex[:: len(cortex) // ROWS][:ROWS]
    calls: dict[str, Callable[[], Any]] = {
        name: partial(gc.distance_matrix, mesh, some, cortex, threads=1, **options)
        for name, options in METHODS.items()
    }
    seconds, results = _by_turns(calls, runs)
    rest = ["", ""]
    if workbench is not None:  # all rows, once
        whole, peaks = _by_turns({"Workbench": partial(workbench.all_to_all, math.inf)}, 1)
        seconds |= {"Workbench": whole["Workbench"] * ROWS / len(cortex)}
        exact = results["exact"]
        theirs = workbench.matrix()[:: len(cortex) // ROWS][:ROWS]
        is_known = exact > 0.0
        rest = [_error(theirs[is_known], exact[is_known]), f"–, {peaks['Workbench']:,.0f}"]
    return ["whole rows", f"{len(cortex):,}", *_cells(seconds, ROWS, {}), *rest]


def _parcels(mesh: gc.TriangleMesh, cortex: Longs, workbench: "_Workbench") -> list[str]:
    """Return the row of mean distances of parcels: a sweep of each vertex, once."""
    region = gc.brain.load_cortex({"right": mesh}, cortex, "passes")
    parcels = gc.brain.load_parcels(1 + gc.farthest_points(mesh, PARCELS).nearest, region)
    gc.brain.write_labels(workbench.folder / "parcels.dlabel.nii", parcels)
    calls: dict[str, Callable[[], Any]] = {
        name: partial(
            gc.brain.parcel_distances, parcels, workbench.folder / name, threads=1, **options
        )
        for name, options in METHODS.items()
        if name != "approximate"
    }
    seconds, results = _by_turns(calls | {"Workbench": workbench.parcellate}, 1)
    exact = results["exact"].mean
    theirs = brain.load(workbench.folder / "mean.pconn.nii").get_fdata()
    memory = _memory(workbench.parcels(), results["Workbench"])
    cells = _cells(seconds | {"approximate": math.nan}, len(cortex), {})
    return [
        f"means of {len(parcels.names)} parcels",
        f"{len(cortex):,}",
        *cells,
        _error(theirs, exact),
        memory,
    ]


def _error(found: Floats, exact: Floats) -> str:
    """Return the mean and the largest error of distances above 0, as a share of them."""
    if not len(exact):
        return ""
    off = np.abs(found / exact - 1.0)
    return f"{off.mean():.2%}, {off.max():.1%}"


def _peak_mib(pid: int) -> float:
    """Return the most memory that a process has held so far; 0 where it has ended.

    That of resource usage counts what its parent held when it was started.
    """
    try:
        text = Path(f"/proc/{pid}/status").read_text()
    except OSError:
        return 0.0
    found = re.search(r"VmHWM:\s*(\d+) kB", text)
    return float(found[1]) / 1024.0 if found else 0.0


def _memory(ours: float, theirs: float) -> str:
    return f"{ours:,.0f}, {theirs:,.0f}"


def _symmetric(mesh: gc.TriangleMesh, cortex: Longs) -> list[str]:
    """Return the row of all pairs of every tenth vertex, as a share of those of two equal sets."""
    some = cortex[::10]
    cells = []
    for options in METHODS.values():
        ask = partial(gc.distance_matrix, mesh, some, threads=1, **options)
        seconds, _ = _by_turns({"own": ask, "square": partial(ask, some[::-1])}, 1)
        cells.append(f"{seconds['own'] / seconds['square']:.2f} ×")
    return ["one set, of the full square", f"{len(some):,}", *cells, ""]


def _by_turns(
    calls: dict[str, Callable[[], Any]], runs: int
) -> tuple[dict[str, float], dict[str, Any]]:
    """Return the median processor seconds of calls by turns, those of processes included."""
    seconds: dict[str, list[float]] = {name: [] for name in calls}
    results: dict[str, Any] = {}
    for _ in range(runs):
        for name, call in calls.items():
            began = _all_processor_s()
            results[name] = call()
            seconds[name].append(_all_processor_s() - began)
    return {name: median(some) for name, some in seconds.items()}, results


def _all_processor_s() -> float:
    own, ended = (
        resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    )
    return own.ru_utime + own.ru_stime + ended.ru_utime + ended.ru_stime


def _cells(seconds: dict[str, float], sources: int, limits: dict[str, float]) -> list[str]:
    """Return the microseconds of each method for a source, and its multiple of Workbench's time."""
    peer = seconds.get("Workbench", math.nan)
    cells = []
    for name in METHODS:
        if math.isnan(seconds[name]):
            cells.append("")
            continue
        cell = f"{1e6 * seconds[name] / sources:,.0f}"
        if not math.isnan(peer):
            cell += f" ({seconds[name] / peer:.2f} ×"
            if name in limits:
                cell += f", {verdict(seconds[name] / peer, limits[name], at_least=False)}"
            cell += ")"
        cells.append(cell)
    return [*cells, "absent" if math.isnan(peer) else f"{1e6 * peer / sources:,.0f}"]


class _Workbench:
    """Connectome Workbench, whose surface and region are files."""

    def __init__(self, folder: Path, mesh: gc.TriangleMesh, cortex: Longs) -> None:
        self.folder = folder
        inside = np.zeros(len(mesh.vertices), np.float32)
        inside[cortex] = 1.0
        self._save(
            "white.surf.gii",
            (mesh.vertices.astype(np.float32), "NIFTI_INTENT_POINTSET"),
            (mesh.faces.astype(np.int32), "NIFTI_INTENT_TRIANGLE"),
        )
        self._save("cortex.shape.gii", (inside, "NIFTI_INTENT_SHAPE"))

    def _save(self, name: str, *arrays: tuple[Any, str]) -> None:
        parts = [brain.gifti.GiftiDataArray(values, intent=intent) for values, intent in arrays]
        image = brain.gifti.GiftiImage(darrays=parts)
        for table in (image.meta, parts[0].meta):
            table["AnatomicalStructurePrimary"] = "CortexRight"
        brain.save(image, self.folder / name)

    def _run(self, command: str, *arguments: str) -> float:
        """Run a command, and return its peak of memory, MiB."""
        call = [
            command,
            *(str(self.folder / a) if a[0].isalpha() and "." in a else a for a in arguments),
        ]
        environment = os.environ | {"OMP_NUM_THREADS": "1"}
        nowhere = subprocess.DEVNULL
        child = subprocess.Popen(call, env=environment, stdout=nowhere, stderr=nowhere)
        peak = 0.0
        while child.poll() is None:
            peak = max(peak, _peak_mib(child.pid))
            time.sleep(PERIOD_S)
        if child.returncode:
            raise SystemExit(f"cortex: {' '.join(call)} failed")
        return peak

    def matrix(self) -> Floats:
        """Return the distances that were written last, -1 for those beyond a limit."""
        values: Floats = np.asarray(brain.load(self.folder / "near.dconn.nii").dataobj)
        return values

    def distances(self, radius: float) -> float:
        """Return the peak of memory of our command for the distances within a radius, MiB."""
        limit = ["--limit", f"{radius:g}", "--out", "near.npz"]
        return self._run(GEODESIC, "cortex", "distances", *self._region(), *limit)

    def parcels(self) -> float:
        """Return the peak of memory of our command for parcels, MiB: fast, as it is no less."""
        wanted = ["--labels", "parcels.dlabel.nii", "--out", "by.command", "--method", "fast"]
        return self._run(GEODESIC, "cortex", "parcels", *self._region(), *wanted)

    def _region(self) -> list[str]:
        return ["white.surf.gii", "--roi", "cortex.shape.gii", "--wall", "passes", "--threads", "1"]

    def parcellate(self) -> float:
        """Write the means of parcels, by the distances of all rows."""
        peaks = [self.all_to_all(math.inf)]
        names = "near.dconn.nii", "parcels.dlabel.nii"
        peaks.append(self._run(COMMAND, "-cifti-parcellate", *names, "COLUMN", "half.pdconn.nii"))
        names = "half.pdconn.nii", "parcels.dlabel.nii"
        peaks.append(self._run(COMMAND, "-cifti-parcellate", *names, "ROW", "mean.pconn.nii"))
        return max(peaks)

    def all_to_all(self, radius: float) -> float:
        """Write all distances within a radius, and -1 elsewhere; return the peak, MiB."""
        limit = [] if math.isinf(radius) else ["-limit", f"{radius:g}"]
        return self._run(
            COMMAND,
            "-surface-geodesic-distance-all-to-all",
            "white.surf.gii",
            "near.dconn.nii",
            *limit,
            "-roi",
            "cortex.shape.gii",
        )
