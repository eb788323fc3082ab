"""The page in a real browser, drawn by software, over a real service."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import httpx2
import pytest
from playwright.sync_api import Browser, Page, expect, sync_playwright

from tests.support.node import alone, build_page, miss
from tests.support.processes import Server
from tests.support.viewing import View
from tests.support.waiting import LONG_S

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
FLAGS = [
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-gpu-compositing",  # WebGL is drawn as the GPU would, the rest of the page is not
    "--no-sandbox",
]


@pytest.fixture(scope="session")
def _built(tmp_path_factory: pytest.TempPathFactory, testrun_uid: str) -> None:
    """The page, built by one of the processes where its sources have changed."""
    with alone("page", tmp_path_factory, testrun_uid):
        build_page()


@pytest.fixture(scope="module")
def browser(_built: None) -> Iterator[Browser]:
    """A browser of the module: its event loop would be in the way of other tests."""
    executable = next(filter(None, map(shutil.which, BROWSERS)), None)
    if executable is None:
        miss(f"install one of these browsers to run this: {', '.join(BROWSERS)}")
    with sync_playwright() as playwright:
        expect.set_options(timeout=1000 * LONG_S)
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
    server = Server(store, **settings)
    try:
        yield server.url
    finally:
        server.close()


def sample(service: str, name: str, faces: int, **headers: str) -> str:
    """Have a sample made, and give its id."""
    parameters = {"sample": name, "faces": faces}
    answer = httpx2.post(f"{service}/v1/meshes", params=parameters, headers=headers, timeout=LONG_S)
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
    context.set_default_timeout(1000 * LONG_S)
    context.grant_permissions(["clipboard-read", "clipboard-write"])
    page: Page = context.new_page()
    view = View(page)
    yield view
    context.close()
    assert view.errors == []
