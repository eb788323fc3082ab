"""Tables that documents take from the results of benchmarks."""

import pytest

from docs.results import FENCE, with_results
from tests.support.paths import ROOT

PAGES = [path for path in sorted((ROOT / "docs").rglob("*.md")) if FENCE.search(path.read_text())]


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.name)
def test_fences_of_documents_become_tables(page) -> None:
    text = with_results(page.read_text())
    assert "{results}" not in text
    assert "Measured: 2026-" in text


def test_a_table_has_the_rows_and_columns_that_were_asked_for() -> None:
    columns = "distances; Workbench; its error"
    fence = f"```{{results}} RESULTS.md # Cortex\nrows: whole rows\ncolumns: {columns}\n```"
    header, rule, row, *_ = with_results(f"before\n{fence}\nafter").splitlines()[1:]
    assert header == "| distances | Workbench | its error |"
    assert rule == "| --- | --- | --- |"
    assert row.startswith("| whole rows | ")
    assert row.count("|") == 4


def test_targets_of_benchmarks_are_left_out() -> None:
    fence = "```{results} RESULTS.md # Cortex\nrows: within 10 mm\ncolumns: exact\n```"
    assert "met" not in with_results(fence)


@pytest.mark.parametrize(
    ("title", "row"), [("Cortex", "within 7 mm"), ("Nonsense", "within 10 mm")]
)
def test_what_is_not_there_is_an_error(title: str, row: str) -> None:
    with pytest.raises(LookupError, match=row if title == "Cortex" else title):
        with_results(f"```{{results}} RESULTS.md # {title}\nrows: {row}\ncolumns: exact\n```")
