"""The page of a service that asks for keys."""

from collections.abc import Iterator
from contextlib import closing

import httpx2
import pytest
from playwright.sync_api import Browser, Page, Request, Route, expect

from tests.page.conftest import sample
from tests.support.processes import Server
from tests.support.viewing import PLAIN, View

pytestmark = pytest.mark.file_slice(2)

KEY = "of-a-page-0123456789"
BEARER = {"Authorization": f"Bearer {KEY}"}


@pytest.fixture(scope="module")
def service(browser: Browser, tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:  # noqa: ARG001
    """A service that has one key; ``view`` goes there."""
    store = tmp_path_factory.mktemp("store")
    with closing(Server(store, GEODESIC_API_KEYS=f"page:{KEY}")) as server:
        yield server.url


@pytest.fixture(scope="module")
def knot(service: str) -> str:
    return sample(service, "knot", 10_000, **BEARER)


def give_key(page: Page, key: str) -> None:
    page.fill("#key", key)
    page.press("#key", "Enter")


def test_a_key_is_asked_for_and_a_wrong_one_refused(view: View) -> None:
    view.page.goto("/")
    view.wait("error")
    assert view.page.is_visible("#key")
    assert view.page.evaluate("document.activeElement.id") == "key"

    with view.page.expect_response("**/v1") as answer:
        give_key(view.page, "of-a-page-9876543210")
    view.wait("error")
    problem = answer.value.json()
    assert problem["status"] == 401
    assert view.text("#error-title") == problem["title"]
    assert view.text("#error-detail") == problem["detail"]
    assert problem["request_id"] in view.text("#error-request")

    give_key(view.page, KEY)
    view.wait()
    assert not view.page.is_visible("#error")
    view.page.select_option("#meshes", "sample:sphere")
    view.wait()
    view.click(0, 0)
    assert "one piece, closed" in view.text("#report")
    assert view.page.is_visible("#legend")


def test_a_file_is_uploaded_with_the_key(view: View, wedge: str) -> None:
    view.page.goto("/")
    view.wait("error")
    give_key(view.page, KEY)
    view.wait()
    view.upload("wedge.obj", wedge)

    assert "5 vertices, 3 faces" in view.text("#report")


def test_a_permalink_is_drawn_once_the_key_is_given(view: View, knot: str) -> None:
    address = f"/?mesh={knot}&source=v0&target=v1000&{PLAIN}"
    view.page.goto(address)
    view.wait("error")
    assert not view.page.is_visible("#readout")

    give_key(view.page, KEY)
    view.wait()
    length = view.text("#length")
    url = f"{view.page.url.split('/?')[0]}/v1/meshes/{knot}/path?from=v0&to=v1000"
    assert float(length) == pytest.approx(httpx2.get(url, headers=BEARER).json()["length"], 1e-5)
    assert view.page.is_visible("#legend")

    view.open(address)  # the key is remembered while the tab is open
    assert view.text("#length") == length


def test_a_key_that_no_longer_holds_is_asked_for_anew(view: View, knot: str) -> None:
    view.page.goto("/")
    view.wait("error")
    give_key(view.page, KEY)
    view.wait()
    view.page.reload()
    view.wait()
    arrays = "**/arrays/**"
    view.page.context.route(arrays, lambda route: route.continue_(headers={}))
    with view.page.expect_response(arrays) as answer:
        view.page.select_option("#meshes", knot)
    view.wait("error")
    assert view.text("#error-detail") == answer.value.json()["detail"]

    view.page.context.unroute(arrays)
    give_key(view.page, KEY)
    view.wait()
    assert "one piece, closed" in view.text("#report")


def test_progress_is_read_with_the_key(view: View, knot: str) -> None:
    streams: list[Request] = []
    answers: list[Route] = []

    def ask_for_a_job(query: Route) -> None:
        query.continue_(headers=query.request.headers | {"prefer": "respond-async"})

    def hold(answer: Route) -> None:
        answers.append(answer)

    view.page.on("request", lambda each: streams.append(each) if "/events" in each.url else None)
    view.page.route("**/distances", ask_for_a_job)
    view.page.route("**/results", hold)  # so that progress stays to be seen
    view.page.goto(f"/?mesh={knot}&source=v0&{PLAIN}")
    view.wait("error")
    with view.page.expect_request("**/results"):
        give_key(view.page, KEY)
    expect(view.page.locator("#progress")).to_have_attribute("value", "1")
    answers[0].continue_()
    view.wait()

    (stream,) = streams
    assert stream.resource_type == "fetch"
    assert stream.headers["authorization"] == BEARER["Authorization"]
    assert view.page.is_visible("#legend")
