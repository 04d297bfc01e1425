"""report.html in headless Chromium: no errors, a drawn canvas in each layer, a slider that moves."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest

spec = importlib.util.spec_from_file_location("chromium", Path(__file__).with_name("chromium.py"))
chromium = importlib.util.module_from_spec(spec)
spec.loader.exec_module(chromium)

WITHOUT = "no Chromium here (Debian: apt install chromium); the page's text is tested all the same"
READY = """
new Promise((done) => {
  const look = () => {
    const state = document.getElementById("viewer")?.dataset ?? {};
    return state.shown === "LAYER" && state.drawn ? done(true) : setTimeout(look, 20);
  };
  look();
})"""
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
        tab.run(READY.replace("LAYER", "color"))
        tab.run("document.getElementById('viewer-turn').click()")
        seen = {}
        for layer in ("color", "shape", "error", "seen", "discs"):
            tab.run(f"document.querySelector('#viewer-layers [data-layer={layer}]').click()")
            tab.run(READY.replace("LAYER", layer))
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
