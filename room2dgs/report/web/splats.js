// The page of splats alone: its buttons.
"use strict";

(async () => {
  const find = (name) => document.getElementById("viewer-" + name);
  const about = JSON.parse(document.getElementById("scene").textContent);
  const room = await createRoom(document.getElementById("viewer"), about);
  const said = find("said");
  if (!room) {
    said.textContent = "This browser has no WebGL, so nothing can turn here.";
    return;
  }
  room.canvas.tabIndex = 0;
  room.canvas.setAttribute("role", "application");
  room.canvas.setAttribute("aria-label", "The room as splats; arrow keys turn it");
  const moves = createMoves(room, find("stick"));
  scaleBar(room, find("scale"), about.unit);
  const hints = window.matchMedia("(pointer: coarse)").matches
    ? { around: "Swipe sideways to turn, two fingers to come near", above: "Two fingers move and come near", walk: "Drag to look, the stick walks" }
    : { around: "Drag to turn, right button to move, wheel to come near", above: "Drag to move, wheel to come near", walk: "Drag to look, W A S D or arrows to walk" };
  function tell() {
    for (const mode of ["around", "above", "walk"]) find(mode).setAttribute("aria-pressed", String(moves.mode === mode));
    find("turn").setAttribute("aria-pressed", String(room.controls.autoRotate));
    said.textContent = hints[moves.mode];
  }
  moves.changed = tell;
  for (const mode of ["around", "above", "walk"]) find(mode).addEventListener("click", () => moves[mode]());
  find("turn").addEventListener("click", async () => {
    const on = !room.controls.autoRotate;
    if (on && moves.mode !== "around") await moves.around();
    moves.turn(on);
  });
  room.controls.addEventListener("start", () => moves.turn(false));
  await room.show("discs");
  moves.turn(!STILL);
})();
