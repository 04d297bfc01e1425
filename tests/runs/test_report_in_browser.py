"""report.html in headless Chromium: no errors, each layer is drawn, a person can wipe, fly, walk and measure."""

from __future__ import annotations

import importlib.util
import json
import re
from pathlib import Path

import numpy as np
import pytest

spec = importlib.util.spec_from_file_location("chromium", Path(__file__).with_name("chromium.py"))
chromium = importlib.util.module_from_spec(spec)
spec.loader.exec_module(chromium)

WITHOUT = "no Chromium here (Debian: apt install chromium); the page's text is tested all the same"
READY = "(({ shown, drawn } = {}) => shown === 'LAYER' && drawn)(document.getElementById('viewer')?.dataset)"
COLORS = """
new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => {
  const small = document.createElement("canvas");
  small.width = small.height = 64;
  const ink = small.getContext("2d");
  ink.drawImage(document.querySelector("#viewer canvas"), 0, 0, 64, 64);
  const pixels = ink.getImageData(0, 0, 64, 64).data;
  const found = new Set();
  for (let i = 0; i < pixels.length; i += 4) found.add(pixels.slice(i, i + 3).join(" "));
  done([...found]);
})))"""
WIPE = """
(() => {
  const left = document.getElementById("compare-left"), wiper = document.getElementById("compare-wiper");
  const clips = [left.style.clipPath];
  wiper.value = 10;
  wiper.dispatchEvent(new Event("input"));
  return [...clips, left.style.clipPath];
})()"""
# Pictures drawn in half a second by nobody's wish, and how far the page went by the wheel over the viewer
PICTURES = "Number(document.getElementById('viewer').dataset.pictures)"
IDLE = f"""
(async () => {{
  const wait = (ms) => new Promise((done) => setTimeout(done, ms));
  await wait(300);
  const before = {PICTURES};
  await wait(500);
  return {PICTURES} - before;
}})()"""
WHEEL_MOVES_PAGE = """
(() => {
  const canvas = document.querySelector("#viewer canvas");
  const wheel = () => canvas.dispatchEvent(new WheelEvent("wheel", {deltaY: 100, bubbles: true, cancelable: true}));
  const press = (type) => canvas.dispatchEvent(
    new PointerEvent(type, {bubbles: true, pointerId: 1, pointerType: "mouse", clientX: 5, clientY: 5}));
  canvas.setPointerCapture = canvas.releasePointerCapture = () => {}; // of a pointer that is none
  const found = [wheel()];
  press("pointerdown");
  press("pointerup");
  found.push(wheel());
  press("pointerleave");
  return [...found, wheel()];
})()"""
ARRIVED = "document.getElementById('viewer').dataset.photo"
# The stage's corner in the window, the photo's width on it, and the first camera
PHOTO = """
(() => {
  const box = document.getElementById("viewer").getBoundingClientRect();
  const width = document.querySelector("#viewer-photo img").getBoundingClientRect().width;
  const [camera] = JSON.parse(document.getElementById("scene").textContent).cameras;
  return JSON.stringify([box.left + box.width / 2, box.top + box.height / 2, width / camera.width * camera.fx]);
})()"""
MODE = "document.getElementById('viewer').dataset.mode"
CHOOSE = """
(async () => {
  const chosen = document.getElementById("compare-view"), right = document.getElementById("compare-right");
  chosen.value = "2";
  chosen.dispatchEvent(new Event("change"));
  document.querySelector("#compare-kinds [data-kind=trust]").click();
  await right.decode();
  const views = JSON.parse(document.getElementById("views").textContent);
  return right.src === views[2].pictures.trust && right.naturalWidth > 0 && chosen.selectedOptions[0].text;
})()"""


@pytest.mark.slow
@pytest.mark.skipif(not chromium.CHROMIUM, reason=WITHOUT)
def test_the_page_works_in_a_browser(reported, tmp_path):
    with chromium.tab(tmp_path / "profile") as tab:
        tab.call("Page.navigate", url=reported.path.as_uri())
        tab.until(READY.replace("LAYER", "color"))
        tab.run("document.getElementById('viewer-turn').click()")
        seen = {}
        for layer in ("color", "shape", "error", "seen", "discs"):
            tab.run(f"document.querySelector('#viewer-layers [data-layer={layer}]').click()")
            tab.until(READY.replace("LAYER", layer))
            seen[layer] = frozenset(tab.run(COLORS))
            assert len(seen[layer]) > 1, f"layer {layer} is blank"
        assert len(set(seen.values())) == len(seen)  # each shows something else
        assert tab.run(IDLE) == 0
        assert tab.run(WHEEL_MOVES_PAGE) == [True, False, True]
        assert tab.run(WIPE) == ["inset(0px 50% 0px 0px)", "inset(0px 90% 0px 0px)"]
        assert tab.run(CHOOSE).endswith("(training)")
        assert tab.said == []
        assert {url.partition(":")[0] for url in tab.asked_for} <= {"file", "data"}
        assert len([url for url in tab.asked_for if url.startswith("file:")]) == 1  # the page itself


def click(tab, x, y):
    for kind in ("mousePressed", "mouseReleased"):
        tab.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)


def drag(tab, x, y, to_x, to_y):
    tab.call("Input.dispatchMouseEvent", type="mousePressed", x=x, y=y, button="left", clickCount=1)
    for share in (0.5, 1.0):
        at = {"x": x + share * (to_x - x), "y": y + share * (to_y - y)}
        tab.call("Input.dispatchMouseEvent", type="mouseMoved", button="left", buttons=1, **at)
    tab.call("Input.dispatchMouseEvent", type="mouseReleased", x=to_x, y=to_y, button="left", clickCount=1)


@pytest.mark.slow
@pytest.mark.skipif(not chromium.CHROMIUM, reason=WITHOUT)
def test_a_photo_is_flown_to_and_the_tape_measures_the_wall_before_it(reported, tmp_path):
    with chromium.tab(tmp_path / "profile") as tab:
        tab.call("Page.navigate", url=reported.path.as_uri())
        tab.until(READY.replace("LAYER", "color"))
        tab.run("document.querySelector('#viewer-strip button').click()")
        tab.until(ARRIVED)
        assert tab.run(MODE) == "walk"
        camera = min(reported.scene.frames, key=lambda frame: frame.index).camera
        assert tab.run("document.querySelector('#viewer-photo img').src").startswith("data:image/jpeg")
        tab.run("document.getElementById('viewer-tape').click(); window.scrollTo(0, 0)")
        x, y, focal = json.loads(tab.run(PHOTO))
        ends = [(x - 0.1 * focal, y), (x + 0.1 * focal, y + 0.1 * focal)]
        for end in ends:
            click(tab, *end)
        tab.run("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => done(1))))")
        said = tab.run("document.getElementById('viewer-length').textContent")
        measured, sure = re.fullmatch(r"([\d.]+) m ± ([\d.]+)", said).groups()
        rays = camera.turned_to_world(np.array([[-0.1, 0, 1], [0.1, 0.1, 1]]))
        depth = [(2.0 - camera.centre[2]) / ray[2] for ray in rays]  # the wall is at z = 2 m
        points = [camera.centre + far * ray for far, ray in zip(depth, rays, strict=True)]
        assert float(measured) == pytest.approx(np.linalg.norm(points[1] - points[0]), rel=0.01)
        assert 0 < float(sure) < 0.01  # the depth that photos gave is the wall's
        assert not tab.run("document.getElementById('viewer-length').hidden")
        tab.run("document.getElementById('viewer-above').click()")
        tab.run("new Promise((done) => setTimeout(done, 1200))")
        assert tab.run("document.getElementById('viewer-photo').hidden")
        assert re.fullmatch(r"[\d.]+ m", tab.run("document.getElementById('viewer-scale').textContent"))
        assert tab.run(MODE) == "above" and tab.said == []


@pytest.mark.slow
@pytest.mark.skipif(not chromium.CHROMIUM, reason=WITHOUT)
def test_the_page_fits_a_telephone_and_a_drag_wipes_the_picture(reported, tmp_path):
    with chromium.tab(tmp_path / "profile") as tab:
        tab.call("Emulation.setDeviceMetricsOverride", width=390, height=844, deviceScaleFactor=2, mobile=True)
        tab.call("Emulation.setTouchEmulationEnabled", enabled=True)
        tab.call("Page.navigate", url=reported.path.as_uri())
        tab.until(READY.replace("LAYER", "color"))
        assert tab.run("document.documentElement.scrollWidth") == tab.run("innerWidth") == 390
        assert "wipe" in tab.run("document.getElementById('viewer-said').textContent").lower()  # Swipe: words of touch
        assert tab.run("document.querySelector('#viewer canvas').style.touchAction") == "pan-y"  # the page goes on
        tab.run("document.getElementById('viewer-walk').click()")
        assert tab.run("document.querySelector('#viewer canvas').style.touchAction") == "none"
        tab.call("Emulation.setTouchEmulationEnabled", enabled=False)
        tab.run("document.getElementById('compare-box').scrollIntoView({block: 'center'})")
        left, top, width, height = json.loads(tab.run(
            "(b => JSON.stringify([b.left, b.top, b.width, b.height]))"
            "(document.getElementById('compare-box').getBoundingClientRect())"
        ))  # fmt: skip
        middle = top + height / 2
        drag(tab, left + width / 2, middle, left + 0.2 * width, middle)
        shown = re.search(r"inset\(0px ([\d.]+)%", tab.run("document.getElementById('compare-left').style.clipPath"))
        assert 75 <= float(shown[1]) <= 85
        assert tab.said == []
