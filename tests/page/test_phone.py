"""The page on a small phone."""

import pytest
from playwright.sync_api import FloatRect

from tests.support.viewing import View

pytestmark = pytest.mark.file_slice(1)


@pytest.fixture
def phone(view: View) -> View:
    view.page.set_viewport_size({"width": 360, "height": 640})
    return view


def box_of(view: View, selector: str) -> FloatRect:
    box = view.page.locator(selector).bounding_box()
    assert box is not None, f"{selector} is not to be seen"
    return box


def test_the_hint_is_not_on_the_mesh(phone: View, sphere: str) -> None:
    phone.open(f"/?mesh={sphere}")
    canvas, hint, panel = (box_of(phone, each) for each in ("#canvas", "#hint", "#panel"))
    assert canvas["y"] + canvas["height"] <= hint["y"], "the mesh is in the canvas"
    assert hint["y"] + hint["height"] <= panel["y"]
    assert canvas["height"] > 0.75 * 640
    close = box_of(phone, "#hint-close")
    assert min(close["width"], close["height"]) >= 44
    assert not phone.page.is_visible("#scalebar"), "where the hint is"
    phone.page.click("#hint-close")
    scale = box_of(phone, "#scalebar")
    assert canvas["y"] + canvas["height"] <= scale["y"]
    assert scale["y"] + scale["height"] <= panel["y"]
    assert box_of(phone, "#canvas") == canvas, "nothing jumps"


def test_nothing_lies_on_anything_else(phone: View, knot: str) -> None:
    phone.open(f"/?mesh={knot}&source=v0&target=v900")
    boxes = [box_of(phone, each) for each in ("#legend", "#readout", "#scalebar", "#panel")]
    for i, a in enumerate(boxes):
        for b in boxes[:i]:
            apart_x = a["x"] + a["width"] <= b["x"] or b["x"] + b["width"] <= a["x"]
            apart_y = a["y"] + a["height"] <= b["y"] or b["y"] + b["height"] <= a["y"]
            assert apart_x or apart_y
    assert all(each["x"] >= 0 and each["x"] + each["width"] <= 360 for each in boxes)


OFF_CENTRE = """elements => elements.filter(each => each.checkVisibility()).map(each => {
    const text = document.createRange();
    text.selectNodeContents(each);
    const [inner, outer] = [text, each].map(part => part.getBoundingClientRect());
    return {
        words: each.textContent,
        off: (inner.top + inner.bottom - outer.top - outer.bottom) / 2,
        height: outer.height,
    };
})"""


@pytest.mark.parametrize("selector", [".segments span", "#panel summary", "#panel button"])
def test_labels_are_in_the_middle_of_what_a_finger_presses(phone: View, selector: str) -> None:
    phone.open()
    phone.page.click("#fold")
    labels = phone.page.locator(selector).evaluate_all(OFF_CENTRE)
    assert labels
    assert all(label["height"] >= 44 for label in labels)
    assert [label for label in labels if abs(label["off"]) > 2] == []


def test_the_sheet_makes_room_for_what_was_opened(phone: View, wedge: str, knot: str) -> None:
    phone.open()
    phone.page.click("#fold")
    assert phone.page.is_visible("#folded")
    phone.upload("wedge.obj", wedge)
    assert not phone.page.is_visible("#folded")
    assert phone.page.get_attribute("#fold", "aria-expanded") == "false"

    phone.page.click("#fold")
    phone.page.click("#samples [data-sample=sphere]")
    phone.wait()
    assert not phone.page.is_visible("#folded")

    phone.page.click("#fold")
    phone.page.select_option("#meshes", knot)
    phone.wait()
    assert not phone.page.is_visible("#folded")


def test_a_refused_file_leaves_the_sheet_open(phone: View) -> None:
    phone.open()
    phone.page.click("#fold")
    phone.page.set_input_files("#file", {"name": "no.obj", "mimeType": "", "buffer": b"v 0 0"})
    phone.wait("error")
    assert phone.page.is_visible("#folded")


def test_a_tap_beside_the_mesh_says_so(phone: View, sphere: str) -> None:
    phone.open(f"/?mesh={sphere}")
    x, y = phone.centre
    phone.page.touchscreen.tap(x, y + 230)
    assert phone.text("#told") == "That is beside the mesh"
    told, canvas = box_of(phone, "#told"), box_of(phone, "#canvas")
    assert canvas["y"] + canvas["height"] <= told["y"]
