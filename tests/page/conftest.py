"""The page in a real browser, drawn by software, over a real service."""

import shutil
from collections.abc import Iterator
from contextlib import closing

import httpx2
import pytest
from playwright.sync_api import Browser, BrowserContext, expect, sync_playwright

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
    "--process-per-site",  # one process draws all pages of a profile
]


@pytest.fixture(scope="session")
def _built(tmp_path_factory: pytest.TempPathFactory, testrun_uid: str) -> None:
    """The page, built by one of the processes where its sources have changed."""
    with alone("page", tmp_path_factory, testrun_uid):
        build_page()


@pytest.fixture(scope="package")
def browser(_built: None) -> Iterator[Browser]:
    """A browser of this folder: its event loop would be in the way of other tests."""
    executable = next(filter(None, map(shutil.which, BROWSERS)), None)
    if executable is None:
        miss(f"install one of these browsers to run this: {', '.join(BROWSERS)}")
    with sync_playwright() as playwright:
        expect.set_options(timeout=1000 * LONG_S)
        browser = playwright.chromium.launch(executable_path=executable, args=FLAGS)
        yield browser
        browser.close()


@pytest.fixture(scope="package")
def server(browser: Browser, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:  # noqa: ARG001
    """A service of its own; only where there is a browser to go there."""
    with closing(Server(tmp_path_factory.mktemp("store"))) as server:
        yield server


@pytest.fixture(scope="module")
def service(server: Server) -> str:
    """The address of the service."""
    return server.url


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
def phone(view: View) -> View:
    """The page on a small phone, which is dark and touched by fingers."""
    view.become_phone()
    return view


@pytest.fixture(params=["desktop", "phone"])
def device(view: View, request: pytest.FixtureRequest) -> View:
    """The page on a desktop, light and with a mouse; then on a phone."""
    return request.getfixturevalue("phone") if request.param == "phone" else view


@pytest.fixture(scope="module")
def context(browser: Browser, service: str) -> Iterator[BrowserContext]:
    """A browser profile that the pages of a module share: each opens in half the time."""
    context = browser.new_context(
        viewport={"width": 1100, "height": 700}, has_touch=True, base_url=service
    )
    context.set_default_timeout(1000 * LONG_S)
    context.grant_permissions(["clipboard-read", "clipboard-write"])
    context.new_page().goto("/livez")  # keeps the drawing process alive
    yield context
    context.close()


@pytest.fixture
def view(context: BrowserContext) -> Iterator[View]:
    """A new page, which remembers nothing and must not have written errors by the end."""
    page = context.new_page()
    view = View(page)
    yield view
    page.evaluate("() => localStorage.clear()")
    page.close()
    assert view.errors == []
