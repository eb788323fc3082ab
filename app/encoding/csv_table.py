"""CSV: a row under names for each value or point; cells without a value are empty."""

import csv
from collections.abc import Iterator
from io import StringIO
from itertools import islice

from app.encoding.answer import Answer, Buffer, Encoded
from app.encoding.headers import headers_of
from app.encoding.views import Table, table_of_lines

_ROWS = 2**12
"""Rows that are written at a time."""


def to_csv(answer: Answer) -> Encoded:
    """Encode the table, or the points of the lines."""
    table = answer.table
    if table is None:
        assert answer.lines is not None, "an answer in CSV has a table or lines"  # noqa: S101
        table = table_of_lines(answer.lines())
    return _written(table), headers_of(answer, answer.shown)


def _written(table: Table) -> Iterator[Buffer]:
    rows = table.rows()
    block: list[object] = [table.names]
    while block:
        text = StringIO()
        csv.writer(text, lineterminator="\n").writerows(block)  # type: ignore[arg-type]
        yield text.getvalue().encode()
        block = list(islice(rows, _ROWS))
