"""Sections of ``RESULTS.md``: a title, the machine, a table and notes; written and read."""

import datetime as dt
import os
import platform
import re
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

HEADING = "# Benchmarks\n\nWritten by `python -m benchmarks`; each section says where it ran.\n"


@dataclass(frozen=True)
class Section:
    """One table of results."""

    title: str
    about: str
    columns: Sequence[str]
    rows: Sequence[Sequence[str]]

    def text(self) -> str:
        """Return the section as Markdown."""
        lines = [f"## {self.title}", "", self.about, "", f"_{machine()}_", ""]
        return "\n".join([*lines, table(self.columns, self.rows), ""])


def table(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table as Markdown, numbers to the right of a first column of names."""
    rule = ["---"] + ["---:"] * (len(columns) - 1)
    return "\n".join(map(_row, [columns, rule, *rows]))


def write(section: Section, path: Path) -> None:
    """Write the section into the file, replacing a section of the same title."""
    text = path.read_text(encoding="utf-8") if path.exists() else HEADING
    heading, *sections = text.split("\n## ")
    by_title = {part.split("\n", 1)[0]: part.rstrip() for part in sections}
    by_title[section.title] = section.text().removeprefix("## ").rstrip()
    path.write_text("\n\n## ".join([heading.rstrip(), *by_title.values()]) + "\n", encoding="utf-8")


def read(path: Path, title: str) -> tuple[str, list[str], list[list[str]]]:
    """Return the machine, the columns and the rows of a section that was written.

    Raises
    ------
    LookupError
        The file has no such section.
    """
    text = path.read_text(encoding="utf-8")
    for section in re.split(r"(?m)^##? ", text):
        if section.startswith(f"{title}\n"):
            (machine_then,) = re.findall(r"(?m)^_(\d{4}-.*)_$", section)
            lines = [line for line in section.splitlines() if line.startswith("|")]
            columns, _, *rows = ([cell.strip() for cell in line[1:-1].split("|")] for line in lines)
            return machine_then, columns, rows
    raise LookupError(f"{path.name} has no section {title}")


def machine() -> str:
    """Return the processor, its cores, and the versions that matter."""
    names = ("numpy", "numba", "pygeodesic", "potpourri3d", "meshlib")
    packages = [f"{name} {_version(name)}" for name in names]
    today = dt.datetime.now(dt.UTC).date().isoformat()
    parts = [
        today,
        f"{processor()}, {os.cpu_count()} cores",
        f"Python {platform.python_version()}",
        *packages,
    ]
    return ", ".join(parts)


def verdict(value: float, target: float, *, at_least: bool, unit: str = "") -> str:
    """Return a target and whether it is met, for the last column of a table."""
    met = value >= target if at_least else value <= target
    return f"{'≥' if at_least else '≤'} {target:g}{unit} {'met' if met else '**missed**'}"


def rated(value: float, target: float | None, *, at_least: bool, digits: int = 2) -> str:
    """Return a value, with its target and whether it is met, where there is one."""
    beside = "" if target is None else f" ({verdict(value, target, at_least=at_least)})"
    return f"{value:.{digits}f}{beside}"


def _row(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "absent"


def processor() -> str:
    """Return the name of the processor."""
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        for line in cpuinfo.read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    return platform.processor() or platform.machine()
