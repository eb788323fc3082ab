"""What people do on the page, and what they see."""

import math

import numpy as np

from .viewing import View

PLAIN = "lines=none&view=0.6,1.2,2.9,0,0,0"


def query_of(view: View) -> dict[str, list[str]]:
    """Return the parameters of the address that the page has written."""
    view.page.wait_for_timeout(300)
    search: dict[str, list[str]] = view.page.evaluate(
        "() => { const q = new URLSearchParams(location.search); const r = {};"
        "for (const k of q.keys()) r[k] = q.getAll(k); return r; }"
    )
    return search


def angle_at(view: View, away: float) -> float:
    """Return the angle from the middle of a unit sphere to what is drawn so many pixels away."""
    box = view.page.locator("#canvas").bounding_box()
    assert box is not None
    slope = away / (box["height"] / 2) * math.tan(math.radians(38 / 2))
    distance, radius = 2.9, 1 / math.sqrt(3)  # of a sphere whose bounding box's diagonal is 2
    ray = math.atan(slope)
    return math.asin(distance * math.sin(ray) / radius) - ray


def ramp_at(view: View, share: float) -> np.ndarray:
    """Return the colour that the legend has for a share of the largest distance."""
    box = view.page.locator("#ramp").bounding_box()
    assert box is not None
    x, y = box["x"] + share * (box["width"] - 1), box["y"] + box["height"] / 2
    return view.pixels()[round(y), round(x)].astype(float)


def is_shade_of(seen: np.ndarray, colour: np.ndarray) -> bool:
    """Whether a colour is another one in some light."""
    cosine = seen @ colour / np.linalg.norm(seen) / np.linalg.norm(colour)
    return bool(cosine > 0.99)


def test_a_sample_is_loaded_and_a_click_colours_it(view: View) -> None:
    view.open()
    ground = view.colour(-300, -300)
    view.page.click("#samples [data-sample=sphere]")
    view.wait()
    assert "one piece, closed" in view.text("#report")
    clay = view.colour()
    assert np.ptp(clay) < 40
    assert np.abs(clay - ground).max() > 20

    view.click(0, 0)

    assert query_of(view)["source"][0].startswith("f")
    assert np.ptp(view.colour(60, 60)) > 40


def test_colours_are_those_of_the_distance(view: View, sphere: str) -> None:
    view.open(f"/?mesh={sphere}&{PLAIN}")
    view.click(0, 0)

    for away in [(40, 0), (-90, 0), (0, 110), (100, -100), (0, -160)]:
        share = angle_at(view, math.hypot(*away)) / math.pi
        assert is_shade_of(view.colour(*away), ramp_at(view, share)), away
        assert not is_shade_of(view.colour(*away), ramp_at(view, share + 0.3)), away
