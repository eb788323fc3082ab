"""Ownership of a store, and its layout."""

import os
import sqlite3
import subprocess
import sys
from pathlib import Path

import pytest

from app.state import require_intact
from app.store.layout import LAYOUT, StoreError
from app.store.ownership import owned
from tests.support.paths import ROOT


def test_a_store_belongs_to_one_at_a_time(tmp_path: Path) -> None:
    root = tmp_path / "new" / "store"
    busy = pytest.raises(StoreError, match=r"store is in use by another process.*GEODESIC_STORE")
    with owned(root), busy:
        owned(root).__enter__()
    with owned(root):
        pass


@pytest.mark.slow
def test_the_lock_goes_with_its_process_however_that_ends(tmp_path: Path) -> None:
    script = "import sys; from pathlib import Path; from app.store.ownership import owned\n"
    script += "with owned(Path(sys.argv[1])): print('owned', flush=True); sys.stdin.read()"
    owner = subprocess.Popen(  # noqa: S603 - this Python, and the text above
        [sys.executable, "-c", script, str(tmp_path)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        cwd=ROOT,
    )
    with owner:
        assert owner.stdout is not None
        assert owner.stdout.readline() == b"owned\n"
        with pytest.raises(StoreError, match="in use"):
            owned(tmp_path).__enter__()
        owner.kill()
        owner.wait()
        with owned(tmp_path):
            pass


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_a_folder_that_cannot_be_written_is_refused(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    with pytest.raises(StoreError, match="cannot be written: Permission denied"):
        owned(tmp_path / "store").__enter__()


def test_a_file_is_no_store(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(StoreError, match="cannot be written: "):
        owned(tmp_path / "file").__enter__()


def test_a_new_store_has_the_number_of_its_layout(tmp_path: Path) -> None:
    with owned(tmp_path):
        pass

    assert (tmp_path / "VERSION").read_text() == f"{LAYOUT}\n"
    assert {path.name for path in tmp_path.iterdir()} == {"VERSION", "lock"}


@pytest.mark.parametrize("written", ["3", "6", "8", "7.1", "", "five", "-5"])
def test_another_layout_is_refused(tmp_path: Path, written: str) -> None:
    (tmp_path / "VERSION").write_text(written)

    refused = rf"has layout {written}, but this release reads 7: use the release that wrote it"
    with pytest.raises(StoreError, match=refused):
        owned(tmp_path).__enter__()
    assert (tmp_path / "VERSION").read_text() == written


def test_a_store_without_a_number_is_refused(tmp_path: Path) -> None:
    """Layouts up to 4 had none."""
    (tmp_path / "meshes").mkdir()
    with pytest.raises(StoreError, match="has layout 4 or older, but this release reads 7"):
        owned(tmp_path).__enter__()


def test_a_damaged_job_database_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "jobs.sqlite3"
    require_intact(path)
    with sqlite3.connect(path) as database:
        database.execute("CREATE TABLE jobs (record TEXT)")
        database.executemany("INSERT INTO jobs VALUES (?)", [("x" * 1000,)] * 100)
    database.close()
    require_intact(path)
    content = path.read_bytes()
    for damaged in (b"no database" * 100, content[:20000] + bytes(9000) + content[29000:]):
        path.write_bytes(damaged)
        with pytest.raises(StoreError, match=r"jobs.sqlite3 is damaged .*: move it away"):
            require_intact(path)
