"""The parts of the page, as they are served."""

import gzip
import json
import re
import subprocess
import sys
from collections.abc import Iterator

import httpx2
import pytest

from tests.support.paths import ROOT

MOST_SCRIPT = 300_000


def scripts_of(service: str, address: str, seen: set[str]) -> Iterator[bytes]:
    """Yield a script, and all that it imports before it runs."""
    if address in seen:
        return
    seen.add(address)
    response = httpx2.get(service + address)
    assert "immutable" in response.headers["cache-control"]
    yield response.content
    for imported in re.findall(r"""(?:from|import)\s*["']\./([^"']+)["']""", response.text):
        yield from scripts_of(service, f"/assets/{imported}", seen)


def test_the_page_begins_with_little_script(service: str) -> None:
    page = httpx2.get(service, headers={"Accept": "text/html"}).text
    seen: set[str] = set()
    first = re.findall(r'(?:src|href)="\.(/assets/[^"]+\.js)"', page)
    scripts = [script for each in first for script in scripts_of(service, each, seen)]

    assert scripts
    assert sum(len(gzip.compress(script)) for script in scripts) <= MOST_SCRIPT


def test_the_page_loads_nothing_from_elsewhere(service: str) -> None:
    page = httpx2.get(service, headers={"Accept": "text/html"}).text

    assert re.findall(r'(?:src|href)="(?!\./)', page) == []


@pytest.mark.usefixtures("service")
def test_the_page_was_built_from_the_sources_as_they_are() -> None:
    program = "import hatch_build, pathlib; print(hatch_build.is_fresh(pathlib.Path()))"
    told = subprocess.run(  # noqa: S603 - this Python, and the text above
        [sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True
    )

    assert told.stdout.strip() == "True", "scripts/page builds it"


@pytest.mark.usefixtures("service")
def test_the_page_carries_the_licences_of_its_packages() -> None:
    sources = "".join(path.read_text() for path in (ROOT / "app/web/src").rglob("*.ts"))
    imported = set(re.findall(r"""(?:from|import)\s*\(?["']([a-z][a-z0-9-]*)""", sources))
    text = (ROOT / "app/web/dist/licences.md").read_text()
    told = set(re.findall(r"^## (\S+) - ", text, re.MULTILINE))

    assert {"three", "d3-scale-chromatic"} <= imported
    assert imported - {"geodesic-client"} <= told


def test_all_packages_are_locked_to_their_content() -> None:
    lock = json.loads((ROOT / "app/web/package-lock.json").read_text())
    packages = {name: each for name, each in lock["packages"].items() if name}

    assert packages
    assert all("integrity" in each for each in packages.values())
    wanted = json.loads((ROOT / "app/web/package.json").read_text())["devDependencies"]
    assert lock["packages"][""]["devDependencies"] == wanted
    assert all(re.fullmatch(r"[\d.]+", version) for version in wanted.values())
