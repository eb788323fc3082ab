"""The page as someone sees it and uses it."""

import math
from io import BytesIO
from time import time
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from playwright.sync_api import ConsoleMessage, FilePayload, Locator, Page

Pixel = tuple[float, float]

PLAIN = "lines=none&view=0.6,1.2,2.9,0,0,0"
TAP_S, HOLD_S, REST_S = 0.1, 0.7, 0.3


class View:
    """A page, what it wrote to the console, and what is to be seen on it."""

    def __init__(self, page: Page) -> None:
        self.page = page
        self.errors: list[str] = []
        self.is_phone = False
        self._devtools = page.context.new_cdp_session(page)  # for what Playwright has no words
        self._fingers = 0
        self._time = time()
        page.on("pageerror", lambda error: self.errors.append(str(error)))
        page.on("console", self._note)

    def _note(self, message: ConsoleMessage) -> None:
        # The browser itself writes of each refusal of the service.
        if message.type == "error" and not message.text.startswith("Failed to load resource"):
            self.errors.append(message.text)

    def open(self, address: str = "/") -> None:
        self.page.goto(address)
        self.wait()

    def wait(self, state: str = "ready") -> None:
        """Wait until the page is in a state, for so long that it is there to stay."""
        there = self.page.locator(f"html[data-state={state}]")
        while True:
            there.wait_for()
            self.page.wait_for_timeout(50)
            if there.count():
                return

    def become_phone(self) -> None:
        """Be small and dark, and touched by fingers: from now on a click is a tap."""
        self.is_phone = True
        self.page.set_viewport_size({"width": 360, "height": 640})
        self.page.emulate_media(color_scheme="dark")

    def unfold(self, name: str) -> None:
        """Open a folded part of the panel."""
        self.page.click(f"#{name} > summary")

    def fold(self) -> None:
        """Have the mesh whole: close the panel where it takes half of a phone."""
        if self.is_phone and self.page.is_visible("#folded"):
            self.page.tap("#fold")

    def reach(self, selector: str) -> Locator:
        """Return a control, once it is there to be seen: what is folded around it is opened."""
        control = self.page.locator(selector)
        if control.locator("xpath=ancestor::*[@id='folded'][@hidden]").count():
            self.page.tap("#fold")
        closed = control.locator("xpath=ancestor::details[not(@open)][1]/summary")
        while closed.count():
            self._press(closed)
        return control

    def press(self, selector: str) -> None:
        """Press a control: with the mouse, or a finger."""
        self._press(self.reach(selector))
        self.wait()

    def _press(self, control: Locator) -> None:
        if self.is_phone:
            control.tap()
        else:
            control.click()

    def ask(self, text: str, field: str = "#points") -> None:
        """Write something into a field of the question."""
        self.reach(field).fill(text)
        self.page.press(field, "Enter")

    def hover(self, x: float, y: float) -> str:
        """Move the mouse beside the middle of the mesh; return what is said there."""
        centre = self.centre
        self.page.mouse.move(centre[0] + x, centre[1] + y)
        return self.text("#cue")

    def upload(self, name: str, text: str) -> None:
        """Choose a file, and wait until its mesh is shown."""
        file = FilePayload(name=name, mimeType="", buffer=text.encode())
        with self.page.expect_response("**/v1/meshes?merge=*"):
            self.page.set_input_files("#file", file)
        self.wait()

    @property
    def centre(self) -> Pixel:
        box = self.page.locator("#canvas").bounding_box()
        assert box is not None
        return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2

    def click(self, x: float = 0, y: float = 0, *modifiers: Any) -> None:
        """
        Click beside the middle of the mesh, so many pixels to the right and down.

        On a phone this is a tap, or with Alt, which it does not have, a finger that stays.
        """
        if self.is_phone:
            self.touch((x, y))
            self.touch(after=HOLD_S if "Alt" in modifiers else TAP_S)
            self.wait()
            return
        centre = self.centre
        for key in modifiers:
            self.page.keyboard.down(key)
        self.page.mouse.click(centre[0] + x, centre[1] + y)
        for key in modifiers:
            self.page.keyboard.up(key)
        self.wait()

    def drag(self, *places: Pixel, steps: int = 4) -> None:
        """Press at the first of some places beside the middle, move to the others, let go."""
        if self.is_phone:
            for place in places:
                self.touch(place)
            # If it lifts while it moves, Chromium sees a fling, and may swallow the next tap.
            self.touch(places[-1], after=REST_S)
            self.touch()
            self.wait()
            return
        x, y = self.centre
        mouse = self.page.mouse
        mouse.move(x + places[0][0], y + places[0][1])
        mouse.down()
        for place in places[1:]:
            mouse.move(x + place[0], y + place[1], steps=steps)
        mouse.up()
        self.wait()

    def touch(self, *places: Pixel, after: float = 0.02) -> None:
        """
        Have fingers at places beside the middle, and nowhere else; the first stays the first.

        By the browser's clock this is ``after`` so many seconds, however fast the machine is.
        """
        x, y = self.centre
        points = [{"x": x + a, "y": y + b, "id": finger} for finger, (a, b) in enumerate(places)]
        kind = "touchEnd"
        if points:
            kind = "touchStart" if len(points) > self._fingers else "touchMove"
        if self._fingers == 0:
            self._time = max(self._time, time())  # events of before the last frame crash Chromium
        self._time += after
        event = {"type": kind, "touchPoints": points, "timestamp": self._time}
        self._devtools.send("Input.dispatchTouchEvent", event)
        self._fingers = len(points)

    def throttle_uploads(self, rate: int) -> None:
        """Send no more than so many bytes a second."""
        network = {"offline": False, "latency": 0, "downloadThroughput": -1}
        self._devtools.send("Network.enable")
        self._devtools.send(
            "Network.emulateNetworkConditions", network | {"uploadThroughput": rate}
        )

    def pixels(self) -> NDArray[np.int64]:
        """Return what is on the screen but for the words that lie on the mesh, (H, W, 3)."""
        words = "['cue', 'labels'].map(id => document.getElementById(id).style.visibility = '{}')"
        self.page.evaluate(words.format("hidden"))
        image = Image.open(BytesIO(self.page.screenshot())).convert("RGB")
        self.page.evaluate(words.format(""))
        return np.asarray(image, np.int64)

    def colour(
        self, x: float = 0, y: float = 0, pixels: NDArray[np.int64] | None = None
    ) -> NDArray[np.float64]:
        """Return the median colour around a place beside the middle of the mesh."""
        column, row = (round(a + b) for a, b in zip(self.centre, (x, y), strict=True))
        image = self.pixels() if pixels is None else pixels
        patch = image[row - 2 : row + 3, column - 2 : column + 3]
        return np.asarray(np.median(patch.reshape(-1, 3), axis=0))

    def text(self, selector: str) -> str:
        return self.page.inner_text(selector)


def query_of(view: View) -> dict[str, list[str]]:
    """Return the parameters of the address that the page has written."""
    view.page.locator("html:not([data-address-due])").wait_for()
    search: dict[str, list[str]] = view.page.evaluate(
        "() => { const q = new URLSearchParams(location.search); const r = {};"
        "for (const k of q.keys()) r[k] = q.get(k).split(';'); return r; }"
    )
    return search


def angle_at(view: View, away: float) -> float:
    """Return the angle from the middle of a unit sphere to what is drawn so many pixels away."""
    box = view.page.locator("#canvas").bounding_box()
    assert box is not None
    half = min(box["width"], box["height"]) / 2
    slope = away / half * math.tan(math.radians(38 / 2))
    distance, radius = 2.9, 1 / math.sqrt(3)  # of a sphere whose bounding box's diagonal is 2
    ray = math.atan(slope)
    return math.asin(distance * math.sin(ray) / radius) - ray


def length_of(view: View) -> float:
    return float(view.text("#length"))
