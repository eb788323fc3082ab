"""Sessions in the documents, with curl and `geodesic`, run as a reader would run them."""

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from tests.support.paths import ROOT
from tests.support.processes import Server

DOCUMENTS = ("tour.md", "http.md", "command-line.md")
"""In this order: the first makes the mesh that the others ask about."""
ELSEWHERE = "http://there"
"""The host in sessions that need other machines."""
ASSIGNMENT = re.compile(r"[A-Z]+=")
JOB = re.compile(r"/v1/jobs/([0-9a-f]{32})")
VARYING = (
    r'"created":"[^"]*"',
    r'"request_id":"[^"]*"',
    r'"progress": ?[\d.]+',
    r'"seconds":[\d.e-]+',
    r"dur=[\d.]+",
    r"\nid: \d+",
    r"took .*",
)
"""Parts of the output that differ from run to run."""
LONG_NUMBER = re.compile(r"-?\d+\.\d{9,}(?:e-?\d+)?")
NUMBER = r"(-?\d+\.\d+(?:e-?\d+)?)"
ROUNDING = 1e-12
"""By how much long numbers differ between processors: sines and cosines round differently."""

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(shutil.which("curl") is None, reason="to run it, install curl"),
]


def sessions() -> Iterator[tuple[str, str]]:
    """Yield the commands of the documents, each with the output that is shown."""
    text = "".join((ROOT / "docs" / name).read_text() for name in DOCUMENTS)
    for block in re.findall(r"```console\n(.*?)```", text, re.DOTALL):
        if ELSEWHERE in block:
            continue
        for part in re.split(r"(?m)^\$ ", block)[1:]:
            command, printed = re.fullmatch(r"(.*(?:\n    .*)*)\n([\s\S]*)", part).groups()  # type: ignore[union-attr]
            yield command, printed


def squeezed(text: str) -> str:
    """Return a text without the varying parts and without white space, since lines are wrapped."""
    for pattern in VARYING:
        text = re.sub(pattern, "", text)
    return re.sub(r"\s+", "", text)


def with_replacements(text: str, replaced: Mapping[str, str]) -> str:
    """Return a text of the documents as it is here: with this server, this command, these jobs."""
    for old, new in replaced.items():
        text = text.replace(old, new)
    return text


def check_printed(printed: str, expected: str) -> None:
    """Check an output against the one shown, in which ``…`` stands for anything."""
    text, place = squeezed(printed), 0
    *pieces, last = map(squeezed, expected.split("…"))
    patterns = [NUMBER.join(map(re.escape, LONG_NUMBER.split(piece))) for piece in pieces]
    patterns.append(NUMBER.join(map(re.escape, LONG_NUMBER.split(last))) + r"\Z")
    for piece, pattern in zip([*pieces, last], patterns, strict=True):
        # One after the other, each as early as may be: one pattern for all would try each way.
        found = re.compile(pattern).search(text, place)
        assert found, f"{piece!r} is not in {text[place : place + 3000]!r}"
        assert place > 0 or found.start() == 0, f"{text[:100]!r} is no {piece[:100]!r}"
        numbers = [float(number) for number in found.groups()]
        shown = [float(number) for number in LONG_NUMBER.findall(piece)]
        np.testing.assert_allclose(numbers, shown, rtol=ROUNDING, atol=ROUNDING)
        place = found.end()


def test_commands_print_what_the_documents_show(tmp_path: Path) -> None:
    geodesic = f"geodesic() {{ '{sys.executable}' -c 'from app.cli import main; main()' \"$@\"; }}"
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    known = [geodesic]
    with closing(Server(tmp_path / "store")) as server:
        replaced = {"http://127.0.0.1:8000": server.url, ".venv/bin/geodesic": "geodesic"}
        count = 0
        for written, shown in sessions():
            command = with_replacements(written, replaced)
            if ASSIGNMENT.match(command):
                known.append(command)
                continue
            ran = subprocess.run(  # noqa: S603 - our own document
                ["/bin/bash", "-c", "\n".join([*known, command])],
                cwd=tmp_path,
                env=environment,
                capture_output=True,
                text=True,
                check=True,
            )
            replaced |= zip(JOB.findall(shown), JOB.findall(ran.stdout), strict=False)
            expected = with_replacements(shown, replaced)
            check_printed(ran.stdout + ran.stderr, expected)
            count += 1
    assert count > 25
