"""The reference of the interface at ``/docs``, in a browser."""

import pytest
from playwright.sync_api import expect

from tests.support.viewing import View

pytestmark = pytest.mark.file_slice(1)


def test_the_reference_shows_every_operation_and_loads_nothing_from_elsewhere(
    view: View, service: str
) -> None:
    page = view.page
    addresses: list[str] = []
    complaints: list[str] = []  # of the browser, about what the page may not do
    page.on("request", lambda request: addresses.append(request.url))
    page.on("console", lambda message: complaints.append(message.text))
    page.goto("/docs")

    expect(page.locator(".opblock-tag")).to_have_count(4)
    document = page.request.get("/openapi.json").json()
    operations = [each for path in document["paths"].values() for each in path]
    expect(page.locator(".opblock")).to_have_count(len(operations))
    assert addresses
    assert all(address.startswith((service, "data:")) for address in addresses)
    assert complaints == []


def test_a_request_can_be_sent_from_the_reference(view: View) -> None:
    page = view.page
    page.goto("/docs#/service/getAbout")

    page.get_by_role("button", name="Execute").click()

    expect(page.locator(".live-responses-table .response-col_status").last).to_contain_text("200")
