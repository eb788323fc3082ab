"""
Eleven stories from end to end, each on a desktop and on a phone.

The gallery has five of them. They are played whenever the page is tested.
"""

import json
import re
from collections.abc import Callable
from pathlib import Path

import httpx2
import numpy as np
import pytest
import trimesh
from scipy import ndimage

import geodesic_core as gc
from tests.page.conftest import sample
from tests.page.test_answers import assert_blank, has_path
from tests.page.test_exports import saved
from tests.page.test_film import STEPS, begin, scrub, sees_front
from tests.page.test_page import PATH, seen
from tests.page.test_tools import asked
from tests.support.viewing import PLAIN, View, angle_at, length_of, query_of
from tests.support.waiting import wait_until


def test_two_clicks_make_a_path(device: View, sphere: str) -> None:
    device.open(f"/?mesh={sphere}&{PLAIN}")
    device.click(-80, 0)
    device.click(80, 0)
    assert length_of(device) == pytest.approx(2 * angle_at(device, 80), rel=0.01)
    assert device.text("#length-names") == "A → B"
    path = seen(device, PATH)
    assert path[:, 0].min() < -70 < 70 < path[:, 0].max()
    assert device.page.is_visible("#legend")

    before = query_of(device)
    device.click(60, 30)
    after = query_of(device)
    assert before.pop("target") != after.pop("target"), "the nearer end moves"
    assert after == before


def test_ten_steps_are_undone_and_done_again(device: View, sphere: str) -> None:
    device.open(f"/?mesh={sphere}&{PLAIN}")
    told: list[dict[str, list[str]]] = [query_of(device)]

    def step(act: Callable[[], object]) -> None:
        act()
        device.wait()
        told.append(query_of(device))
        assert told[-1] != told[-2]

    step(lambda: device.click(-80, 0))
    step(lambda: device.click(80, 0))
    step(lambda: device.drag((80, 0), (60, 50), (0, 60)))
    step(lambda: device.click(0, -60, "Alt"))
    device.press("#tools >> text=Start")
    device.fold()
    step(lambda: device.click(-60, -60))
    device.press("#tools >> text=Barrier")
    device.fold()
    step(lambda: device.drag((20, 20), (40, 40)))
    step(lambda: device.reach("#palette").select_option("magma"))
    step(lambda: device.press("#distances"))
    step(lambda: device.press("#places >> [aria-label='Remove A']"))
    step(lambda: device.press("#clear"))
    assert len(told) == 11
    for before in reversed(told[:-1]):
        device.page.keyboard.press("Control+z")
        assert query_of(device) == before
    assert device.page.is_disabled("#undo")
    for after in told[1:]:
        device.press("#redo")
        assert query_of(device) == after
    device.press("#undo")
    device.page.keyboard.press("Control+Shift+z")
    device.wait()
    assert query_of(device) == told[-1]
    assert not device.page.is_visible("#legend")


def test_a_closed_isoline_is_drawn_closed(
    device: View, service: str, sphere: str, tmp_path: Path
) -> None:
    """Around A, which is in the middle of what is seen."""
    device.open(f"/?mesh={sphere}&source=v0&lines=none")
    without = device.pixels()
    device.reach("#lines").select_option("spacing")
    device.page.fill("#lines-value", "1")
    device.page.press("#lines-value", "Enter")
    device.fold()
    device.wait()
    unchanged = np.abs(device.pixels() - without).max(axis=2) <= 30
    parts, _ = ndimage.label(unchanged)
    x, y = map(round, device.centre)
    left = device.page.locator("#canvas").bounding_box()["x"]
    within, beyond = parts[y, x], parts[y, round(left) + 2]
    assert 0 not in (within, beyond)
    assert within != beyond, "the line divides what is within from what is beyond"

    answer = asked(service, sphere, "isolines", sources=[0], levels=[1, 2, 3])
    lines = [line for level in answer["isolines"] for line in level["lines"]]
    assert all(line["closed"] for line in lines)
    features = json.loads(saved(device, "#geojson", tmp_path).read_text())["features"]
    drawn = [each["geometry"]["coordinates"] for each in features]
    assert drawn == [[*line["points"], line["points"][0]] for line in lines]


def test_an_error_clears_the_answer_before(device: View, sphere: str) -> None:
    device.open(f"/?mesh={sphere}&source=v0&target=v900&lines=none")
    right = length_of(device)
    assert has_path(device)
    device.ask("v99999999 > v900")
    device.wait("error")
    assert device.text("#error-title") == "Invalid point"
    assert device.text("#error-detail").endswith(
        "vertex 99999999 does not exist; the indices are 0 to 2561"
    )
    assert device.page.input_value("#points") == "v99999999 > v900"
    device.press("#error-close")
    device.fold()
    device.wait()
    assert_blank(device)

    device.ask("v0 > v900")
    device.wait()
    assert length_of(device) == right
    assert device.page.is_visible("#legend")


def test_the_film_plays_pauses_and_shows_the_steps_of_the_library(
    device: View, service: str
) -> None:
    device.open(f"/?mesh={sample(service, 'terrain', 200)}&source=v40")
    begin(device)
    wait_until(lambda: any("Propagate" in told for told in device.page.evaluate("window.told")))
    start, first, *_ = device.page.evaluate("window.told")
    assert "Start" in start
    assert "Initialise" in first
    device.press("#film-play")
    paused = device.text("#film-words")
    device.page.wait_for_timeout(400)
    assert device.text("#film-words") == paused
    assert device.text("#film-play") == "Play"

    steps = gc.sweep_steps(gc.samples.terrain(200), 40, STEPS)
    last = len(steps) - 1
    assert device.page.get_attribute("#film-step", "max") == str(last)
    told, has_front, lit = set(), {}, {}
    for step in (0, 1, last // 2, last):
        counts = [steps.waiting[step], steps.crossed[step], steps.trimmed[step]]
        found = scrub(device, step)
        assert re.findall(r"([\d,]+) (?:windows? waiting|done|trimmed)", found) == [
            f"{number:,}" for number in counts
        ]
        told.add(device.text("#film-words"))
        has_front[step] = sees_front(device)
        lit[step] = device.colour().mean()
    assert len(told) == 4
    assert has_front == {0: False, 1: True, last // 2: True, last: False}
    assert lit[0] + 30 < lit[last], "what is reached lights up"
    assert "The queue is empty" in device.text("#film-words")
    device.press("#film-stop")
    assert device.page.is_hidden("#player")


def test_a_glb_has_the_surface_in_its_colours_and_the_path(
    device: View, knot: str, tmp_path: Path
) -> None:
    device.open(f"/?mesh={knot}&source=v0&target=v1000")
    scene = trimesh.load_scene(saved(device, "#glb", tmp_path))
    surface, path = (scene.geometry[scene.graph[name][1]] for name in ("surface", "path"))
    assert path.length == pytest.approx(length_of(device), rel=1e-5)
    distances = np.load(saved(device, "#download-distances >> text=NPY", tmp_path))
    assert len(surface.vertices) == len(distances)
    colours = np.asarray(surface.visual.vertex_attributes["color"])[:, :3]
    near, far = colours[np.argmin(distances)], colours[np.argmax(distances)]
    assert near.mean() < far.mean(), "from dark to light"


def test_each_story_of_the_gallery_opens_with_its_answer(device: View) -> None:
    device.open()
    stories = device.page.locator("#stories a")
    for i in range(stories.count()):
        title = stories.nth(i).locator("strong").inner_text()
        device.press(f"#stories a >> nth={i}")
        query = query_of(device)
        assert (len(query["mesh"]), "sample" in query) == (1, False), title
        assert device.page.is_visible("#legend"), title
        if "target" in query:
            assert length_of(device) > 0, title
            assert len(seen(device, PATH)) > 50, title
        else:
            starts = len(query["source"])
            assert device.page.locator("#territories li").count() == starts > 1, title
        assert not device.page.is_visible("#stories ul"), "what is not used is folded"
    assert i == 4


def test_a_cut_is_taken_back_by_its_row(device: View, service: str, sphere: str) -> None:
    device.open(f"/?mesh={sphere}&source=v0*Home&target=v900&{PLAIN}")
    length = device.text("#length")
    device.press("#cut-start")
    (halves,) = query_of(device)["mesh"]
    assert httpx2.get(f"{service}/v1/meshes/{halves}").json()["cut_from"] == sphere
    assert device.page.locator("#places .name").all_text_contents() == ["Cut along the path"]
    assert device.page.is_hidden("#readout")
    device.click(-40, 0)
    device.click(40, 0)
    set_on_it = query_of(device)

    device.page.reload()
    device.wait()
    device.press("#places >> [aria-label='Remove Cut along the path']")
    assert query_of(device)["mesh"] == [sphere]
    assert query_of(device)["source"] == ["v0*Home"]
    assert device.text("#length") == length
    device.press("#undo")
    assert query_of(device) == set_on_it
    device.press("#redo")
    assert device.text("#length") == length
    assert "cut" not in query_of(device)
