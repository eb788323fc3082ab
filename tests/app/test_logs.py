"""The log as it is written: one line for each event, in either format."""

import os
import pty
import subprocess
import sys
from typing import Any

import orjson
import pytest

from tests.support.paths import ROOT

BEGIN = """
import logging, os, sys, warnings
from pathlib import Path
import structlog
from app import logs
"""


def written_by(script: str, log_format: str | None = "json") -> str:
    """Return what a script writes to standard error, which is no terminal."""
    program = (
        f"{BEGIN}\nlogs.install({log_format!r})\nlog = structlog.get_logger(module='m')\n{script}"
    )
    ran = subprocess.run(  # noqa: S603 - this Python, and our own script
        [sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert ran.stdout == ""
    return ran.stderr


def objects_in(text: str) -> list[dict[str, Any]]:
    return [orjson.loads(line) for line in text.splitlines()]


@pytest.mark.slow
@pytest.mark.parametrize("log_format", ["json", None])
def test_a_line_is_an_object_where_nobody_reads_along(log_format: str | None) -> None:
    (line,) = objects_in(written_by("log.warning('worker lost', pid=7, why='a\\nb')", log_format))

    assert line.pop("timestamp").endswith("Z")
    assert line == {
        "event": "worker lost",
        "level": "warning",
        "module": "m",
        "pid": 7,
        "why": "a\nb",
    }


def test_a_terminal_gets_text() -> None:
    ours, theirs = pty.openpty()
    program = f"{BEGIN}\nlogs.install(None)\nstructlog.get_logger().info('started', port=8000)"
    with os.fdopen(ours, "rb") as terminal, os.fdopen(theirs, "wb") as stderr:
        subprocess.run(  # noqa: S603 - this Python, and our own script
            [sys.executable, "-c", program], cwd=ROOT, stderr=stderr, check=True
        )
        line = terminal.readline()

    assert b"started" in line
    assert b"8000" in line
    assert not line.startswith(b"{")


def test_text_obeys_no_client_and_leaves_out_what_is_not_there() -> None:
    script = "log.info('request', path='/a\\x1b[2J', why='b\\nc', mesh_id=None)\n"
    script += "logging.getLogger('library').info('d\\n\\x1b[2J')"
    text = written_by(script, "text")

    assert text.count("\n") == 2
    assert "\x1b" not in text
    assert "path=/a\\x1b[2J why=b\\nc" in text
    assert "mesh_id" not in text


@pytest.mark.slow
@pytest.mark.parametrize("log_format", ["json", "text"])
def test_tracebacks_do_not_show_the_values_of_variables(log_format: str) -> None:
    script = """
def check(secret):
    raise ValueError("wrong")
try:
    check(secret="".join(["abcdef", "0123456789"]))
except ValueError:
    log.exception("failed")
    logging.getLogger("library").exception("failed")
"""
    text = written_by(script, log_format)

    assert text.count("ValueError: wrong") == 2
    assert "abcdef0123456789" not in text


def test_other_loggers_and_warnings_are_written_alike() -> None:
    script = """
for level in (logging.DEBUG, logging.INFO, 25, logging.ERROR, 60):
    logging.getLogger("library").log(level, "level %d", level)
warnings.warn("old")
"""
    *lines, warning = objects_in(written_by(script))

    assert [(line["event"], line["level"]) for line in lines] == [
        ("level 20", "info"),
        ("level 25", "info"),
        ("level 40", "error"),
        ("level 60", "critical"),
    ]
    assert {line["module"] for line in lines} == {"library"}
    assert (warning["module"], warning["level"]) == ("py.warnings", "warning")
    assert "UserWarning: old" in warning["event"]


def test_what_is_no_text_does_not_break_the_line() -> None:
    script = "name = os.fsdecode(b'a\\xff')\n"
    script += "log.info('e', path=Path(name), name=name, error=ValueError('no'), pid=7)"
    (line,) = objects_in(written_by(script))

    assert (line["path"], line["name"], line["error"], line["pid"]) == ("a?", "a?", "no", 7)


@pytest.mark.slow
@pytest.mark.parametrize("log_format", ["json", "text"])
def test_a_log_that_cannot_be_written_stops_nothing(log_format: str) -> None:
    script = f"""
logs.install({log_format!r}, open("/dev/full", "w"))
log.warning("lost")
logging.getLogger("library").warning("lost")
os.write(2, b"goes on")
os._exit(0)
"""
    assert written_by(script) == "goes on"
