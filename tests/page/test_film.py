"""The search as a film: what it shows is the library's, and the video has its steps."""

import re
from pathlib import Path

import httpx2
import numpy as np
import pytest
from playwright.sync_api import expect

from tests.page.conftest import sample
from tests.support.paths import ROOT
from tests.support.viewing import View
from tests.support.waiting import LONG_S

pytestmark = pytest.mark.file_slice(5)

FRONT = np.array([255, 204, 26])
STEPS = 240
SEGMENT, CLUSTER, GROUP, BLOCK, SIMPLE_BLOCK = 0x18538067, 0x1F43B675, 0xA0, 0xA1, 0xA3
_NOTE_WORDS = """() => {
    const place = document.getElementById('film-words');
    window.told = [];
    const note = () => window.told.push(place.textContent);
    new MutationObserver(note).observe(place, {childList: true});
}"""


def show(view: View, mesh: str, source: int) -> None:
    view.open(f"/?mesh={mesh}&source=v{source}")
    begin(view)


def begin(view: View) -> None:
    view.reach("#film-speed").select_option("3")  # a busy browser leaves out what follows quickly
    view.page.evaluate(_NOTE_WORDS)
    view.press("#film-start")
    view.page.locator("#player").wait_for()


def scrub(view: View, step: int) -> str:
    """Drag the slider to a step, and return the counts that are told."""
    view.page.locator("#film-step").fill(str(step))
    view.wait()
    return view.text("#film-counts")


def sees_front(view: View) -> bool:
    box = view.page.locator("#canvas").bounding_box()
    assert box is not None
    seen = view.pixels()[: round(box["y"] + box["height"])]  # the key lies below
    return bool((np.abs(seen - FRONT).max(axis=2) <= 8).sum() > 5)


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_no_fault_of_access(view: View, service: str, theme: str) -> None:
    view.page.emulate_media(color_scheme="dark" if theme == "dark" else "light")
    show(view, sample(service, "terrain", 200), 40)
    view.page.click("#film-play")
    scrub(view, 30)
    view.page.evaluate((ROOT / "app/web/node_modules/axe-core/axe.min.js").read_text())
    found = view.page.evaluate("axe.run()")
    assert [(each["id"], each["nodes"][0]["html"][:120]) for each in found["violations"]] == []


def test_another_question_ends_it(view: View, service: str) -> None:
    show(view, sample(service, "terrain", 200), 40)
    assert not view.page.is_visible("#legend")
    view.ask("v3")
    view.wait()
    assert not view.page.is_visible("#player")
    assert view.page.is_visible("#legend")
    view.page.click("#film-start")
    view.page.locator("#player").wait_for()
    view.page.click("#film-stop")
    view.wait()
    expect(view.page.locator("#player")).to_be_hidden()
    assert not sees_front(view)


def test_large_meshes_are_told_the_limit(view: View, sphere: str) -> None:
    view.open(f"/?mesh={sphere}&source=v0")
    view.page.click("#film > summary")
    assert view.page.is_disabled("#film-start")
    assert "at most 5,000 faces; this one has 5,120" in view.text("#film-note")


def frames_of(video: bytes) -> list[bytes]:
    """Return the frames of a WebM file, which is Matroska, whose elements are EBML."""

    def number(at: int, *, keeps_marker: bool) -> tuple[int, int, bool]:
        length = 9 - video[at].bit_length()
        value = int.from_bytes(video[at : at + length], "big")
        ones = (1 << 7 * length) - 1
        return (value if keeps_marker else value & ones), at + length, value & ones == ones

    def walk(at: int, end: int) -> list[bytes]:
        found = []
        while at < end:
            name, at, _ = number(at, keeps_marker=True)
            size, at, is_open = number(at, keeps_marker=False)
            until = end if is_open else at + size
            if name in (SEGMENT, CLUSTER, GROUP):
                # One of unknown size ends where the next one begins, which is then found inside.
                found += walk(at, until)
            elif name in (BLOCK, SIMPLE_BLOCK):
                found.append(video[at + 4 : until])
            at = until
        return found

    return walk(0, len(video))


def test_the_video_has_the_steps_of_the_film(view: View, service: str, tmp_path: Path) -> None:
    mesh = httpx2.post(f"{service}/v1/meshes?sample=plane&faces=8", timeout=LONG_S).json()["id"]
    show(view, mesh, 0)
    with view.page.expect_download() as download:
        view.page.click("#film-save")
    download.value.save_as(tmp_path / "film.webm")
    video = (tmp_path / "film.webm").read_bytes()

    assert download.value.suggested_filename == "geodesic-search.webm"
    assert video[:4] == b"\x1a\x45\xdf\xa3"
    assert b"webm" in video[:64]
    assert re.search(rb"V_VP[89]", video)
    assert len(set(frames_of(video))) > 5
    view.wait()
