"""From a click on the page to rough colours and to exact ones; tasks while a start is dragged."""

import json
import shutil
from math import cos, pi, sin
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from playwright.sync_api import Browser, Page, sync_playwright

from benchmarks.inputs import Inputs
from benchmarks.page import FLAGS, SIZE
from benchmarks.serving import Client, serving
from benchmarks.tables import Section, rated

FACES = {100_000: 150.0, 1_000_000: 600.0}
"""Numbers of faces, and the most milliseconds from a click to rough colours"""
DRAGGED, MOST_TASK_MS = 100_000, 100.0
RADIUS, SWAY, CLICKS, MOVES = 60.0, 20.0, 6, 40

Place = tuple[float, float]

_WATCH = """() => {
    const title = document.getElementById('legend-title');
    const gl = document.getElementById('canvas').getContext('webgl2');
    const pixel = new Uint8Array(4);
    window.waits = true;
    window.times = [];
    let start = 0;
    addEventListener('pointerup', () => { start = performance.now(); }, true);
    const seen = () => {
        if (document.getElementById('legend').hidden) return;
        const words = title.textContent;
        requestAnimationFrame(() => setTimeout(() => {
            // Reading waits until the frame is there; while dragging it would be a task of its own.
            if (window.waits) gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
            window.times.push([words, performance.now() - start]);
        }));
    };
    new MutationObserver(seen).observe(title, {childList: true});
}"""


def run(inputs: Inputs, runs: int) -> Section:  # noqa: ARG001 - as all benchmarks
    """Click on knots of two sizes in a browser, and drag the start over one of them."""
    rows: list[list[str]] = []
    executable = shutil.which("chromium")
    if executable is None:
        print("chromium is not there: the page is left out")
    else:
        with serving() as port, sync_playwright() as playwright:
            browser = playwright.chromium.launch(executable_path=executable, args=FLAGS)
            for faces, most in FACES.items():
                rows += _of_size(browser, port, faces, most)
            browser.close()
    return Section(
        "First colours",
        f"A knot on the page in Chromium at {SIZE['width']} × {SIZE['height']} with WebGL in "
        f"software on the same cores: medians of {CLICKS} clicks, each on another point, from the "
        "release of the button until the frame with the colours is drawn. Tasks of the page's "
        "thread are those of the browser's own trace.",
        ["what", "measured"],
        rows,
    )


def _of_size(browser: Browser, port: int, faces: int, most_ms: float) -> list[list[str]]:
    client = Client(port)
    mesh = json.loads(client.get(f"/v1/meshes?sample=knot&faces={faces}", b""))["id"]
    client.close()
    page = browser.new_page(viewport=SIZE)
    page.set_default_timeout(120_000)
    page.goto(f"http://127.0.0.1:{port}/?mesh={mesh}&lines=none&source=v0")
    _rest(page)
    page.evaluate(_WATCH)
    rough, exact, place = _clicks(page)
    named = f"{faces:,} faces"
    rows = [
        [f"{named}: rough colours, ms", rated(rough, most_ms, at_least=False, digits=0)],
        [f"{named}: exact colours, ms", f"{exact:.0f}"],
    ]
    if faces == DRAGGED:
        longest, painted = _drag(browser, page, place)
        limit = rated(longest, MOST_TASK_MS, at_least=False, digits=0)
        rows.append([f"{named}: longest task while dragging, ms", limit])
        rows.append([f"{named}: rough colours while dragging, a second", f"{painted:.1f}"])
    page.close()
    return rows


def _rest(page: Page) -> None:
    page.wait_for_selector("html[data-state=ready]")
    page.wait_for_timeout(300)
    page.wait_for_selector("html[data-state=ready]")


def _middle(page: Page) -> tuple[float, float]:
    box = page.locator("#canvas").bounding_box()
    assert box is not None, "it is visible"  # noqa: S101
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


def _clicks(page: Page) -> tuple[float, float, Place]:
    """Return the medians of milliseconds until rough and exact colours, and the last place."""
    found: dict[str, list[float]] = {"Rough distance": [], "Distance": []}
    place = (0.0, 0.0)
    for vertex in range(CLICKS):
        page.evaluate("() => { document.getElementById('clear').click(); }")
        _rest(page)
        page.evaluate("() => { window.times.length = 0; }")
        place = _click_on_mesh(page, vertex)
        _rest(page)
        for words, milliseconds in page.evaluate("() => window.times"):
            found[words.partition(" in ")[0]].append(milliseconds)
    rough, exact = (float(np.median(each)) for each in found.values())
    return rough, exact, place


def _click_on_mesh(page: Page, number: int) -> Place:
    """Click on a place where the mesh is, one of many, and return it."""
    x, y = _middle(page)
    for attempt in range(20):
        angle = 2 * pi * (number / CLICKS + attempt / 20)
        place = x + 1.5 * RADIUS * cos(angle), y + 1.5 * RADIUS * sin(angle)
        page.mouse.move(*place)
        page.wait_for_timeout(50)
        if "A" in page.inner_text("#cue"):
            break
    page.mouse.down()
    page.mouse.up()
    return place


def _drag(browser: Browser, page: Page, place: Place) -> tuple[float, float]:
    """Drag the start from its place; return the longest task, ms, and colours painted a second."""
    x, y = place
    page.mouse.move(x, y)
    page.evaluate("() => { window.times.length = 0; window.waits = false; }")
    with TemporaryDirectory() as folder:
        trace = Path(folder) / "trace.json"
        browser.start_tracing(page=page, path=trace, categories=["toplevel", "devtools.timeline"])
        page.mouse.down()
        for i in range(MOVES):
            page.mouse.move(x + SWAY * sin(0.1 * i), y)
            page.wait_for_timeout(16)
        page.mouse.up()
        browser.stop_tracing()
        longest, seconds = _longest_task(json.loads(trace.read_text())["traceEvents"])
    times = page.evaluate("() => window.times")
    return longest, len(times) / seconds


def _longest_task(events: list[dict[str, Any]]) -> tuple[float, float]:
    """Return the longest task of the thread that draws the page, ms, and the seconds traced."""
    threads = {
        (event["pid"], event["tid"])
        for event in events
        if event["name"] == "thread_name" and event["args"].get("name") == "CrRendererMain"
    }
    tasks = [
        event
        for event in events
        if event.get("ph") == "X"
        and "RunTask" in event["name"]
        and (event["pid"], event["tid"]) in threads
    ]
    spans = [task["ts"] for task in tasks]
    return max(task["dur"] for task in tasks) / 1000, (max(spans) - min(spans)) / 1e6
