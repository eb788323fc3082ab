"""Speed of the page: the first picture of a dropped file, and paths that follow the pointer."""

import base64
import json
import shutil
import time
from functools import partial
from io import BytesIO
from random import Random
from typing import Any

import numpy as np
from PIL import Image
from playwright.sync_api import Page, ViewportSize, sync_playwright

from benchmarks.inputs import Inputs
from benchmarks.serving import Client, serving
from benchmarks.tables import Section, rated

NAME = "horse97k.ply"
TARGETS = 200
TURN_S = 5.0
SIZE: ViewportSize = {"width": 800, "height": 600}
FLAGS = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-sandbox"]
PICTURE_S, TASK_MS, HTTP_RATE, PAGE_RATE = 3.0, 50.0, 30.0, 15.0

_DROP = """([name, text]) => new Promise(resolve => {
    const bytes = Uint8Array.from(atob(text), each => each.charCodeAt(0));
    const files = new DataTransfer();
    files.items.add(new File([bytes], name));
    setTimeout(() => {  // what was done here so far is no task of the page
        const tasks = [];
        const watch = new PerformanceObserver(list => tasks.push(...list.getEntries()));
        watch.observe({type: 'longtask'});
        const root = document.documentElement;
        const start = performance.now();
        let isLoading = false;
        new MutationObserver(() => {
            isLoading ||= root.dataset.state === 'loading';
            if (isLoading && root.dataset.state === 'ready') {
                const seconds = (performance.now() - start) / 1000;
                setTimeout(() => resolve({
                    seconds, tasks: tasks.map(task => task.duration)
                }), 200);
            }
        }).observe(root, {attributeFilter: ['data-state']});
        document.dispatchEvent(new DragEvent('drop', {dataTransfer: files}));
    }, 500);
})"""

_FOLLOW = """async places => {
    const canvas = document.getElementById('canvas');
    const readout = document.getElementById('readout');
    const root = document.documentElement;
    const tick = () => new Promise(resolve => setTimeout(resolve, 1));
    const start = performance.now();
    let answered = 0;
    for (const [clientX, clientY] of places) {
        const before = readout.dataset.target;
        canvas.dispatchEvent(new PointerEvent('pointermove', {
            clientX, clientY, pointerId: 1, bubbles: true
        }));
        // Until the rough path is there: the exact one comes once the pointer rests.
        while (readout.dataset.target === before && root.dataset.state !== 'ready') await tick();
        await new Promise(requestAnimationFrame);
        answered += readout.dataset.target !== before;
    }
    return {answered, seconds: (performance.now() - start) / 1000};
}"""

_TURN = """async seconds => {
    const canvas = document.getElementById('canvas');
    const start = performance.now();
    let frames = 0;
    for (; performance.now() - start < 1000 * seconds; frames++) {
        canvas.dispatchEvent(new KeyboardEvent('keydown', {key: 'ArrowLeft', bubbles: true}));
        await new Promise(requestAnimationFrame);
    }
    return 1000 * frames / (performance.now() - start);
}"""


def run(inputs: Inputs, runs: int) -> Section:
    """Drop a mesh on the page, and drag a target over it; send the same requests without a page."""
    path = inputs.folder / NAME
    rows: list[list[str]] = []
    if path.exists():
        body = path.read_bytes()
        with serving() as port:
            client = Client(port)
            rate = _http_rate(client, body)
            rows.append(["paths to targets, by HTTP", rated(rate, HTTP_RATE, at_least=True)])
            rows += _in_browser(f"http://127.0.0.1:{port}", body, runs)
            client.close()
    else:
        print(f"{NAME}: not in the meshes folder, left out")
    return Section(
        "Page",
        f"{NAME}, dropped on the page in Chromium at {SIZE['width']} × {SIZE['height']} with WebGL "
        f"in software on the same cores; then {TARGETS} targets one after the other, each asked "
        f"for when the path to the last is drawn. By HTTP half of them are vertices, half points "
        f"in faces. In the end the mesh is turned, with 20 isolines. Medians of {runs} drops.",
        ["what", "measured"],
        rows,
    )


def _http_rate(client: Client, body: bytes) -> float:
    made = json.loads(client.get("/v1/meshes?format=ply", body))
    random = Random(1)  # noqa: S311 - targets, not secrets
    targets: list[dict[str, Any]] = []
    for _ in range(TARGETS // 2):
        targets.append({"vertex": random.randrange(made["vertices"])})
        u, v = sorted((random.random(), random.random()))
        weights = [u, v - u, 1 - v]
        targets.append({"face": random.randrange(made["faces"]), "barycentric": weights})
    ask = partial(client.get, f"/v1/meshes/{made['id']}/path")
    ask({"source": {"vertex": 0}, "target": {"vertex": 1}})  # brings the mesh into the worker
    start = time.perf_counter()
    for target in targets:
        ask({"source": {"vertex": 0}, "target": target})
    seconds = time.perf_counter() - start
    return TARGETS / seconds


def _in_browser(address: str, body: bytes, runs: int) -> list[list[str]]:
    executable = shutil.which("chromium")
    if executable is None:
        print("chromium is not there: the page is left out")
        return []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=executable, args=FLAGS)
        drops = [_drop(browser.new_page(viewport=SIZE), address, body) for _ in range(runs)]
        page = browser.new_page(viewport=SIZE)
        rate = _follow(page, address, body)
        frames = page.evaluate(_TURN, TURN_S)
        browser.close()
    seconds = float(np.median([drop["seconds"] for drop in drops]))
    task = float(np.median([max(drop["tasks"], default=0.0) for drop in drops]))
    return [
        ["from drop to picture, s", rated(seconds, PICTURE_S, at_least=False, digits=2)],
        ["longest task while loading, ms", rated(task, TASK_MS, at_least=False, digits=0)],
        ["paths to targets, drawn", rated(rate, PAGE_RATE, at_least=True)],
        ["frames a second, turned with isolines", f"{frames:.1f}"],
    ]


def _drop(page: Page, address: str, body: bytes) -> dict[str, Any]:
    page.goto(address)
    page.wait_for_selector("html[data-state=ready]")
    measured: dict[str, Any] = page.evaluate(_DROP, [NAME, base64.b64encode(body).decode()])
    page.close()
    return measured


def _follow(page: Page, address: str, body: bytes) -> float:
    """Drag a target over the mesh; return the number of paths drawn per second."""
    page.goto(address)
    page.wait_for_selector("html[data-state=ready]")
    page.evaluate(_DROP, [NAME, base64.b64encode(body).decode()])
    page.wait_for_url("**mesh=*")
    page.goto(f"{page.url}&source=v0")
    page.wait_for_selector("#legend:visible")
    page.wait_for_selector("html[data-state=ready]")
    image = np.asarray(Image.open(BytesIO(page.screenshot())).convert("RGB"), int)
    box = page.locator("#canvas").bounding_box()
    assert box is not None, "it is visible"  # noqa: S101
    rows, columns = np.nonzero(np.ptp(image, axis=2) > 45)  # the mesh, by its colours
    inside = (columns > box["x"] + 200) & (rows < SIZE["height"] - 120)
    chosen = Random(1).sample(  # noqa: S311
        range(int(inside.sum())), TARGETS + 1
    )
    places = np.column_stack([columns[inside], rows[inside]])[chosen].tolist()
    page.mouse.click(*places[0])  # the target, which a drag from there moves
    page.wait_for_selector("#readout:visible")
    page.wait_for_selector("html[data-state=ready]")
    page.mouse.down()
    followed = page.evaluate(_FOLLOW, places[1:])
    page.mouse.up()
    if followed["answered"] < 0.9 * TARGETS:
        print(f"only {followed['answered']} of {TARGETS} targets were on the mesh")
    return float(followed["answered"] / followed["seconds"])
