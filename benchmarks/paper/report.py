"""Reports of experiments: a text in Markdown, and a picture beside it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from matplotlib.figure import Figure

from benchmarks.tables import machine, table

RESULTS = Path(__file__).parents[1] / "results"


@dataclass(frozen=True)
class Report:
    """An experiment's table, and its plot."""

    name: str
    """Of the files, without suffix"""
    title: str
    about: str
    columns: Sequence[str]
    rows: Sequence[Sequence[str]]
    figure: Figure | None = None


def write_report(report: Report, command: str, folder: Path = RESULTS) -> str:
    """Write a report into a folder; return its text."""
    parts = [f"# {report.title}", f"Written by `{command}`.", report.about, f"_{machine()}_"]
    if report.figure is not None:
        picture = folder / f"{report.name}.png"
        report.figure.savefig(picture, dpi=110, bbox_inches="tight", metadata={"Software": None})
        parts.append(f"![{report.title}]({picture.name})")
    parts.append(table(report.columns, report.rows))
    text = "\n\n".join(parts) + "\n"
    (folder / f"{report.name}.md").write_text(text, encoding="utf-8")
    return text


def beside(value: float, published: float | None, digits: int) -> str:
    """Return a number, or a dash where there is none, and the paper's in parentheses."""
    ours = "–" if math.isnan(value) else f"{value:.{digits}f}"
    return ours if published is None else f"{ours} ({published:.{digits}f})"
