"""``geodesic docs``."""

import webbrowser
from pathlib import Path

import pytest

from app.cli import documents
from tests.support.commands import Run, error_line


@pytest.fixture
def opened(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    (tmp_path / "index.html").touch()
    (tmp_path / "howto").mkdir()
    (tmp_path / "howto" / "cortex.html").touch()
    addresses: list[str] = []
    monkeypatch.setattr(documents, "PLACES", (tmp_path / "absent", tmp_path))
    monkeypatch.setattr(webbrowser, "open", lambda address: not addresses.append(address))
    return addresses


def test_docs_opens_a_chapter(run: Run, opened: list[str], tmp_path: Path) -> None:
    assert run("docs").code == 0
    assert run("docs", "howto/cortex#files").code == 0
    chapter = (tmp_path / "howto" / "cortex.html").as_uri()
    assert opened == [(tmp_path / "index.html").as_uri(), f"{chapter}#files"]


def test_docs_only_tells_where(run: Run, opened: list[str], tmp_path: Path) -> None:
    assert run("docs", "--path").out.strip() == str(tmp_path / "index.html")
    assert opened == []


def test_docs_tells_that_a_chapter_or_all_is_missing(
    run: Run,
    opened: list[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert "no chapter nonsense" in error_line(run("docs", "nonsense"))
    monkeypatch.setattr(documents, "PLACES", ())
    assert "scripts/docs" in error_line(run("docs"))
    assert opened == []
