"""Tables of benchmark results in the documents: taken from `benchmarks` when the site is built.

A document asks for one by a fence, which names a file, a section of it, rows by their first cells,
and columns::

    ```{results} RESULTS.md # Cortex
    rows: within 10 mm; whole rows
    columns: distances; exact; Workbench
    ```
"""

import re
from pathlib import Path

from benchmarks.tables import read

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"
FENCE = re.compile(r"```\{results\} (\S+) # (.+)\n((?:\w+: .+\n)+)```")
TARGET = re.compile(r",? ?[≤≥] [^,)|]+ (?:met|\*\*missed\*\*)")
"""Of benchmarks, which documents for users leave out."""


def with_results(text: str) -> str:
    """Return the text of a document with tables in place of its fences.

    Raises
    ------
    LookupError
        There is no such section, row or column.
    """
    return FENCE.sub(_table, text)


def _table(fence: re.Match[str]) -> str:
    path, title, lines = fence.groups()
    options = {name: wanted.split("; ") for name, wanted in re.findall(r"(\w+): (.+)", lines)}
    machine, columns, rows = read(BENCHMARKS / path, title)
    places = [columns.index(name) for name in options["columns"]]
    found = []
    for wanted in options["rows"]:
        matching = [row for row in rows if row[0] == wanted]
        if not matching:
            raise LookupError(f"{path}, {title}: no row {wanted}")
        found += matching
    shown = [options["columns"], ["---"] * len(places)]
    shown += [[_without_target(row[place]) for place in places] for row in found]
    table = "\n".join(f"| {' | '.join(row)} |" for row in shown)
    return f"{table}\n\nMeasured: {machine}."


def _without_target(cell: str) -> str:
    return TARGET.sub("", cell).replace(" ()", "").strip()
