"""The page in use: clicks, keys and files, and the picture after each."""

import json
import math
import re
import subprocess
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import FilePayload, Route, expect

from tests.page.conftest import sample
from tests.support.paths import ROOT
from tests.support.processes import Server, slowed
from tests.support.viewing import PLAIN, View, angle_at, length_of, query_of
from tests.support.waiting import wait_until

pytestmark = pytest.mark.file_slice(5)

PATH = np.array([230, 0, 92])
BARRIER = np.array([30, 33, 40])
WALK = np.array([37, 99, 235])


def ramp_at(view: View, share: float, pixels: np.ndarray) -> np.ndarray:
    """Return the colour that the legend has for a share of the largest distance."""
    box = view.page.locator("#ramp").bounding_box()
    assert box is not None
    x, y = box["x"] + share * (box["width"] - 1), box["y"] + box["height"] / 2
    return pixels[round(y), round(x)].astype(float)


def is_shade_of(seen: np.ndarray, colour: np.ndarray) -> bool:
    """Whether a colour is another one in some light."""
    cosine = seen @ colour / np.linalg.norm(seen) / np.linalg.norm(colour)
    return bool(cosine > 0.99)


def seen(view: View, colour: np.ndarray, within: int = 12) -> np.ndarray:
    """Return where on the mesh a colour is: offsets from the middle, (N, 2)."""
    rows, columns = np.nonzero(np.abs(view.pixels() - colour).max(axis=2) <= within)
    places = np.column_stack([columns, rows]) - view.centre
    return places[np.hypot(*places.T) < 240]  # beyond is text


# Load


def test_the_page_opens_on_a_coloured_sample_whose_path_follows_the_pointer(view: View) -> None:
    view.open()
    assert not view.page.is_visible("#welcome")
    assert view.page.is_visible("#legend")
    lengths = {view.text("#length")}
    x, y = view.centre
    strand = seen(view, PATH)[0]
    for aside in (0, 30):
        view.page.mouse.move(x + strand[0], y + strand[1] + aside)
        view.wait()
        lengths.add(view.text("#length"))
    assert len(lengths) > 1, "without a press"

    view.page.select_option("#meshes", "sample:sphere")
    view.wait()
    view.page.mouse.move(x, y)
    view.wait()
    assert "target" not in query_of(view)


def test_the_axis_upwards_is_guessed_and_can_be_chosen(view: View, service: str) -> None:
    terrain = sample(service, "terrain", 2000)
    view.open(f"/?mesh={terrain}")
    assert view.page.is_checked("#ups [value=z]")
    lying = view.pixels()

    view.unfold("more-display")
    view.page.check("#ups [value=y]", force=True)
    view.wait()

    assert query_of(view)["up"] == ["y"]
    changed = np.abs(view.pixels() - lying).max(axis=2) > 30
    assert changed.mean() > 0.03


def test_a_sample_is_loaded_and_a_click_colours_it(view: View) -> None:
    view.open()
    ground = view.colour(-300, -300)
    view.page.select_option("#meshes", "sample:sphere")
    view.wait()
    assert "one piece, closed" in view.text("#report")
    assert view.text("#cue").endswith("sets A, the next one B")
    clay = view.colour()
    assert np.ptp(clay) < 40
    assert np.abs(clay - ground).max() > 20

    view.click(0, 0)

    assert query_of(view)["source"][0].startswith("f")
    assert np.ptp(view.colour(60, 60)) > 40
    assert view.text("#cue") == "Drag moves A"


def test_a_file_is_dropped(view: View, wedge: str) -> None:
    view.open()
    with view.page.expect_response("**/v1/meshes?merge=none"):
        view.page.evaluate(
            """text => {
                const files = new DataTransfer();
                files.items.add(new File([text], "wedge.obj"));
                document.dispatchEvent(new DragEvent("dragover", {dataTransfer: files}));
                document.dispatchEvent(new DragEvent("drop", {dataTransfer: files}));
            }""",
            wedge,
        )
    view.wait()

    assert "5 vertices, 3 faces" in view.text("#report")
    assert "wedge.obj" in view.text("#meshes option:checked")


def test_a_long_list_of_meshes_goes_on(view: View, sphere: str, knot: str) -> None:
    """Listed one by one, so that two are many."""

    def one_at_a_time(route: Route) -> None:
        route.continue_(url=route.request.url.replace("limit=100", "limit=1"))

    view.page.route("**/v1/meshes?*", one_at_a_time)
    view.open()
    options = view.page.locator("#meshes > option")

    def listed() -> list[str]:
        return [option.get_attribute("value") or "" for option in options.all()][1:]

    expect(options.last).to_have_attribute("value", "more")
    assert len(listed()) == 2
    while (ids := listed())[-1] == "more":
        view.page.select_option("#meshes", "more")
        expect(options.nth(len(ids))).not_to_have_attribute("value", "more")

    assert len(ids) == len(set(ids))
    assert {sphere, knot} <= set(ids)
    view.page.select_option("#meshes", knot)
    view.wait()
    assert query_of(view)["mesh"] == [knot]


WATCH_PROGRESS = """
    window.told = [];
    addEventListener('DOMContentLoaded', () => {
        const bar = document.getElementById('progress');
        const words = document.getElementById('waiting-for');
        new MutationObserver(() => window.told.push({
            share: bar.hasAttribute('value') ? bar.value : null,
            words: words.textContent,
            state: document.documentElement.dataset.state,
            isSeen: getComputedStyle(bar).visibility === 'visible',
        })).observe(bar, {attributeFilter: ['value']});
    });
"""


def test_an_upload_shows_its_progress(view: View, wedge: str) -> None:
    file = wedge + "\n" + "# as large as files are\n" * 30_000
    view.page.add_init_script(WATCH_PROGRESS)
    view.open()
    view.throttle_uploads(500_000)
    view.upload("wedge.obj", file)

    told = view.page.evaluate("window.told")
    assert {(each["words"], each["state"]) for each in told} == {
        ("Uploading wedge.obj…", "loading")
    }
    *shares, last = [each["share"] for each in told]
    assert len(shares) > 2
    assert shares == sorted(shares)
    assert 0 < shares[0] < 0.5 < shares[-1] < 1
    assert told[-1]["isSeen"]
    assert last is None, "how much of it the service has read, nobody knows"
    assert "5 vertices, 3 faces" in view.text("#report")


def test_an_upload_can_be_cancelled(view: View, wedge: str) -> None:
    view.open()
    before = view.text("#report")
    view.throttle_uploads(20_000)
    file = wedge + "\n" + "# never sent\n" * 50_000
    view.page.set_input_files(
        "#file", {"name": "wedge.obj", "mimeType": "", "buffer": file.encode()}
    )
    view.wait("loading")
    with view.page.expect_event("requestfailed"):
        view.page.click("#cancel")
    view.wait()

    assert not view.page.is_visible("#error")
    assert view.text("#report") == before


def test_an_empty_file(view: View) -> None:
    view.open()
    view.page.set_input_files("#file", {"name": "empty.obj", "mimeType": "", "buffer": b""})
    view.wait("error")

    assert view.text("#error-request").startswith("Request ")


def test_faults_are_marked(view: View, wedge: str) -> None:
    view.open()
    view.upload("wedge.obj", wedge)
    red = np.array([217, 26, 26])
    assert len(seen(view, red)) == 0

    view.page.click("text=Show >> nth=0")
    view.wait()

    assert "1 edge is shared by three faces or more" in view.text("#report")
    assert len(seen(view, red)) > 20


def test_a_refused_file_is_told_in_the_service_s_words(view: View) -> None:
    view.open()
    nonsense = {"name": "nonsense.ply", "mimeType": "", "buffer": b"ply\nnonsense"}
    view.page.set_input_files("#file", nonsense)
    view.wait("error")

    with view.page.expect_response("**/v1/meshes?merge=none") as answer:
        view.page.set_input_files("#file", nonsense)
    view.wait("error")

    problem = answer.value.json()
    assert view.text("#error-title") == problem["title"]
    assert view.text("#error-detail") == problem["detail"]
    assert problem["request_id"] in view.text("#error-request")
    view.page.click("#error-close")
    view.wait()


# Ask


def test_a_choice_of_colours_and_the_end_of_their_scale(view: View, sphere: str) -> None:
    view.open(f"/?mesh={sphere}&{PLAIN}")
    view.click(0, 0)
    teal = view.pixels()
    view.unfold("more-colours")
    view.page.select_option("#palette", "magma")
    view.page.wait_for_timeout(200)
    magma = view.pixels()
    assert (np.abs(magma - teal).max(axis=2) > 25).mean() > 0.05
    assert query_of(view)["palette"] == ["magma"]

    view.page.fill("#range", "1")
    view.page.press("#range", "Enter")
    view.wait()

    assert view.text("#tick-2") == "1"
    assert (np.abs(view.pixels() - magma).max(axis=2) > 25).mean() > 0.05
    assert query_of(view)["range"] == ["1"]
    view.page.reload()
    view.wait()
    assert view.page.input_value("#palette") == "magma"
    assert view.text("#tick-2") == "1"
    view.page.select_option("#meshes", "sample:knot")
    view.wait()
    assert "range" not in query_of(view), "it belongs to the mesh before"
    assert query_of(view)["palette"] == ["magma"]


def test_vertices_at_one_position_are_joined_by_a_button(view: View) -> None:
    corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"
    view.open()
    view.upload("two.obj", corners + "v 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\nf 4 6 5\n")
    assert "6 vertices" in view.text("#report")
    assert "two.obj" in view.text("#meshes option:checked")
    view.page.click("#report >> text=Join them")
    view.wait()
    view.page.locator("#report", has_text="4 vertices").wait_for()
    assert view.page.locator("#report >> text=Join them").count() == 0


def rows(view: View) -> list[str]:
    """Return what the list says is set."""
    return [" ".join(row.split()) for row in view.page.locator("#places li").all_inner_texts()]


def test_points_are_listed_in_words_and_edited_as_text(view: View, sphere: str) -> None:
    view.open(f"/?mesh={sphere}&source=v12*Old mill&via=v5&target=f7:0.2,0.3,0.5&{PLAIN}")
    assert rows(view) == ["⠿ A Old mill ×", "⠿ 1 vertex 5 ×", "⠿ B on face 7 ×"]
    view.unfold("more-points")
    assert view.page.input_value("#points") == "v12 > v5 > f7:.2,.3"
    view.page.fill("#points", "v12 > no point")
    view.page.focus("#max-distance")
    assert view.page.input_value("#points") == "v12 > no point", "what was typed is not lost"
    view.wait("error")
    assert view.page.is_disabled("#undo"), "nothing has been done"
    view.ask("v12 > v3")
    view.wait()
    assert rows(view) == ["⠿ A Old mill ×", "⠿ B vertex 3 ×"], "names stay with their points"
    assert query_of(view)["target"] == ["v3"]


def test_the_list_is_renamed_reordered_and_shortened(view: View, sphere: str) -> None:
    view.open(f"/?mesh={sphere}&source=v0&via=v5;v7&target=v9&barriers=3-5&walk=0,1,0&{PLAIN}")
    assert rows(view)[4:] == ["Straight on from A ×", "Barrier of 3 faces ×"]
    view.page.dblclick("#places li:nth-child(2) .name")
    view.page.keyboard.type("Pass; high")
    view.page.keyboard.press("Enter")
    assert query_of(view)["via"][0] == "v5*Pass, high"
    for key, name in (("Escape", "v0"), ("Enter", "v0*Hut")):
        view.page.focus("#places li:nth-child(1) .name")
        view.page.keyboard.press("Enter")
        view.page.keyboard.type("Hut")
        view.page.keyboard.press(key)
        assert query_of(view)["source"] == [name]

    view.page.focus("#places li:nth-child(4) .handle")
    for _ in range(3):
        view.page.keyboard.press("ArrowUp")
    view.wait()
    assert query_of(view)["source"] == ["v9"], "by the keyboard, whose focus goes along"
    handles = view.page.locator("#places .handle")
    handles.nth(0).drag_to(handles.nth(2))
    view.wait()
    moved = query_of(view)
    assert (moved["source"], moved["via"]) == (["v0*Hut"], ["v5*Pass, high", "v9"])
    view.page.click("#places >> [aria-label='Remove 2']")
    view.page.click("#places >> [aria-label='Remove Barrier of 3 faces']")
    view.page.click("#places >> [aria-label='Remove Straight on from A']")
    view.wait()
    assert rows(view) == ["⠿ A Hut ×", "⠿ 1 Pass, high ×", "⠿ B vertex 7 ×"]
    assert not {"barriers", "walk"} & set(query_of(view))


def test_colours_are_those_of_the_distance(view: View, sphere: str) -> None:
    view.open(f"/?mesh={sphere}&{PLAIN}")
    view.click(0, 0)

    pixels = view.pixels()
    for away in [(40, 0), (-90, 0), (0, 110), (100, -100), (0, -160)]:
        share = angle_at(view, math.hypot(*away)) / math.pi
        colour = view.colour(*away, pixels)
        assert is_shade_of(colour, ramp_at(view, share, pixels)), away
        assert not is_shade_of(colour, ramp_at(view, share + 0.3, pixels)), away


def test_the_ramp_grows_lighter_evenly(view: View, sphere: str) -> None:
    view.open(f"/?mesh={sphere}&source=v0&{PLAIN}")
    pixels = view.pixels()
    linear = np.array([ramp_at(view, t, pixels) / 255 for t in np.linspace(0.01, 0.99, 25)]) ** 2.2
    luminance = linear @ [0.2126, 0.7152, 0.0722]
    steps = np.diff(np.cbrt(luminance))

    assert (steps > 0).all()
    assert steps.max() < 2.5 * steps.min()


def test_the_path_follows_the_pointer(view: View, sphere: str) -> None:
    view.open(f"/?mesh={sphere}&{PLAIN}")
    view.click(-100, 0)
    view.click(0, 60)
    view.drag((0, 60), (50, 60), (100, 40))

    angle = angle_at(view, 100), angle_at(view, math.hypot(100, 40))
    directions = math.pi - math.atan2(40, 100)
    chord = math.cos(angle[0]) * math.cos(angle[1]) + math.sin(angle[0]) * math.sin(
        angle[1]
    ) * math.cos(directions)
    assert length_of(view) == pytest.approx(math.acos(chord), rel=0.01)
    assert "exact" in view.text("#length-note")
    path = seen(view, PATH)
    assert path[:, 0].min() < -90 < 90 < path[:, 0].max()
    assert view.page.get_attribute("#readout", "data-target") == query_of(view)["target"][0]

    before = query_of(view)
    view.drag((-100, 0), (20, 0))  # the other end
    assert seen(view, PATH)[:, 0].min() > 0
    assert query_of(view)["target"] == before["target"]


SLOW_PATHS = """
    window.aborted = 0;
    const real = window.fetch;
    window.fetch = (address, init) => !String(address).endsWith('/path') ? real(address, init)
        : new Promise((resolve, reject) => {
            const due = setTimeout(() => real(address, init).then(resolve, reject), 700);
            init.signal.addEventListener('abort', () => {
                window.aborted += 1;
                clearTimeout(due);
                reject(new DOMException('', 'AbortError'));
            });
        });
"""


def test_of_targets_the_newest_wins_and_the_superseded_is_aborted(view: View, sphere: str) -> None:
    view.page.add_init_script(SLOW_PATHS)
    view.open(f"/?mesh={sphere}&{PLAIN}")
    view.click(-100, 0)
    view.click(0, 100)
    view.drag((0, 100), (60, 60), (100, 0), steps=6)

    assert view.page.evaluate("window.aborted") >= 1
    assert view.page.get_attribute("#readout", "data-target") == query_of(view)["target"][0]
    assert length_of(view) == pytest.approx(2 * angle_at(view, 100), rel=0.01)


def test_a_path_begins_at_the_nearest_start(view: View, sphere: str) -> None:
    view.open(f"/?mesh={sphere}&{PLAIN}")
    view.click(-120, 0)
    view.click(120, 0, "Shift")
    view.click(60, 0)

    query = query_of(view)
    assert len(query["source"]) == 2
    assert length_of(view) == pytest.approx(
        angle_at(view, 120) - angle_at(view, 60), rel=0.01
    )  # from the nearer of them

    view.page.click("#shades >> text=Nearest")
    view.wait()
    left, right = view.colour(-60, 60), view.colour(60, 60)
    assert left[0] > left[2], "orange"
    assert right[2] > right[0], "sky blue"
    assert view.page.locator("#territories li").count() == 2


def test_territories_keep_their_colours_up_to_the_border(view: View) -> None:
    """Within a face, too: here two faces, which the border divides in the middle."""
    square = "v -1 -1 0\nv 1 -1 0\nv -1 1 0\nv 1 1 0\nf 1 2 3\nf 2 4 3\n"
    view.open("/?lines=none")
    view.upload("square.obj", square)
    (mesh,) = query_of(view)["mesh"]
    straight = "lines=none&view=0,1.5708,2.9,0,0,0&up=y"
    view.open(f"/?mesh={mesh}&source=v0&source=v1&shade=territories&{straight}")
    pixels = view.pixels()
    for y in (-120, 0, 120):
        far, near, beyond = (view.colour(x, y, pixels) for x in (-60, -8, 8))
        assert np.abs(near - far).max() < 20
        assert np.abs(near - beyond).max() > 60


def test_waypoints_and_barriers(view: View, sphere: str) -> None:
    view.open(f"/?mesh={sphere}&{PLAIN}")
    view.click(-100, 0)
    view.click(100, 0)
    straight = length_of(view)
    assert len(seen(view, BARRIER, 20)) == 0

    view.page.click("#tools >> text=Barrier")
    view.drag((0, -60), (0, 60), steps=2)
    wall = seen(view, BARRIER, 20)
    assert wall[:, 1].min() < -50 < 50 < wall[:, 1].max()
    around = length_of(view)
    assert around > straight * 1.05

    # A stroke that crosses the wall is a barrier of its own.
    view.drag((-40, 30), (40, 30), steps=2)
    assert len(view.page.locator("#places .barrier").all()) == 2
    assert len(seen(view, BARRIER, 20)) > len(wall)
    view.page.click("#places >> [aria-label^='Remove Barrier 2 ']")
    view.wait()
    assert len(seen(view, BARRIER, 20)) == len(wall)
    assert length_of(view) == around
    view.page.click("#undo")
    view.wait()
    assert len(query_of(view)["barriers"]) == 2
    view.page.click("#undo")
    view.wait()

    view.page.click("#tools >> text=Stop")
    view.click(0, 150)
    assert length_of(view) > around
    assert view.text("#length-names") == "A → 1 → B"

    view.page.click("#clear")
    view.wait()
    assert not view.page.is_visible("#readout")
    assert len(seen(view, BARRIER, 20)) == 0


def test_exact_and_approximate_side_by_side(view: View, knot: str) -> None:
    view.open(f"/?mesh={knot}&source=v0&error=0.1")
    view.unfold("more-method")
    assert view.text("#bound-approximate") == "–"

    view.page.click("#methods >> text=Approximate")
    view.wait()

    assert view.text("#bound-approximate") == "0.2 %"
    assert query_of(view)["method"] == ["approximate"]
    assert 0 < float(view.text("#measured-approximate").split()[0]) < 10
    assert view.text("#bound-exact") == "0"

    view.page.click("#shades >> text=Difference")
    view.wait()

    assert view.text("#legend-title") == "|approximate − exact| in mesh units"
    assert view.text("#difference").startswith(f"Largest {view.text('#tick-2')}, mean ")


def test_a_proof_beside_the_distances(view: View, knot: str) -> None:
    view.open(f"/?mesh={knot}&source=v0")
    assert not view.page.is_visible("#proof")

    view.page.click("#shades >> text=Proof")
    view.wait()

    found = re.fullmatch(r"✓ Proved to (\de-\d+) of the largest distance", view.text("#proof"))
    assert found
    assert float(found[1]) < 1e-8
    assert view.text("#legend-title") == "Violation by face, mesh units"
    assert 0 < float(view.text("#tick-2")) < 1e-9

    view.page.click("#shades >> text=Distance")
    view.wait()
    assert view.text("#proof") == found[0]
    assert query_of(view).get("shade") is None

    view.unfold("more-method")
    view.page.click("#methods >> text=Fast")
    view.wait()
    assert not view.page.is_visible("#proof")


def test_a_fast_answer_has_no_proof(view: View, knot: str) -> None:
    view.open(f"/?mesh={knot}&source=v0&method=fast&shade=proof")
    assert "Fast distances have no proof" in view.text("#notes")
    assert not view.page.is_visible("#proof")


def test_fast_distances_beside_exact_ones(view: View, knot: str) -> None:
    view.open(f"/?mesh={knot}&source=v0&effort=1&shade=difference&lines=count:3")
    view.unfold("more-method")
    assert view.text("#bound-fast") == "–"

    view.page.click("#methods >> text=Fast")
    view.wait()

    estimate = view.text("#bound-fast").split()[0]
    assert view.text("#legend-title") == "|fast − exact| in mesh units"
    assert f"error about {estimate} % (estimated)" in view.text("#notes")
    assert query_of(view)["method"] == ["fast"]
    assert query_of(view)["effort"] == ["1"]
    measured = view.text("#measured-fast").split()[0]

    view.page.select_option("#effort", "8")
    view.wait()

    assert query_of(view)["effort"] == ["8"]
    assert float(view.text("#bound-fast").split()[0]) < float(estimate)
    assert float(view.text("#measured-fast").split()[0]) < float(measured)
    view.unfold("export")
    with view.page.expect_download() as downloaded:
        view.page.click("#download-isolines >> text=OBJ")
    assert "\nl " in Path(downloaded.value.path()).read_text()


def test_points_can_be_written(view: View, sphere: str) -> None:
    view.open(f"/?mesh={sphere}&{PLAIN}")
    view.ask("v0 p0,0,2 > f0:0.5,0.5,0")
    view.page.wait_for_selector("#readout:visible")
    view.wait()
    assert length_of(view) > 0

    view.ask("v0 > v99999999")
    view.wait("error")
    assert "99999999" in view.text("#error-detail")

    view.ask("v0 > nonsense")
    view.page.wait_for_selector("#error-detail:has-text('“nonsense” is not a point.')")


def test_points_that_are_located_late_do_not_undo_what_was_written_since(
    view: View, sphere: str
) -> None:
    held: list[Route] = []
    view.open(f"/?mesh={sphere}&{PLAIN}")
    view.page.route("**/locate", lambda route: route.continue_() if held else held.append(route))
    with view.page.expect_request("**/locate"):
        view.ask("v0 p0,0,2")
    view.ask("v0 > v9")
    view.page.wait_for_selector("#readout:visible")
    with view.page.expect_response("**/locate"):
        held[0].continue_()
    view.wait()
    assert view.page.is_visible("#readout")
    assert query_of(view)["source"] == ["v0"]


def test_a_largest_distance(view: View, sphere: str) -> None:
    view.open(f"/?mesh={sphere}&{PLAIN}&max_distance=0.5")
    view.click(0, 0)

    assert view.text("#tick-2") == "0.5" or float(view.text("#tick-2")) < 0.5
    assert np.ptp(view.colour(20, 20)) > 40
    assert np.ptp(view.colour(-160, 0)) < 40


# See


def test_isolines_are_where_they_should_be(view: View, sphere: str) -> None:
    view.open(f"/?mesh={sphere}&{PLAIN}")
    view.click(0, 0)
    without = view.pixels()
    view.page.select_option("#lines", "spacing")
    view.page.fill("#lines-value", "0.5")
    view.page.press("#lines-value", "Enter")
    view.wait()

    changed = np.abs(view.pixels() - without).max(axis=2) > 30
    x, y = map(round, view.centre)
    crossings = np.flatnonzero(changed[y, x : x + 190])
    expected = [
        away for away in range(190) for k in (1, 2) if abs(angle_at(view, away) - 0.5 * k) < 0.006
    ]
    assert len(crossings) > 0
    assert all(np.abs(crossings - away).min() <= 2 for away in expected)
    assert all(np.abs(np.array(expected) - crossing).min() <= 4 for crossing in crossings)


def test_rays_of_the_polar_grid_leave_the_source_evenly(view: View, sphere: str) -> None:
    view.open(f"/?mesh={sphere}&{PLAIN}")
    view.click(0, 0)
    without = view.pixels()
    view.page.check("#polar")
    view.wait()
    assert view.page.input_value("#lines") == "count", "circles as well"
    view.page.select_option("#lines", "none")
    view.wait()

    turns = np.radians(np.arange(0, 360, 0.25))
    away = 60  # farther on, some are no shortest paths: around a vertex it is shorter
    x, y = view.centre[0] + away * np.cos(turns), view.centre[1] + away * np.sin(turns)
    columns, rows = np.rint(x).astype(int), np.rint(y).astype(int)
    is_ray = np.abs(view.pixels() - without).max(axis=2)[rows, columns] > 30
    there = turns[is_ray]
    starts = there[np.diff(there, prepend=there[-1] - 2 * math.pi) > 5 / away]  # pixels
    assert len(starts) == 24
    np.testing.assert_allclose(np.diff(starts), 2 * math.pi / 24, atol=2 / away)
    assert query_of(view)["polar"] == ["1"]

    view.page.uncheck("#polar")
    view.wait()
    assert np.abs(view.pixels() - without)[rows, columns].max() <= 8


def test_a_straight_line_follows_the_pointer_and_tells_where_it_ends(
    view: View, sphere: str
) -> None:
    view.open(f"/?mesh={sphere}&{PLAIN}")
    view.click(-100, 0)
    view.page.click("#tools >> text=Walk")
    view.drag((-100, 0), (-60, 40), (60, 0))

    turned = angle_at(view, 100) + angle_at(view, 60)
    chord = 2 * math.sin(turned / 2)
    told = view.text("#notes")
    assert told.startswith("Straight on: ")
    assert told.endswith("mesh units, as long as it was drawn.")
    assert float(told.split()[2]) == pytest.approx(chord, rel=0.01)
    line = seen(view, WALK)
    ahead = line[:, 0].max() - 5  # the radius of the mark at the end
    assert angle_at(view, ahead) == pytest.approx(chord - angle_at(view, 100), abs=0.03)
    assert line[:, 0].min() < -85
    assert np.abs(line[:, 1]).max() < 12

    walk = np.array(query_of(view)["walk"][0].split(","), float)
    view.ask(", ".join(map(str, -walk)), "#walk")
    view.wait()
    assert seen(view, WALK)[:, 0].max() < -80
    view.page.click("#clear")
    view.wait()
    assert len(seen(view, WALK)) == 0


def test_a_straight_line_ends_at_the_boundary(view: View, service: str) -> None:
    view.open(f"/?mesh={sample(service, 'plane', 50)}&source=v0&walk=0.5,0.25,0&lines=none")
    view.ask("5, 2.5, 0", "#walk")
    view.wait()
    assert (
        view.text("#notes") == f"Straight on: {math.sqrt(1.25):.5f} mesh units, up to the boundary."
    )


def test_the_distance_under_the_pointer_is_told_in_the_unit_of_the_mesh(
    view: View, sphere: str
) -> None:
    view.open(f"/?mesh={sphere}&{PLAIN}")
    view.click(0, 0)
    x, y = view.centre
    view.page.mouse.move(x + 120, y)
    words = view.text("#here")
    expected = angle_at(view, 120)

    value = float(words.removeprefix("≈ ").removesuffix(" mesh units here"))
    assert value == pytest.approx(expected, rel=0.02)
    view.unfold("more-display")
    view.page.fill("#unit", "mm")
    view.page.press("#unit", "Enter")
    view.wait()
    assert view.text("#legend-title") == "Distance in mm"
    assert "2 × 2 × 2 mm" in view.text("#report")
    view.page.mouse.move(x + 120, y)
    assert view.text("#here").endswith(" mm here")
    view.page.mouse.move(x + 120, y - 300)
    assert view.page.is_hidden("#here")


def test_a_picture_is_refused_in_a_sentence(view: View) -> None:
    view.open()
    picture = FilePayload(name="cat.png", mimeType="image/png", buffer=b"\x89PNG")
    view.page.set_input_files("#file", picture)
    view.wait("error")
    assert view.text("#error-title") == "Not a mesh"
    assert view.text("#error-detail") == "cat.png is an image."


def test_the_search_step_by_step(view: View, knot: str) -> None:
    view.open(f"/?mesh={knot}&source=v0&target=v1000")
    orange = view.pixels()
    view.page.click("#explain-start")
    view.wait()
    words = []
    for _ in range(3):
        words.append(view.text("#step-words"))
        view.page.press("#step", "ArrowRight")
    view.wait()

    assert words[0].startswith("1 of ")
    assert "along edges" in words[0]
    assert "window" in words[2]
    assert (np.abs(view.pixels() - orange).max(axis=2) > 40).sum() > 500
    view.page.click("#explain-stop")
    assert not view.page.is_visible("#steps")


def test_wireframe_and_theme(view: View, sphere: str) -> None:
    view.open(f"/?mesh={sphere}&{PLAIN}")
    plain = view.pixels()
    view.unfold("more-display")
    view.page.check("#wireframe")
    view.wait()
    view.page.wait_for_timeout(200)
    assert (np.abs(view.pixels() - plain).max(axis=2) > 25).sum() > 2000

    ground = view.colour(-330, -330)
    view.page.click("#theme")
    assert np.abs(view.colour(-330, -330) - ground).min() > 100


# Wait


def coloured(view: View) -> float:
    """Return the share of the canvas that has colours of distance."""
    box = view.page.locator("#canvas").bounding_box()
    assert box is not None
    pixels = view.pixels()[100:600, int(box["x"]) + 200 :]
    return float((np.ptp(pixels, axis=2) > 60).mean())


@pytest.fixture
def slow_workers(server: Server) -> Iterator[None]:
    """Workers that need ten times as long, so that a query is long on any machine."""
    with slowed(server.workers):
        yield


@pytest.mark.usefixtures("slow_workers")
def test_a_long_query_is_rough_first_tells_its_progress_and_can_be_cancelled(
    view: View, server: Server, large: str
) -> None:
    view.open(f"/?mesh={large}&{PLAIN}")
    view.ask("v0")
    told = view.page.locator("#progress[value]")
    rough = view.page.locator("#legend-title", has_text="Rough distance in")
    rough.wait_for()
    assert "(estimated)" in view.text("#notes")
    assert coloured(view) > 0.02
    told.wait_for()
    first = float(told.get_attribute("value") or 0)
    while float(told.get_attribute("value") or 0) <= first:
        view.page.wait_for_timeout(20)

    with view.page.expect_request(lambda each: each.method == "DELETE"):
        view.page.click("#cancel")
    view.wait()

    assert not view.page.is_visible("#legend")
    assert coloured(view) < 0.02
    wait_until(lambda: not server.client.get("/v1/jobs").json()["jobs"])

    view.ask("v1")
    rough.wait_for()
    told.wait_for()  # of the exact distances, which are begun once nothing else is asked
    stopped = server.metric("geodesic_cancellations_total")
    view.ask("v2")  # stops the work on exact distances from v1
    wait_until(lambda: server.metric("geodesic_cancellations_total") > stopped)
    rough.wait_for()
    view.page.keyboard.press("Escape")
    view.wait()
    assert not view.page.is_visible("#legend")


# Export


def test_a_permalink_restores_points_and_view(view: View, sphere: str) -> None:
    view.open(f"/?mesh={sphere}&lines=none")  # which shift by parts of a pixel
    view.drag((-250, 250), (-150, 200))  # beside the mesh: turns it
    view.click(-50, 0)
    view.click(80, 30)
    view.unfold("export")
    view.page.click("#copy-link")
    link = view.page.evaluate("navigator.clipboard.readText()")
    before, length = view.pixels(), view.text("#length")

    view.open("/")
    view.open(link)

    assert view.text("#length") == length
    changed = np.abs(view.pixels() - before).max(axis=2) > 8
    box = view.page.locator("#canvas").bounding_box()
    assert box is not None
    assert changed[100:600, int(box["x"]) :].mean() < 0.001


def test_a_permalink_to_nothing(view: View) -> None:
    view.page.goto("/?mesh=0123456789abcdef")
    view.wait("error")

    assert view.text("#error-title") == "Mesh not found"


def test_copied_programs_run(view: View, knot: str) -> None:
    view.open(f"/?mesh={knot}&source=v4000&source=v0&target=v1000")
    length = length_of(view)
    view.unfold("export")
    view.page.click("#copy-curl")
    command = view.page.evaluate("navigator.clipboard.readText()")
    view.page.click("#copy-python")
    program = view.page.evaluate("navigator.clipboard.readText()")

    run = partial(subprocess.run, capture_output=True, text=True, check=True)
    by_curl = run(["bash", "-c", command]).stdout
    by_python = run([sys.executable, "-c", program]).stdout

    assert json.loads(by_curl)["length"] == pytest.approx(length, rel=1e-5)
    assert float(by_python.split()[0]) == pytest.approx(length, rel=1e-5)


# For everyone


def test_by_keyboard_alone(view: View, sphere: str) -> None:
    view.open(f"/?mesh={sphere}&{PLAIN}")
    keys = view.page.keyboard
    view.page.focus("#canvas")
    keys.press("Enter")
    view.wait()
    for _ in range(4):
        keys.press("ArrowRight")
    assert view.text("#cue") == "Enter sets B; Shift+Enter adds another start"
    keys.press("Enter")
    view.wait()
    assert length_of(view) == pytest.approx(4 * 0.12 * math.sin(1.2), rel=0.02)

    keys.press("ArrowRight")
    keys.press("Alt+Enter")
    keys.press("ArrowRight")
    keys.press("Shift+Enter")
    assert (len(query_of(view)["source"]), len(query_of(view)["via"])) == (2, 1)
    keys.press("e")
    view.wait()
    assert view.page.is_checked("#methods [value=approximate]")
    keys.press("e")
    view.wait()
    assert view.page.is_checked("#methods [value=fast]")
    keys.press("i")
    keys.press("w")
    assert view.page.is_checked("#wireframe")
    assert "lines" not in query_of(view), "as many as at first"
    keys.press("f")
    assert "view" not in query_of(view)


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_no_fault_of_access(view: View, knot: str, theme: str) -> None:
    axe = (ROOT / "app/web/node_modules/axe-core/axe.min.js").read_text()
    view.page.emulate_media(color_scheme="dark" if theme == "dark" else "light")
    asked = f"/?mesh={knot}&source=v0;v10&via=v7&target=v1000&shade=territories&barriers=3"
    for address, is_cut in (("/", False), (asked, False), (asked, True)):
        view.page.set_viewport_size({"width": 1100, "height": 700})
        view.open(address)
        if is_cut:
            view.press("#cut-start")
        view.page.locator("details").evaluate_all("all => all.forEach(each => each.open = true)")
        view.page.evaluate(axe)
        for width, height in ((1100, 700), (360, 640)):
            view.page.set_viewport_size({"width": width, "height": height})
            view.page.locator("#folded").evaluate("each => each.hidden = false")
            found = view.page.evaluate("axe.run()")
            faults = [
                (each["id"], [node["html"][:120] for node in each["nodes"]])
                for each in found["violations"]
            ]
            assert faults == [], (address, is_cut, width)
