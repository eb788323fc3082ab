"""The page by fingers."""

import math

import pytest

from tests.support.viewing import PLAIN, View, angle_at, length_of, query_of

pytestmark = pytest.mark.file_slice(2)


def test_a_tap(view: View, sphere: str) -> None:
    view.page.set_viewport_size({"width": 390, "height": 780})
    view.open(f"/?mesh={sphere}&lines=none")
    view.page.touchscreen.tap(*view.centre)
    view.wait()

    assert query_of(view)["source"][0].startswith("f")
    assert not view.page.is_visible("#folded")


def test_a_finger_that_stays_adds_a_source(view: View, sphere: str) -> None:
    view.open(f"/?mesh={sphere}&{PLAIN}")
    for place, seconds in (((-100, 0), 0.0), ((100, 0), 0.7)):
        view.touch(place)
        view.page.wait_for_timeout(1000 * seconds)
        view.touch()
        view.wait()
    first, second = query_of(view)["source"]
    assert first != second

    view.touch((0, 100))
    view.touch()
    view.wait()
    assert len(query_of(view)["source"]) == 1


def test_a_finger_pulls_a_path(view: View, sphere: str) -> None:
    view.open(f"/?mesh={sphere}&{PLAIN}")
    view.touch((-100, 0))
    view.touch()
    view.wait()
    before = query_of(view)

    view.touch((-80, 10))  # fingers are broad
    for place in [(-40, 40), (0, 60), (60, 60), (100, 40)]:
        view.touch(place)
    view.page.wait_for_selector("#readout:visible")
    view.touch()
    view.wait()

    a, b = angle_at(view, 100), angle_at(view, math.hypot(100, 40))
    between = math.pi - math.atan2(40, 100)
    chord = math.cos(a) * math.cos(b) + math.sin(a) * math.sin(b) * math.cos(between)
    assert length_of(view) == pytest.approx(math.acos(chord), rel=0.01)
    after = query_of(view)
    assert after.pop("target") == [view.page.get_attribute("#readout", "data-target")]
    assert after == before, "neither another source nor another view"


def test_a_finger_turns_the_mesh(view: View, sphere: str) -> None:
    view.open(f"/?mesh={sphere}&{PLAIN}")
    view.touch((0, 0))
    for x in (20, 40, 60):
        view.touch((x, 0))
    view.touch()
    view.wait()

    query = query_of(view)
    theta, phi, radius = map(float, query["view"][0].split(",")[:3])
    assert theta < 0.5
    assert (phi, radius) == (1.2, 2.9)
    assert "source" not in query


ON_SOURCE, BESIDE = (-100, 0), (-60, 0)


@pytest.mark.parametrize(
    ("tool", "first"),
    [("Source", ON_SOURCE), ("Source", BESIDE), ("Target", BESIDE), ("Barrier", BESIDE)],
)
def test_two_fingers_move_the_mesh_and_set_nothing(
    view: View, sphere: str, tool: str, first: tuple[int, int]
) -> None:
    view.open(f"/?mesh={sphere}&{PLAIN}")
    view.touch((-100, 0))
    view.touch()
    view.wait()
    before = query_of(view)
    view.page.click(f"#tools >> text={tool}")

    x, y = first
    view.touch((x, y))
    view.touch((x + 15, y))  # before the other finger is down
    view.touch((x + 15, y), (100, 0))
    for away in (10, 20, 40):
        view.touch((x + 15 - away, y), (100 + away, 0))
    view.touch((x - 25, y))
    view.touch()
    view.wait()

    after = query_of(view)
    assert float(after.pop("view")[0].split(",")[2]) < 2.6, "nearer"
    del before["view"]
    assert after == before
    assert not view.page.is_visible("#readout")


def test_the_hint_speaks_of_fingers(view: View, sphere: str) -> None:
    view.open(f"/?mesh={sphere}")

    assert "Tap" in view.text("#hint")
    assert "Shift" not in view.text("#hint")
