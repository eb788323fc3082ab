"""The page on a small phone."""

import pytest
from playwright.sync_api import FloatRect

from tests.support.viewing import PLAIN, View

pytestmark = pytest.mark.file_slice(1)


def box_of(view: View, selector: str) -> FloatRect:
    box = view.page.locator(selector).bounding_box()
    assert box is not None, f"{selector} is not to be seen"
    return box


def test_what_is_told_is_not_on_the_mesh(phone: View, sphere: str) -> None:
    phone.open(f"/?mesh={sphere}")
    canvas, cue, scale, panel = (
        box_of(phone, each) for each in ("#canvas", "#cue", "#scalebar", "#panel")
    )
    assert phone.text("#cue") == "Tap sets A, the next one B"
    assert canvas["y"] + canvas["height"] <= min(cue["y"], scale["y"]), "the mesh is in the canvas"
    assert max(each["y"] + each["height"] for each in (cue, scale)) <= panel["y"]
    assert cue["x"] + cue["width"] <= scale["x"]
    assert canvas["height"] > 0.65 * 640
    x, y = phone.centre
    phone.page.touchscreen.tap(x, y + 210)
    assert phone.text("#cue") == "That is beside the mesh"
    assert box_of(phone, "#cue")["y"] >= cue["y"]
    assert box_of(phone, "#canvas") == canvas, "nothing jumps"


PARTS = ("#legend", "#readout", "#canvas", "#cue", "#scalebar", "#panel")


@pytest.mark.parametrize("is_folded", [True, False])
def test_nothing_lies_on_anything_else(phone: View, knot: str, is_folded: bool) -> None:
    phone.open(f"/?mesh={knot}&source=v0&target=v900")
    if not is_folded:
        phone.page.click("#fold")
        phone.wait()
    boxes = [box_of(phone, each) for each in PARTS]
    for i, a in enumerate(boxes):
        for b in boxes[:i]:
            apart_x = a["x"] + a["width"] <= b["x"] or b["x"] + b["width"] <= a["x"]
            apart_y = a["y"] + a["height"] <= b["y"] or b["y"] + b["height"] <= a["y"]
            assert apart_x or apart_y
    assert all(each["x"] >= 0 and each["x"] + each["width"] <= 360 for each in boxes)
    assert boxes[2]["height"] > 150


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


FOLDED = (
    *("stories", "more-points", "more-costs", "more-method", "more-lines", "more-regions"),
    *("more-shape", "more-colours", "more-display", "export"),
)


@pytest.mark.parametrize("selector", [".segments span", "#panel summary", "#panel button"])
def test_labels_are_in_the_middle_of_what_a_finger_presses(
    phone: View, knot: str, selector: str
) -> None:
    phone.open(f"/?mesh={knot}&source=v0&target=v1000&{PLAIN}")
    phone.press("#cut-start")
    phone.click()
    phone.reach("#distances")
    for each in FOLDED:
        if phone.page.get_attribute(f"#{each}", "open") is None:
            phone.unfold(each)
    labels = phone.page.locator(selector).evaluate_all(OFF_CENTRE)
    assert labels
    assert all(label["height"] >= 44 for label in labels)
    assert [label for label in labels if abs(label["off"]) > 2] == []


def test_the_sheet_makes_room_for_what_was_opened(phone: View, wedge: str, knot: str) -> None:
    phone.open()
    assert phone.page.is_visible("#folded"), "with the stories"
    phone.upload("wedge.obj", wedge)
    assert not phone.page.is_visible("#folded")
    assert phone.page.get_attribute("#fold", "aria-expanded") == "false"

    phone.page.click("#fold")
    phone.page.select_option("#meshes", "sample:sphere")
    phone.wait()
    assert not phone.page.is_visible("#folded")

    phone.page.click("#fold")
    phone.page.select_option("#meshes", knot)
    phone.wait()
    assert not phone.page.is_visible("#folded")


def test_a_refused_file_leaves_the_sheet_open(phone: View) -> None:
    phone.open()
    phone.page.set_input_files("#file", {"name": "no.obj", "mimeType": "", "buffer": b"v 0 0"})
    phone.wait("error")
    assert phone.page.is_visible("#folded")
