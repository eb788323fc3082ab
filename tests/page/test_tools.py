"""The tools of the page, each against what the service answers."""

import json
import re
from io import BytesIO
from pathlib import Path
from typing import Any

import httpx2
import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray
from playwright.sync_api import FilePayload

from tests.page.conftest import sample
from tests.page.test_exports import saved
from tests.page.test_page import rows, seen
from tests.support.viewing import PLAIN, View, length_of, query_of

pytestmark = pytest.mark.file_slice(4)

HUES = np.array(  # of Okabe and Ito
    [
        [230, 159, 0],
        [86, 180, 233],
        [0, 158, 115],
        [240, 228, 66],
        [0, 114, 178],
        [213, 94, 0],
        [204, 121, 167],
    ]
)


def asked(service: str, mesh: str, operation: str, **body: Any) -> dict[str, Any]:
    """Return what the service answers to a query."""
    answer = httpx2.post(f"{service}/v1/meshes/{mesh}/{operation}", json=body, timeout=300)
    assert answer.status_code < 300, answer.text
    return dict(answer.json())


def points_of(query: dict[str, list[str]]) -> list[dict[str, int]]:
    """Return the starts of an address, which are vertices."""
    return [{"vertex": int(point.removeprefix("v"))} for point in query["source"]]


def test_points_are_spread_and_their_cells_have_areas(view: View, service: str) -> None:
    """On a square, seen from above: each colour covers as much of it as its cell."""
    plane = sample(service, "plane", 800)
    view.open(f"/?mesh={plane}&source=v123&lines=none&view=0,0.01,4.8,0,0,0&up=z")
    view.unfold("more-regions")
    view.page.fill("#spread-value", "5")
    view.page.press("#spread-value", "Enter")
    view.page.wait_for_selector("#territories li:has-text('%')")
    view.wait()

    points = points_of(query_of(view))
    samples = asked(service, plane, "samples", count=5, starts=[123])
    assert points == [{"vertex": point["vertex"]} for point in samples["points"]]
    assert f"within {samples['covering_radius']:.4}"[:11] in view.text("#notes")
    areas = asked(service, plane, "cells", sources=points)["areas"]
    told = [row.split(": ")[1] for row in view.text("#territories").splitlines()]
    assert [float(row.split()[0]) for row in told] == pytest.approx(areas, rel=1e-3)

    pixels = view.pixels()
    dots = view.page.locator("#territories .dot").evaluate_all(
        "dots => dots.map(dot => getComputedStyle(dot).backgroundColor.match(/\\d+/g).map(Number))"
    )
    box = view.page.locator("#legend").bounding_box()
    assert box is not None
    pixels = pixels[:, round(box["x"] + box["width"]) :]
    hues = np.array(dots) / np.linalg.norm(dots, axis=1)[:, None]
    cosines = pixels @ hues.T / np.maximum(np.linalg.norm(pixels, axis=2), 1)[..., None]
    is_drawn = np.ptp(pixels, axis=2) > 50
    drawn = np.bincount(cosines.argmax(axis=2)[is_drawn], minlength=5)
    np.testing.assert_allclose(drawn / drawn.sum(), np.array(areas) / sum(areas), atol=0.02)


def test_the_mesh_is_cut_along_isolines_and_this_is_undone(
    view: View, service: str, sphere: str, tmp_path: Path
) -> None:
    plain = f"lines=count:2&flat=1&{PLAIN.split('&')[1]}"
    view.open(f"/?mesh={sphere}&source=v0&target=v900&{plain}")
    before = view.text("#length")
    view.unfold("more-shape")
    view.page.uncheck("#cut-path")
    view.page.check("#cut-isolines")
    view.page.click("#cut-start")
    view.page.wait_for_selector("#cut-note:has-text('Cut along')")
    view.wait()

    (cut_mesh,) = query_of(view)["mesh"]
    report = httpx2.get(f"{service}/v1/meshes/{cut_mesh}").json()
    assert report["cut_from"] == sphere
    assert view.text("#cut-note") == (
        f"Cut along 2 curves: 3 parts, {report['vertices']:,} vertices."
    )
    assert (report["components"], report["boundary_loops"]) == (3, 4)
    assert "3 pieces, with 4 boundaries" in view.text("#report")
    assert query_of(view)["boundary"] == ["1"]

    counts = [len(seen(view, np.minimum(1.06 * hue, 255), 3)) for hue in HUES]
    assert min(counts[:3]) > 100, "each piece has its colour"
    assert max(counts[3:]) == 0
    view.unfold("export")
    drawn = trimesh.load_mesh(saved(view, "#obj", tmp_path), process=False)
    for name in ("vertices", "faces"):
        array = httpx2.get(f"{service}/v1/meshes/{cut_mesh}/arrays/{name}")
        assert np.array_equal(getattr(drawn, name), np.load(BytesIO(array.content)))

    view.page.click("#undo")
    view.wait()
    assert query_of(view)["mesh"] == [sphere]
    assert view.text("#length") == before


def test_a_row_of_the_list_leads_back_to_before_its_cut(view: View, service: str) -> None:
    """By the keyboard, from a cut of a cut, after the page is opened anew."""
    whole = sample(service, "sphere", 800)
    view.open(f"/?mesh={whole}&source=v0&target=v90&lines=none")
    meshes = [whole]
    for points in ("v0 > v90", "v5 > v70"):
        view.ask(points)
        view.press("#cut-start")
        meshes += query_of(view)["mesh"]
    assert rows(view) == ["Cut 1 along the path ×", "Cut 2 along the path ×"]
    assert len(set(meshes)) == 3
    assert view.page.is_disabled("#clear"), "that is for the question"

    view.page.reload()
    view.wait()
    for name, mesh, points in (
        ("Cut 2 along the path", meshes[1], "v5 > v70"),
        ("Cut along the path", whole, "v0 > v90"),
    ):
        view.page.focus(f"#places >> [aria-label='Remove {name}']")
        view.page.keyboard.press("Enter")
        view.wait()
        assert query_of(view)["mesh"] == [mesh]
        assert view.page.input_value("#points") == points
        assert length_of(view) > 0
    assert view.page.locator("#places .cut").count() == 0


def test_what_was_cut_may_be_gone(view: View, service: str) -> None:
    whole = sample(service, "sphere", 500)
    view.open(f"/?mesh={whole}&source=v0&target=v90&lines=none")
    view.press("#cut-start")
    (cut_mesh,) = query_of(view)["mesh"]
    assert httpx2.delete(f"{service}/v1/meshes/{whole}").status_code == 204
    view.page.click("#places >> [aria-label='Remove Cut along the path']")
    view.wait("error")
    assert view.text("#error-title") == "Mesh not found"
    view.page.click("#undo")
    view.wait()
    assert query_of(view)["mesh"] == [cut_mesh]
    assert rows(view) == ["Cut along the path ×"]


def test_values_of_a_file_are_coloured_with_their_level_sets(
    view: View, service: str, sphere: str
) -> None:
    """Heights of a sphere: levels are circles, which the service draws."""
    array = httpx2.get(f"{service}/v1/meshes/{sphere}/arrays/vertices")
    heights = np.load(BytesIO(array.content))[:, 2]
    view.open(f"/?mesh={sphere}&{PLAIN.replace('none', 'spacing:0.5')}")
    text = "\n".join(["vertex,height", *(f"{i},{z!r}" for i, z in enumerate(heights.tolist()))])
    file = FilePayload(name="heights.csv", mimeType="text/csv", buffer=text.encode())
    view.page.set_input_files("#numbers", file)
    view.page.wait_for_selector("#legend-title:has-text('heights.csv')")
    view.wait()

    question = {"values": heights.tolist(), "levels": [-0.5, 0, 0.5]}
    lines = asked(service, sphere, "isolines", **question)["isolines"]
    circles = [line for level in lines for line in level["lines"]]
    assert all(line["closed"] for line in circles)
    view.unfold("export")
    with view.page.expect_download() as download:
        view.page.click("#geojson")
    features = json.loads(Path(download.value.path()).read_text())["features"]
    drawn = [each["geometry"]["coordinates"] for each in features]
    assert drawn == [[*line["points"], line["points"][0]] for line in circles]
    ends = [float(view.text(f"#tick-{i}")) for i in (0, 2)]
    assert ends == pytest.approx([heights.min(), heights.max()], rel=1e-2)
    assert "slope" not in query_of(view)

    view.page.click("#values-remove")
    view.wait()
    assert not view.page.is_visible("#legend")
    wrong = FilePayload(name="two.txt", mimeType="", buffer=b"1\n2\n")
    view.page.set_input_files("#numbers", wrong)
    view.wait("error")
    assert view.text("#error-detail") == (
        "two.txt has 2 numbers, and this mesh 2,562 vertices and 5,120 faces."
    )


def test_a_path_is_proved_once_its_end_is_a_vertex(view: View, service: str, knot: str) -> None:
    view.open(f"/?mesh={knot}&source=f0:0.2,0.3&target=f900:0.2,0.3&{PLAIN}")
    view.page.click("#prove")
    view.page.wait_for_selector("#path-proof:visible")
    view.wait()

    found = re.fullmatch(r"✓ Proved to (\de-\d+) of its length", view.text("#path-proof"))
    assert found
    (target,) = query_of(view)["target"]
    ends = {
        "source": {"face": 0, "barycentric": [0.2, 0.3, 0.5]},
        "target": {"vertex": int(target.removeprefix("v"))},
    }
    answer = asked(service, knot, "path", **ends, certify=True)
    certificate = dict(answer["certificate"])
    assert certificate["holds"]
    assert float(found[1]) == pytest.approx(certificate["relative_gap"], rel=0.5)
    view.page.click("#undo")
    view.wait()
    assert not view.page.is_visible("#path-proof")


def test_costs_by_slope_and_face_and_the_profile_of_the_path(view: View, service: str) -> None:
    land = sample(service, "terrain", 2000)
    view.open(f"/?mesh={land}&source=v10&target=v900&lines=none")
    shortest = length_of(view)
    view.unfold("profile")
    heights = np.array(asked(service, land, "path", source=10, target=900)["points"])[:, 2]
    assert float(view.text("#profile-high")) == pytest.approx(heights.max(), rel=1e-3)
    rises = np.diff(heights)
    climb, fall = rises[rises > 0].sum(), -rises[rises < 0].sum()
    told = re.findall(r"[\d.]+\d", view.text("#profile-words"))
    assert list(map(float, told)) == pytest.approx([climb, fall], rel=1e-3)

    view.unfold("more-costs")
    view.page.select_option("#slope", "tobler")
    view.wait()
    cost = {"slope": "tobler", "up": "+z"}
    quickest = asked(service, land, "path", source=10, target=900, cost=cost)
    assert length_of(view) == pytest.approx(quickest["cost"], rel=1e-5)
    costs = asked(service, land, "distances", sources=[10], cost=cost)["distances"]
    assert float(view.text("#tick-2")) == pytest.approx(np.max(costs), rel=1e-2)
    assert query_of(view)["slope"] == ["tobler:z"]
    assert not view.page.is_visible("#shades")

    view.page.select_option("#slope", "")
    faces = httpx2.get(f"{service}/v1/meshes/{land}").json()["faces"]
    double = FilePayload(name="double.txt", mimeType="", buffer=b"2\n" * faces)
    view.page.set_input_files("#numbers", double)
    view.wait()
    assert length_of(view) == pytest.approx(2 * shortest, rel=0.02)
    view.page.click("#face-costs-remove")
    view.wait()
    assert length_of(view) == shortest


def test_the_difference_of_two_methods(view: View, service: str, knot: str) -> None:
    view.open(f"/?mesh={knot}&source=v0&method=fast&effort=1&shade=difference&lines=none")
    view.unfold("more-method")

    def distances(**method: Any) -> NDArray[np.float64]:
        answer = asked(service, knot, "distances", sources=[0], **method)
        return np.array(answer["distances"], float)

    fast = distances(method="fast", effort=1)
    others: dict[str, dict[str, Any]] = {
        "exact": {},
        "approximate": {"method": "approximate", "relative_error": 0.01},
    }
    for other, question in others.items():
        view.page.select_option("#versus", other)
        view.wait()
        difference = np.abs(fast - distances(**question))
        assert view.text("#legend-title") == f"|fast − {other}| in mesh units"
        told = [
            float(x) for x in re.findall(r"(?:Largest|mean) ([\d.e-]+\d)", view.text("#difference"))
        ]
        assert told == pytest.approx([difference.max(), difference.mean()], rel=1e-2)
    assert query_of(view)["versus"] == ["approximate"]


def test_the_mesh_is_seen_from_usual_sides_in_section_and_flat(view: View, sphere: str) -> None:
    """A sphere: of its upper half, a section leaves nothing."""
    view.open(f"/?mesh={sphere}&source=v0&target=v900&lines=count:3&method=fast&labels=1&up=z")
    assert view.text("#legend-title") == "Rough distance in mesh units"
    assert re.search(r"exact; [\d.]+ straight$", view.text("#length-note"))
    assert view.page.locator("#level-labels span").count() == 3
    view.unfold("more-display")
    view.page.click("#look-front")
    view.wait()
    theta, phi = map(float, query_of(view)["view"][0].split(",")[:2])
    assert (theta, phi) == pytest.approx((0, np.pi / 2), abs=1e-3)
    view.hover(0, 0)
    x, y, z = (float(each.split()[1]) for each in re.findall(r"[xyz] \S+", view.text("#where")))
    assert np.array([x, y, z]) == pytest.approx([0, -1, 0], abs=0.02), "the front is towards -y"

    view.page.check("#flat")
    view.page.select_option("#lines", "none")
    view.wait()
    flat = view.colour(60, 60)
    ground = view.colour(-330, -200)
    assert np.abs(view.colour(60, -60) - ground).max() > 20
    view.page.select_option("#section", "z")
    view.wait()
    assert query_of(view)["section"] == ["z:0.5"]
    assert np.abs(view.colour(60, -60) - ground).max() < 12, "nothing is there"
    assert np.abs(view.colour(60, 60) - flat).max() < 3, "and this is as before"
    view.hover(60, -60)
    assert not view.page.is_visible("#where")
    column, row = map(round, view.centre)
    without = view.pixels()
    view.page.select_option("#lines", "count")
    view.wait()
    differs = np.abs(view.pixels() - without).max(axis=2)[:, column - 100 : column + 100] > 8
    assert differs[row : row + 100].any(), "lines on what is left"
    stray = differs[row - 100 : row - 4].sum()  # a line has a hundred pixels
    assert stray < 5, "and none on what is not there"

    box = view.page.locator("#canvas").bounding_box()
    assert box is not None
    view.page.mouse.click(box["x"] + box["width"] - 64, box["y"] + 64 - 45)  # the axis upwards
    view.wait()
    assert float(query_of(view)["view"][0].split(",")[1]) == pytest.approx(0, abs=0.03)
