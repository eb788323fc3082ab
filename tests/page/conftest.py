"""The page in a real browser, drawn by software, over a real service."""

import os
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import httpx2
import pytest
from playwright.sync_api import Browser, Page, sync_playwright

from app.http import page as built
from tests.support.paths import ROOT
from tests.support.viewing import View

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
FLAGS = [
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-gpu-compositing",  # WebGL is drawn as the GPU would, the rest of the page is not
    "--no-sandbox",
]
SERVE = "from app.cli import main; main()"


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    """A browser of the module: its event loop would be in the way of other tests."""
    executable = next(filter(None, map(shutil.which, BROWSERS)), None)
    missing = []
    if executable is None:
        missing.append(f"no browser is found: {', '.join(BROWSERS)}")
    if not built.is_built():
        missing.append("the page is not built: scripts/page does that")
    if missing:
        if os.environ.get("CI"):
            pytest.fail("; ".join(missing))
        pytest.skip("; ".join(missing))
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=executable, args=FLAGS)
        yield browser
        browser.close()


@pytest.fixture(scope="module")
def service(browser: Browser, tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:  # noqa: ARG001
    """The address of a service of its own; only where there is a browser to go there."""
    with serving(tmp_path_factory.mktemp("store")) as address:
        yield address


@contextmanager
def serving(store: Path, **settings: str) -> Iterator[str]:
    """Serve, and give the address."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    environment = {"GEODESIC_STORE": str(store), "GEODESIC_WORKERS": "1", **settings}
    process = subprocess.Popen(  # noqa: S603 - this Python, and the text above
        [sys.executable, "-c", SERVE, "serve", "--port", str(port)],
        env=os.environ | environment,
        cwd=ROOT,
    )
    address = f"http://127.0.0.1:{port}"
    try:
        _wait_until_ready(address, process)
        yield address
    finally:
        process.terminate()
        process.wait(30)


def _wait_until_ready(address: str, process: "subprocess.Popen[bytes]") -> None:
    end = time.monotonic() + 300  # kernels may have to be compiled
    while time.monotonic() < end:
        assert process.poll() is None, "the service ended"
        try:
            if httpx2.get(f"{address}/readyz").status_code == 200:
                return
        except httpx2.TransportError:
            pass
        time.sleep(0.1)
    raise AssertionError("the service did not become ready")


def sample(service: str, name: str, faces: int, **headers: str) -> str:
    """Have a sample made, and give its id."""
    parameters = {"sample": name, "faces": faces}
    answer = httpx2.post(f"{service}/v1/meshes", params=parameters, headers=headers, timeout=120)
    return str(answer.json()["id"])


@pytest.fixture(scope="module")
def sphere(service: str) -> str:
    """The id of a sphere of radius 1."""
    return sample(service, "sphere", 5000)


@pytest.fixture(scope="module")
def knot(service: str) -> str:
    return sample(service, "knot", 10_000)


@pytest.fixture(scope="module")
def large(service: str) -> str:
    """The id of a mesh whose distances take seconds, as an estimate tells."""
    return sample(service, "knot", 450_000)


@pytest.fixture
def wedge() -> str:
    """A file of three faces at one edge."""
    corners = ("0 0 0", "0 0 1", "1 0 0", "-1 0.6 0", "-1 -0.6 0")
    lines = [f"v {corner}" for corner in corners] + ["f 1 2 3", "f 1 2 4", "f 1 2 5"]
    return "\n".join(lines)


@pytest.fixture
def view(browser: Browser, service: str) -> Iterator[View]:
    """A new page, which must not have written errors by the end."""
    context = browser.new_context(
        viewport={"width": 1100, "height": 700}, has_touch=True, base_url=service
    )
    context.grant_permissions(["clipboard-read", "clipboard-write"])
    page: Page = context.new_page()
    view = View(page)
    yield view
    context.close()
    assert view.errors == []
