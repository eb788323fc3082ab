"""An answer on the screen belongs to the question on the screen, and is shown whole."""

import json
import re
from collections.abc import Callable
from typing import Any

import httpx2
import numpy as np
import pytest
from playwright.sync_api import FilePayload, Route, expect

from tests.page.conftest import sample
from tests.page.test_page import PATH, seen
from tests.support.paths import ROOT
from tests.support.viewing import PLAIN, View, angle_at, length_of, query_of

pytestmark = pytest.mark.file_slice(3)

TWO_SHEETS = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 5 0 0\nv 6 0 0\nv 5 1 0\nf 1 2 3\nf 4 5 6\n"


def has_path(view: View) -> bool:
    """Whether there is a path; what is as small is the marker of a target."""
    places = seen(view, PATH)
    return len(places) > 0 and bool(np.ptp(places, axis=0).max() > 30)


def assert_blank(view: View) -> None:
    """Check that there is no answer: no length, no path, no colours."""
    assert not view.page.is_visible("#readout")
    assert not view.page.is_visible("#legend")
    assert not has_path(view)
    assert np.ptp(view.colour(40, 40)) < 40


# Whole


def test_what_is_not_reached_is_told(view: View) -> None:
    view.open()
    view.upload("two.obj", TWO_SHEETS)
    view.ask("v0")
    view.wait()
    assert view.text("#notes").splitlines() == ["3 vertices not connected to a start."]
    assert "2 connected components" in view.text("#report"), "the mesh's own warnings are here"

    view.ask("0.5", "#max-distance")
    view.wait()
    assert "2 vertices beyond the limit." in view.text("#notes")


def test_the_error_bound_is_told(view: View, knot: str) -> None:
    view.open(f"/?mesh={knot}&source=v0&error=0.1")
    assert view.text("#notes") == ""
    view.unfold("more-method")
    view.page.click("#methods >> text=Approximate")
    view.wait()
    assert "Distances: error at most 0.2 % (guaranteed)." in view.text("#notes")
    view.page.click("#methods >> text=Fast")
    view.wait()
    assert re.search(r"Distances: error about [\d.]+ % \(estimated\)\.", view.text("#notes"))
    expect(view.page.locator("#notes")).to_contain_text("Isolines: error at most")
    view.page.click("#methods >> text=Exact")
    view.wait()
    assert view.text("#notes") == ""


def warning_in(header: str | None, words: str) -> Callable[[Route], None]:
    """Return what adds a warning to answers: in a header, or in JSON."""

    def add(route: Route) -> None:
        asked = {**route.request.headers, "prefer": ""}  # never a job: its results come elsewhere
        answer = route.fetch(headers=asked)
        if header and "application/json" not in answer.headers["content-type"]:
            headers = {**answer.headers, header: json.dumps([words])}
            route.fulfill(response=answer, headers=headers)
        else:
            route.fulfill(response=answer, json={**answer.json(), "warnings": [words]})

    return add


@pytest.mark.parametrize(
    ("kind", "header"),
    [("distances", "Geodesic-Warnings"), ("path", None), ("isolines", None), ("borders", None)],
)
def test_warnings_of_an_answer_are_shown(
    view: View, sphere: str, kind: str, header: str | None
) -> None:
    words = f"The {kind} are to be taken with care."
    view.page.route(f"**/{kind}", warning_in(header, words))
    view.open(f"/?mesh={sphere}&source=v0&source=v9&target=v900&shade=territories")
    expect(view.page.locator("#notes")).to_have_text(words)
    view.page.click("#clear")
    view.wait()
    assert view.page.text_content("#notes") == ""


def test_a_position_far_from_the_surface_is_told(view: View, sphere: str) -> None:
    view.open(f"/?mesh={sphere}&{PLAIN}&source=p0,0,3&target=p0,1.001,0")
    view.wait()
    told = view.text("#notes")
    assert told.startswith("The position 0, 0, 3 is 2")
    assert "0, 1.001, 0" not in told, "that is on the surface, but for rounding"
    view.click(0, 0)
    assert view.text("#notes") == ""


# Of the question


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("e0-99999999:0.5", "vertex 99999999 does not exist; the indices are 0 to 2561"),
        ("f99999999:0.5,0.5,0", "face 99999999 does not exist; the indices are 0 to 5119"),
        ("v0 v99999999", "vertex 99999999 does not exist; the indices are 0 to 2561"),
        ("nose", "“nose” is not a point."),
        ("v0 v-1", "“v-1” is not a point."),
    ],
)
def test_a_wrong_start_leaves_no_answer(view: View, sphere: str, text: str, words: str) -> None:
    view.open(f"/?mesh={sphere}&source=v0&target=v900&lines=none")
    right = length_of(view)
    assert has_path(view)

    view.ask(f"{text} > v900")
    view.wait("error")

    assert_blank(view)
    assert words in view.text("#error-detail")
    assert view.text("#error-title") in ("Invalid point", "Not a point")
    assert "/" not in view.text("#error")
    assert view.page.input_value("#points") == f"{text} > v900"
    assert view.page.is_disabled("#copy-curl") is (view.text("#error-title") == "Not a point")

    view.ask("v0 > v900")
    view.wait()
    assert length_of(view) == right
    assert view.page.is_visible("#legend")
    assert not view.page.is_visible("#error")


@pytest.mark.parametrize(
    ("field", "text", "title"),
    [
        ("#points", "v0 > v99999999", "Invalid point"),
        ("#points", "v0 > tip", "Not a point"),
        ("#points", "v0 > v99999999 > v900", "Invalid point"),
        ("#points", "v0 > v1,v2 > v900", "Not a point"),
        ("#barriers", "99999999", "Invalid request"),
        ("#barriers", "3:4", "Not a range of faces"),
        ("#barriers", "7-6", "Not a range of faces"),
        ("#barriers", "0-99999999999", "Not a range of faces"),
    ],
)
def test_another_wrong_field_leaves_no_path(
    view: View, sphere: str, field: str, text: str, title: str
) -> None:
    view.open(f"/?mesh={sphere}&source=v0&target=v900&lines=none")
    view.ask(text, field)
    view.wait("error")

    assert not view.page.is_visible("#readout")
    assert not has_path(view)
    assert view.text("#error-title") == title
    assert "/" not in view.text("#error-detail")
    if title.startswith("Not"):
        assert_blank(view)
        assert view.page.input_value(field) == text
        view.click(0, 0)  # another question, of what is known
        assert view.page.is_visible("#readout")
        assert view.page.input_value(field) != text


def test_a_message_remains_while_lines_are_drawn(view: View, sphere: str) -> None:
    view.open(f"/?mesh={sphere}")
    with view.page.expect_response("**/isolines"):
        view.ask("v0 > v99999999")
    view.wait("error")
    assert "Target: vertex 99999999" in view.text("#error-detail")
    assert view.page.is_visible("#legend"), "distances need no end"


@pytest.mark.parametrize("point", ["nose", "v99999999", "f99999999:1,0,0", "e7-99999999:0.5"])
def test_a_link_with_a_wrong_point_shows_the_mesh(view: View, sphere: str, point: str) -> None:
    view.page.goto(f"/?mesh={sphere}&source={point}&target=v900")
    view.wait("error")
    assert "one piece, closed" in view.text("#report")
    assert view.text("#error-title") in ("Invalid point", "Not a point")
    assert_blank(view)


def hold(view: View, address: str) -> list[Route]:
    """Hold requests back, and list them."""
    held: list[Route] = []
    view.page.route(address, lambda route: held.append(route))  # noqa: PLW0108 - Playwright marks it
    return held


def test_a_slow_answer_leaves_none_in_its_place(view: View, sphere: str) -> None:
    view.open(f"/?mesh={sphere}&source=v0&target=v900&lines=none")
    distances, paths = hold(view, "**/distances"), hold(view, "**/path")
    view.ask("v7 > v900")
    expect(view.page.locator("#readout")).to_be_hidden()
    expect(view.page.locator("#legend")).to_be_hidden()
    assert_blank(view)
    for route in (*distances, *paths):
        route.continue_()
    view.page.unroute("**/path")  # the exact path follows
    view.wait()
    assert length_of(view) > 0
    assert view.page.is_visible("#legend")


def test_a_failed_question_can_be_asked_again(view: View, sphere: str) -> None:
    view.open(f"/?mesh={sphere}&source=v0&target=v900&lines=none")
    right = length_of(view)
    paths = hold(view, "**/path")
    view.ask("v0 > v901")
    expect(view.page.locator("#readout")).to_be_hidden()
    paths[0].abort()
    view.wait("error")
    assert view.text("#error-title") == "The service does not answer"
    assert not view.page.is_visible("#readout")
    view.page.unroute("**/path")
    view.ask("v0 > v901")
    view.wait()
    assert length_of(view) == pytest.approx(right, rel=0.5)


def test_a_cancelled_question_leaves_no_answer(view: View, sphere: str) -> None:
    view.open(f"/?mesh={sphere}&source=v0&target=v900&lines=none")
    hold(view, "**/distances")
    hold(view, "**/path")
    view.ask("v7 > v900")
    view.page.keyboard.press("Escape")
    view.wait()
    expect(view.page.locator("#readout")).to_be_hidden()
    assert_blank(view)


# Beside the mesh


BESIDE = "That is beside the mesh"


@pytest.mark.parametrize("tool", ["A → B", "Stop", "Start", "Barrier"])
def test_a_click_beside_the_mesh_says_so(view: View, sphere: str, tool: str) -> None:
    view.open(f"/?mesh={sphere}&source=v0&{PLAIN}")
    view.page.click(f"#tools >> text={tool}")
    before = query_of(view)
    view.click(-300, 0)
    assert view.text("#cue") == BESIDE
    assert query_of(view) == before

    view.click(10, 10)
    assert view.text("#cue") != BESIDE
    assert query_of(view) != before
    view.drag((-300, 0), (-290, 40))
    assert view.text("#cue") != BESIDE, "that turns the mesh"


@pytest.mark.parametrize("key", ["Enter", "Shift+Enter", "Alt+Enter"])
def test_a_key_beside_the_mesh_says_so(view: View, service: str, key: str) -> None:
    obstacles = sample(service, "knot", 2000)
    view.open(f"/?mesh={obstacles}&lines=none&view=0.6,1.2,2.9,3,0,0")
    view.page.focus("#canvas")
    view.page.keyboard.press(key)
    assert view.text("#cue") == BESIDE


# Words


def test_what_the_pointer_is_told_is_what_it_does(view: View, sphere: str) -> None:
    """Each sentence in turn: what it says is done, and nothing else."""
    view.open(f"/?mesh={sphere}&{PLAIN}")

    def told_and_done(
        place: tuple[int, int], words: str, *changed: str, key: str | None = None
    ) -> None:
        before = query_of(view)
        if key:
            view.page.keyboard.down(key)
        assert view.hover(*place) == words
        view.click(*place)
        if key:
            view.page.keyboard.up(key)
        after = query_of(view)
        names = ("source", "via", "target", "walk", "barriers")
        assert {name for name in names if before.get(name) != after.get(name)} == set(changed)

    told_and_done((-100, 0), "Click sets A, the next one B", "source")
    told_and_done((100, 0), "Click sets B; Shift-click adds another start", "target")
    assert length_of(view) == pytest.approx(2 * angle_at(view, 100), rel=0.01)
    adds = "; Shift-click adds a start, Alt-click a stop"
    told_and_done((-80, 40), f"Click moves A{adds}", "source")
    told_and_done((80, 40), f"Click moves B{adds}", "target")
    told_and_done((0, 80), "Alt-click adds stop 1", "via", key="Alt")
    told_and_done((-80, -60), "Shift-click adds start A2", "source", key="Shift")
    assert len(query_of(view)["source"]) == 2
    for tool, place, words, changed in (
        ("Stop", (0, -40), "Click adds stop 2", "via"),
        ("Start", (40, -60), "Click adds start A3", "source"),
        ("Walk", (0, 20), "Click walks straight on from A in this direction", "walk"),
        ("Barrier", (0, 0), "Drag blocks faces; Shift-drag frees them", "barriers"),
    ):
        view.page.click(f"#tools >> text={tool}")
        told_and_done(place, words, changed)
    view.page.click("#tools >> text=A → B")
    assert view.hover(80, 40) == "Drag moves B"
    before = query_of(view)
    view.drag((80, 40), (60, 100))
    after = query_of(view)
    assert before.pop("target") != after.pop("target")
    assert before == after


def readme_on_clicks() -> list[str]:
    """Return the sentences of the readme that say what clicks on the page do."""
    section = (ROOT / "README.md").read_text().split("## The page")[1].split("\n## ")[0]
    paragraph = next(each for each in section.split("\n\n") if "first click" in each)
    return [f"{each.strip()}." for each in " ".join(paragraph.split()).split(".") if each.strip()]


def test_what_the_readme_says_of_clicks_is_done(view: View, sphere: str) -> None:
    view.open(f"/?mesh={sphere}&{PLAIN}")

    def ends() -> None:
        view.click(-100, 0)
        view.click(100, 0)
        assert length_of(view) == pytest.approx(2 * angle_at(view, 100), rel=0.01)

    def nearer_end() -> None:
        before = query_of(view)
        view.click(80, 0)
        assert query_of(view)["source"] == before["source"]
        assert length_of(view) == pytest.approx(angle_at(view, 100) + angle_at(view, 80), rel=0.01)

    def dragging() -> None:
        view.drag((-100, 0), (-60, 0))
        view.drag((80, 0), (60, 0))
        assert length_of(view) == pytest.approx(2 * angle_at(view, 60), rel=0.01)

    def keys() -> None:
        view.click(0, 60, "Alt")
        view.click(-60, 60, "Shift")
        assert (len(query_of(view)["via"]), len(query_of(view)["source"])) == (1, 2)

    def switch() -> None:
        assert view.page.is_visible("#legend")
        view.page.uncheck("#distances")
        view.wait()
        assert not view.page.is_visible("#legend")
        view.page.check("#distances")
        view.wait()
        assert view.page.is_visible("#legend")

    def beside() -> None:
        view.click(-300, 0)
        assert view.text("#cue") == BESIDE

    def undo() -> None:
        for _ in range(2 + 1 + 2 + 2 + 2):
            view.page.keyboard.press("Control+z")
        assert "source" not in query_of(view)

    performed = {
        "A first click sets A, a second one B, and the path is there with its length.": ends,
        "A third click moves the nearer end.": nearer_end,
        "Dragging moves any point.": dragging,
        "Shift-click adds a start, and the path begins at the nearest; Alt-click adds a stop on"
        " the way.": keys,
        "One switch colours the surface by distance.": switch,
        "A click beside the mesh says so.": beside,
        "Ctrl+Z undoes each step.": undo,
    }
    assert readme_on_clicks() == list(performed)
    for perform in performed.values():
        perform()


EVERY_FAULT = """
v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nv 0 -1 0\nv 9 9 9\nv 2 0 0\nv 2 0 0\nv 3 0 0\nv 2 1 0
v 4 0 0\nv 5 0 0\nv 6 0 0\nv -1 0 0\nv -1 1 0
v 20 0 0\nv 21 0 0\nv 20 1 0\nv 19 0 0\nv 20 -1 0\nv 21 0 0\nv 23 0 0\nv 22 1 0
f 1 2 3\nf 1 2 4\nf 1 2 5\nf 7 7 9\nf 7 8 10\nf 7 9 10\nf 11 12 13\nf 1 14 15\nf 1 2 3\nf 9 10 7
f 16 17 18\nf 16 19 20\nf 21 22 23
"""


FAULTS = (
    "duplicate_vertices",
    "isolated_vertices",
    "repeated_vertex_faces",
    "zero_length_edges",
    "collapsed_faces",
    "duplicate_faces",
    "degenerate_faces",
    "non_manifold_edges",
    "misoriented_edges",
    "bow_tie_vertices",
)


def test_each_fault_is_told_once(view: View) -> None:
    view.open()
    with view.page.expect_response("**/v1/meshes?*") as answer:
        view.page.set_input_files(
            "#file", FilePayload(name="all.obj", mimeType="", buffer=EVERY_FAULT.encode())
        )
    view.wait()
    mesh = answer.value.json()
    lines = view.page.locator("#report li span").all_inner_texts()
    assert lines == mesh["warnings"], "in the service's words, and no others"
    assert all(mesh[kind]["count"] for kind in FAULTS), "a mesh with every fault"
    assert view.page.locator("#report >> text=Show").count() >= len(FAULTS)
    assert view.page.locator("#report li", has_text="in no face").count() == 1


# Files


@pytest.mark.parametrize(
    "name",
    ["lh.pial", "cube.surf.gii.gz", "cube.VTU", "mesh.zip", "rh.sphere.reg", "no-suffix", "a.json"],
)
def test_a_file_goes_to_the_service_with_its_name(view: View, name: str) -> None:
    """The service knows which formats it reads, and tells it; the page has no list of its own."""
    told: dict[str, Any] = {}

    def listen(route: Route) -> None:
        told["body"] = (route.request.post_data_buffer or b"").decode("latin-1")
        told["answer"] = route.fetch()
        route.fulfill(response=told["answer"])

    view.open()
    view.page.route("**/v1/meshes?merge=none", listen)
    assert view.page.get_attribute("#file", "accept") is None
    view.page.set_input_files("#file", FilePayload(name=name, mimeType="", buffer=b"\xff\xff\xfe"))
    view.wait("error")
    assert f'filename="{name}"' in told["body"]
    assert "ÿÿþ" in told["body"]
    assert view.text("#error-title") == told["answer"].json()["title"]


def test_a_file_with_a_suffix_in_capitals_is_opened(view: View) -> None:
    view.open()
    view.upload("SHEET.OFF", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n")
    assert "3 vertices, 1 face" in view.text("#report")
    assert "SHEET.OFF" in view.text("#meshes option:checked")


def test_the_formats_are_those_that_the_service_reads(view: View) -> None:
    view.page.route("**/v1/meshes?sample=*", lambda route: route.abort())
    view.page.goto("/")
    view.wait("error")
    about = httpx2.get(view.page.url.split("/?")[0].rstrip("/") + "/v1").json()
    formats = ", ".join(each.upper() for each in about["mesh_formats"])
    assert view.page.text_content("#welcome-formats") == formats
    picture = FilePayload(name="cat.png", mimeType="image/png", buffer=b"\x89PNG")
    view.page.set_input_files("#file", picture)
    view.wait("error")
    assert view.text("#error-hint") == f"This service reads {formats}."
