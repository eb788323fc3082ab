"""The table of `geodesic batch` as a file."""

import csv
from collections.abc import Sequence
from dataclasses import asdict, fields
from io import StringIO
from pathlib import Path
from typing import get_args, get_type_hints

from app.cli import files
from app.cli.batch_rows import Row


def write_table(path: Path, rows: Sequence[Row]) -> None:
    """Write a table in the format that the suffix of a path names."""
    if path.suffix.lower() == ".csv":
        files.write_file(path, [csv_of(rows)])
    else:
        files.write_file(path, [_parquet_of(rows)])


def csv_of(rows: Sequence[Row]) -> bytes:
    """Return a table in CSV."""
    text = StringIO(newline="")
    table = csv.DictWriter(text, [field.name for field in fields(Row)], lineterminator="\n")
    table.writeheader()
    table.writerows(map(asdict, rows))
    return text.getvalue().encode()


def _parquet_of(rows: Sequence[Row]) -> memoryview:
    try:
        import pyarrow as pa
        import pyarrow.parquet as pq
    except ModuleNotFoundError as error:
        from geodesic_core.errors import MissingExtra

        raise MissingExtra("a table in Parquet", "PyArrow", "tables") from error
    types = {float: pa.float64(), int: pa.int64(), str: pa.string()}
    columns = [
        (name, types[(*get_args(kind), kind)[0]]) for name, kind in get_type_hints(Row).items()
    ]
    sink = pa.BufferOutputStream()
    pq.write_table(pa.Table.from_pylist([asdict(row) for row in rows], pa.schema(columns)), sink)
    return memoryview(sink.getvalue())
