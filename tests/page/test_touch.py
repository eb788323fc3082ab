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


def tap(view: View, *places: tuple[float, float], seconds: float = 0.1) -> None:
    """Touch places, one after the other, for a while."""
    for place in places:
        view.touch(place)
        view.touch(after=seconds)
        view.wait()


def test_what_fingers_are_told_is_what_they_do(view: View, sphere: str) -> None:
    view.open(f"/?mesh={sphere}&{PLAIN}")
    assert view.text("#cue") == "Tap sets A, the next one B"
    tap(view, (-100, 0))
    assert view.text("#cue") == "Tap sets B"
    tap(view, (100, 0))
    assert view.text("#cue") == "Tap moves the nearer end; hold adds a stop"
    tap(view, (0, 100), seconds=0.7)
    first = query_of(view)
    assert [len(first[name]) for name in ("source", "via", "target")] == [1, 1, 1]
    tap(view, (80, -40))
    moved = query_of(view)
    assert moved.pop("target") != first.pop("target")
    assert moved == first


def test_a_finger_pulls_a_path(view: View, sphere: str) -> None:
    view.open(f"/?mesh={sphere}&{PLAIN}")
    tap(view, (-100, 0), (0, 60))
    before = query_of(view)

    view.touch((15, 70))  # fingers are broad
    for place in [(40, 60), (60, 60), (100, 40)]:
        view.touch(place)
    view.touch()
    view.wait()

    a, b = angle_at(view, 100), angle_at(view, math.hypot(100, 40))
    between = math.pi - math.atan2(40, 100)
    chord = math.cos(a) * math.cos(b) + math.sin(a) * math.sin(b) * math.cos(between)
    assert length_of(view) == pytest.approx(math.acos(chord), rel=0.01)
    after = query_of(view)
    assert after.pop("target") == [view.page.get_attribute("#readout", "data-target")]
    del before["target"]
    assert after == before, "neither another start nor another view"


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
    [("A → B", ON_SOURCE), ("A → B", BESIDE), ("Stop", BESIDE), ("Barrier", BESIDE)],
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
