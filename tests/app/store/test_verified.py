"""Checksums of files: right whenever the file has changed, and not read in vain."""

import os
import time
import zlib
from pathlib import Path

import pytest

from app.store import verified
from app.store.verified import checksum_of, read_checksum
from tests.support.faults import FAULTS

CONTENT = b"'shape': (1234567, 3)" + bytes(range(256)) * 5000


@pytest.fixture
def reads(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Paths of the files that were read, in order."""
    paths = []

    def read_noted(path: str) -> int | None:
        paths.append(path)
        return read_checksum(path)

    monkeypatch.setattr(verified, "read_checksum", read_noted)
    return paths


@pytest.mark.parametrize("content", [b"", b"x", CONTENT])
def test_it_is_that_of_the_whole_file(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "file"
    path.write_bytes(content)
    assert checksum_of(str(path)) == read_checksum(str(path)) == zlib.crc32(content)


def test_there_is_none_of_a_missing_file(tmp_path: Path) -> None:
    assert checksum_of(str(tmp_path / "file")) is None
    assert read_checksum(str(tmp_path / "file")) is None


def test_an_unchanged_file_is_read_once(tmp_path: Path, reads: list[str]) -> None:
    path = tmp_path / "file"
    path.write_bytes(CONTENT)
    for _ in range(3):
        assert checksum_of(str(path)) == zlib.crc32(CONTENT)
    assert reads == [str(path)]
    os.utime(path)
    assert checksum_of(str(path)) == zlib.crc32(CONTENT)
    assert reads == [str(path)] * 2


@pytest.mark.parametrize("fault", FAULTS.values(), ids=FAULTS.keys())
def test_every_change_is_noticed(tmp_path: Path, fault) -> None:
    path = tmp_path / "file"
    path.write_bytes(CONTENT)
    before = checksum_of(str(path))

    fault(path)

    assert checksum_of(str(path)) != before
    assert checksum_of(str(path)) == read_checksum(str(path))


def test_a_change_in_the_same_tick_of_the_clock_cannot_come_after_the_reading(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, reads: list[str]
) -> None:
    """Before the file is read, the tick passes in which another change would have the same time."""
    path = tmp_path / "file"
    path.write_bytes(b"first")
    slept = []

    def change_while_asleep(seconds: float) -> None:
        assert reads == []
        slept.append(seconds)
        path.write_bytes(b"later")

    monkeypatch.setattr(time, "sleep", change_while_asleep)
    monkeypatch.setattr(time, "time_ns", lambda: path.stat().st_ctime_ns + 4_000_000)

    assert checksum_of(str(path)) == zlib.crc32(b"later")
    assert slept == [0.006]


def test_the_wait_is_short_though_the_clock_was_set_back_by_years(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "file"
    path.write_bytes(CONTENT)
    ten_years_ago = time.time_ns() - 10 * 365 * 86_400 * 10**9
    slept: list[float] = []
    monkeypatch.setattr(time, "sleep", slept.append)
    monkeypatch.setattr(time, "time_ns", lambda: ten_years_ago)

    for _ in range(3):
        assert checksum_of(str(path)) == zlib.crc32(CONTENT)
    assert slept == [0.01]


def test_what_says_nothing_about_the_file_is_raised(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "file"
    path.write_bytes(b"x")
    monkeypatch.setattr("builtins.open", lambda *_: os.open(tmp_path, os.O_WRONLY))
    with pytest.raises(IsADirectoryError):
        read_checksum(str(path))
