"""Polygons of VTK's data sets; as a program, those of the file on standard input.

A damaged file can crash VTK's readers, or have them run on. So `vtk` runs this module in a process
of its own, which imports nothing else of the library and starts in half a second.
"""

import importlib
import json
import re
import sys
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

READY = "ready"
"""Line that the program writes before it reads the file. Its start may take long."""

_Longs = NDArray[np.int64]

_PIXEL = 8
_POLYGONS = (5, 7, 9)
"""VTK's numbers of triangles, polygons and quadrangles, whose points go around them."""
_BEZIER = (76, 77)
_HIDDEN_POINT, _DOUBLE_OR_HIDDEN_CELL = 2, 1 | 32
"""Flags of VTK's ghost arrays."""
_FILL = 0xFE
"""Byte with which glibc fills memory, as `FILLED_MEMORY` tells it to"""
FILLED_MEMORY = f"glibc.malloc.perturb={_FILL ^ 0xFF}:glibc.malloc.tcache_count=0"
"""Value of ``GLIBC_TUNABLES``; memory in caches of threads would not be filled"""
_LEGACY = b"# vtk DataFile"
_GRAVE = re.compile("Error reading|coordinates read")
"""What warnings say where VTK (9.7) goes on with memory that it has not filled"""
_PLACE = re.compile(r"^.*, line \d+\s|\w+ \(0x\w+\):?|for file:.*$", re.DOTALL)
"""What VTK's messages tell beside: the line of its source, the object, and a file without a name"""
_DATA_SETS = ("PolyData", "UnstructuredGrid", "StructuredGrid", "RectilinearGrid", "ImageData")
"""Types of XML files that have no other files"""
_XML_END = re.compile(rb"</VTKFile\s*>")


def polygons_of(data: Any) -> tuple[NDArray[np.float64], _Longs, _Longs, dict[str, int]]:
    """Return points, corners and sizes of a data set's polygons, and the number of other cells.

    The arrays are as those of `FileContents`; the number is by the name of the cells' type. Points
    keep their numbers, and polygons the order of the cells. Strips become triangles. Cells of
    higher order are split through their nodes as VTK does. The blocks of a composite data set
    follow each other.

    Raises
    ------
    ValueError
        There are cells whose points do not lie on the surface (Bézier), or that have too few points
        or some that do not exist.
    """
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkCommonDataModel import vtkGenericCell

    none = np.empty(0, np.int64)
    grid = _as_unstructured(data)
    if grid.GetNumberOfCells() == 0:
        return np.empty((0, 3)), none, none, {}
    points = vtk_to_numpy(grid.GetPoints().GetData()).astype(np.float64)
    cells = grid.GetCells()
    starts = vtk_to_numpy(cells.GetOffsetsArray()).astype(np.int64)
    corners = vtk_to_numpy(cells.GetConnectivityArray()).astype(np.int64)
    types = vtk_to_numpy(_types_of(grid))
    _check_points(starts, corners, len(points))
    shown = _shown_cells(grid, starts, corners)
    pieces = [(none, none, none)]  # by type: the cell of each polygon, its first corner, its size
    left_out: dict[str, int] = {}
    for kind in np.unique(types[shown]).tolist():
        chosen = np.flatnonzero((types == kind) & shown)
        first, sizes = starts[chosen], starts[chosen + 1] - starts[chosen]
        cell = vtkGenericCell.InstantiateCell(kind)
        if kind in _BEZIER:
            raise ValueError(
                "it has Bézier cells, whose points do not lie on the surface: triangulate it first"
            )
        if cell is None or cell.GetCellDimension() != 2:
            name = f"cells of type {kind}" if cell is None else _in_words(cell.GetClassName())
            left_out[name] = left_out.get(name, 0) + len(chosen)
            continue
        if kind == _PIXEL:
            _check_sizes(chosen, sizes, cell.GetNumberOfPoints())
            last = first[:, None] + [2, 3]
            corners[last] = corners[last[:, ::-1]]  # now they go around it
        elif kind not in _POLYGONS:
            chosen, triangles = _split(grid, chosen, starts, corners)
            first, sizes = len(corners) + 3 * np.arange(len(chosen)), np.full(len(chosen), 3)
            corners = np.concatenate([corners, triangles.ravel()])
        pieces.append((chosen, first, sizes))
    hidden = len(shown) - int(np.count_nonzero(shown))
    if hidden:
        left_out["hidden cells"] = hidden
    cell_of, first, sizes = (np.concatenate(parts) for parts in zip(*pieces, strict=True))
    order = np.argsort(cell_of, kind="stable")
    return points, _rows(first[order], sizes[order], corners), sizes[order], left_out


def _as_unstructured(data: Any) -> Any:
    """Return a data set, or the blocks of a composite one, as one unstructured grid."""
    from vtkmodules.vtkCommonDataModel import vtkCompositeDataSet, vtkUnstructuredGrid
    from vtkmodules.vtkFiltersCore import vtkAppendFilter

    if data.IsA("vtkUnstructuredGrid"):
        return data
    blocks = [data]
    if isinstance(data, vtkCompositeDataSet):
        each = data.NewIterator()
        blocks = []
        each.InitTraversal()
        while not each.IsDoneWithTraversal():
            blocks.append(each.GetCurrentDataObject())
            each.GoToNextItem()
    blocks = [block for block in blocks if block.IsA("vtkDataSet")]  # and no tables
    if not blocks:
        return vtkUnstructuredGrid()
    append = vtkAppendFilter()
    append.SetOutputPointsPrecision(1)  # double
    for block in blocks:
        append.AddInputData(block)
    append.Update()
    return append.GetOutput()


def _types_of(grid: Any) -> Any:
    try:
        return grid.GetCellTypes()
    except TypeError:  # before VTK 9.6, a method of another kind
        return grid.GetCellTypesArray()


def _check_points(starts: _Longs, corners: _Longs, count: int) -> None:
    """Refuse points that do not exist: VTK would read beyond its arrays."""
    bad = np.flatnonzero((corners < 0) | (corners >= count))
    if len(bad):
        cell = int(np.searchsorted(starts, bad[0], side="right")) - 1
        raise ValueError(
            f"cell {cell} has the point {corners[bad[0]]}, but points are numbered 0 to {count - 1}"
        )


def _check_sizes(cells: _Longs, sizes: _Longs, least: int) -> None:
    """Refuse cells with fewer points than their type has."""
    short = np.flatnonzero(sizes < least)
    if len(short):
        raise ValueError(
            f"cell {cells[short[0]]} has {sizes[short[0]]} points; its type has {least}"
        )


def _shown_cells(grid: Any, starts: _Longs, corners: _Longs) -> NDArray[np.bool_]:
    """Tell which cells are neither blanked nor repeat one of another piece."""
    from vtkmodules.util.numpy_support import vtk_to_numpy

    shown = np.ones(len(starts) - 1, bool)
    flags = grid.GetCellGhostArray()
    if flags is not None:
        shown &= vtk_to_numpy(flags) & _DOUBLE_OR_HIDDEN_CELL == 0
    flags = grid.GetPointGhostArray()
    if flags is not None:
        hidden = vtk_to_numpy(flags)[corners] & _HIDDEN_POINT != 0
        cell = np.repeat(np.arange(len(shown)), np.diff(starts))
        shown[cell[hidden]] = False
    return shown


def _split(grid: Any, chosen: _Longs, starts: _Longs, corners: _Longs) -> tuple[_Longs, _Longs]:
    """Return the triangles of cells, as VTK splits them: the cell of each, and its corners."""
    from vtkmodules.vtkCommonCore import vtkIdList

    ids, rows, cells = vtkIdList(), [], []
    for cell in chosen.tolist():
        own = corners[starts[cell] : starts[cell + 1]]
        grid.GetCell(cell).TriangulateLocalIds(0, ids)
        local = np.array([ids.GetId(i) for i in range(ids.GetNumberOfIds())], np.int64)
        _check_sizes(np.array([cell]), np.array([len(own)]), int(local.max(initial=-1)) + 1)
        rows.append(own[local].reshape(-1, 3))
        cells += [cell] * len(rows[-1])
    return np.array(cells, np.int64), np.concatenate(rows)


def _rows(starts: _Longs, sizes: _Longs, corners: _Longs) -> _Longs:
    """Return the corners of rows of these sizes, which begin at these places."""
    ends = np.cumsum(sizes)
    places: _Longs = np.arange(sizes.sum()) + np.repeat(starts - ends + sizes, sizes)
    return corners[places]


def _in_words(class_name: str) -> str:
    """Return the name of a type of cells: ``vtkQuadraticEdge`` as ``quadratic edge cells``."""
    return re.sub(r"(?<=.)([A-Z])", r" \1", class_name.removeprefix("vtk")).lower() + " cells"


def read_file(content: bytes) -> Any:
    """Return the data set in a file: a legacy one, or XML of any type that has no other files.

    Raise ValueError where VTK reports an error.
    """
    from vtkmodules.vtkCommonCore import vtkOutputWindow, vtkStringOutputWindow

    if not content.startswith(_LEGACY) and not _XML_END.search(content[-1000:]):
        raise ValueError("it ends before </VTKFile>")
    reader = _reader_of(content)
    errors: list[str] = []

    def note_error(_window: Any, event: str, text: str | None) -> None:
        text = text or "its text is damaged"  # VTK hands on none that is no UTF-8
        if event == "ErrorEvent" or _GRAVE.search(text):
            errors.append(" ".join(_PLACE.sub("", text).split()))

    note_error.CallDataType = "string0"  # type: ignore[attr-defined]  # VTK then hands on the text
    # Of all objects: the reader of a legacy file has others read it, and hands on no error.
    window: Any = vtkStringOutputWindow()
    before = vtkOutputWindow.GetInstance()
    for event in ("ErrorEvent", "WarningEvent"):
        window.AddObserver(event, note_error)
    vtkOutputWindow.SetInstance(window)
    try:
        reader.Update()
    finally:
        vtkOutputWindow.SetInstance(before)
    data = reader.GetOutputDataObject(0)
    if errors or data is None:
        raise ValueError(errors[0] if errors else "VTK reads nothing from it")
    if data.IsA("vtkRectilinearGrid"):
        axes = (data.GetXCoordinates(), data.GetYCoordinates(), data.GetZCoordinates())
        counts, sides = [axis.GetNumberOfTuples() for axis in axes], list(data.GetDimensions())
        if counts != sides:
            raise ValueError(f"it has {counts} coordinates, but {sides} points")
    return data


def _reader_of(content: bytes) -> Any:
    if content.startswith(_LEGACY):
        from vtkmodules.vtkIOLegacy import vtkDataSetReader

        reader: Any = vtkDataSetReader()
        reader.SetBinaryInputString(content, len(content))
        reader.ReadFromInputStringOn()
        return reader
    from vtkmodules import vtkIOXML

    found = re.search(rb"<VTKFile\b[^>]*?\btype\s*=\s*[\"'](\w+)", content)
    kind = found[1].decode() if found else ""
    make: Any = getattr(vtkIOXML, f"vtkXML{kind}Reader", None)
    if kind not in _DATA_SETS or make is None:
        raise ValueError(
            f"its type is {kind!r}; it must be one of {', '.join(_DATA_SETS)}, or a legacy file"
        )
    xml_reader = make()
    xml_reader.ReadFromInputStringOn()
    xml_reader.SetInputString(content)
    return xml_reader


def _answer(content: bytes, out: BinaryIO) -> None:
    """Write the polygons of a file: a line of JSON, then arrays in numpy's format."""
    try:
        points, corners, sizes, left_out = polygons_of(read_file(content))
        _check_filled(points)
    except ValueError as error:
        out.write(json.dumps({"error": str(error)}).encode() + b"\n")
        return
    out.write(json.dumps({"left_out": left_out}).encode() + b"\n")
    for array in (points, corners, sizes):
        np.save(out, array)


def _check_filled(points: NDArray[np.float64]) -> None:
    """Refuse points that VTK has left as the memory was.

    Of a damaged file it may give such points without an error (9.7). With glibc they are numbers
    that begin with `_FILL` twice: far below all coordinates, of four bytes and of eight.
    """
    for size in (4, 8):
        ends = [bytes([_FILL, _FILL]).rjust(size, bytes([end])) for end in (0, 0xFF)]
        high, low = (np.frombuffer(end, f"<f{size}")[0] for end in ends)
        if ((low <= points) & (points <= high)).any():
            raise ValueError("it is damaged: VTK finds no values for some points")


def _limit(seconds: int, memory: int) -> None:
    """End this process where it takes more processor time, should no one else, or memory."""
    try:
        import resource
    except ImportError:  # Windows
        return
    for kind, most in ((resource.RLIMIT_CPU, seconds), (resource.RLIMIT_AS, memory)):
        _, hard = resource.getrlimit(kind)
        allowed = most if hard == resource.RLIM_INFINITY else min(most, hard)
        resource.setrlimit(kind, (allowed, hard))


if __name__ == "__main__":
    _limit(*map(int, sys.argv[1:]))
    for name in ("FiltersCore", "IOLegacy", "IOXML"):
        importlib.import_module(f"vtkmodules.vtk{name}")
    print(READY, flush=True)  # noqa: T201
    _answer(sys.stdin.buffer.read(), sys.stdout.buffer)
