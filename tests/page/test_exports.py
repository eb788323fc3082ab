"""Exports: what is drawn and answered, as files."""

import json
from pathlib import Path
from xml.etree import ElementTree as ET

import httpx2
import numpy as np
import pytest
from PIL import Image

from tests.page.test_page import PATH
from tests.support.viewing import View, length_of


def saved(view: View, button: str, folder: Path) -> Path:
    """Press a button; return the file that it hands over."""
    with view.page.expect_download() as download:
        view.press(button)
    path = folder / download.value.suggested_filename
    download.value.save_as(path)
    return path


def pixels_of(path: Path) -> np.ndarray:
    return np.asarray(Image.open(path).convert("RGB"), int)


def test_downloads(view: View, knot: str, tmp_path: Path) -> None:
    view.open(f"/?mesh={knot}&source=v0&target=v1000")
    distances = np.load(saved(view, "#download-distances >> text=NPY", tmp_path))
    assert distances[0] == 0
    assert distances[1000] == pytest.approx(length_of(view), rel=1e-5)

    picture = saved(view, "#picture", tmp_path)
    assert picture.name == "geodesic.png"
    assert (np.abs(pixels_of(picture) - PATH).max(axis=2) < 12).sum() > 100

    features = json.loads(saved(view, "#geojson", tmp_path).read_text())["features"]
    assert {each["properties"]["name"] for each in features} == {"path", "isoline"}
    (line,) = (each for each in features if each["properties"]["name"] == "path")
    steps = np.diff(line["geometry"]["coordinates"], axis=0)
    assert np.linalg.norm(steps, axis=1).sum() == pytest.approx(length_of(view), rel=1e-5)

    written = set(httpx2.get(view.page.url.split("/?")[0] + "/v1").json()["answer_formats"])
    for what, formats in {"path": {"obj", "csv"}, "isolines": {"obj", "csv"}}.items():
        offered = {text.lower() for text in view.text(f"#download-{what}").split()}
        assert offered == formats & written


@pytest.mark.parametrize("section", ["", "&section=x:0.6"])
def test_the_view_as_svg_looks_as_the_picture(
    view: View, knot: str, section: str, tmp_path: Path
) -> None:
    """Lines and points are shapes; what the surface or a section hides of them is hidden."""
    view.open(f"/?mesh={knot}&source=v0&source=v700&target=v1000&shade=territories{section}")
    picture = pixels_of(saved(view, "#picture", tmp_path))
    svg = saved(view, "#svg", tmp_path)
    tree = ET.parse(svg)  # noqa: S314 - of our own
    height, width = picture.shape[:2]
    assert (tree.getroot().get("width"), tree.getroot().get("height")) == (f"{width}", f"{height}")
    kinds = [element.tag.split("}")[1] for element in tree.iter()]
    assert kinds.count("image") == 1
    assert kinds.count("path") >= 4, "isolines or borders, and the path, with their casings"
    names = {element.text for element in tree.iter() if element.tag.endswith("text")}
    labels = view.page.locator("#point-labels span").all()
    assert names == {label.inner_text() for label in labels if label.is_visible()}

    page = view.page.context.new_page()
    page.set_viewport_size({"width": width, "height": height})
    page.goto(svg.as_uri())
    page.screenshot(path=tmp_path / "shown.png")
    page.close()
    shown = pixels_of(tmp_path / "shown.png")
    differs = np.abs(shown - picture).max(axis=2) > 80
    assert differs.mean() < 0.01, "names alone, which the picture does not have"
    seen, drawn = ((np.abs(each - PATH).max(axis=2) < 12).sum() for each in (picture, shown))
    assert drawn == pytest.approx(seen, rel=0.25), "a name may lie on it"
