// Two rooms side by side, seen by one camera.
"use strict";

(async () => {
  const said = document.getElementById("compare-said");
  const rooms = [];
  for (const letter of ["a", "b"]) {
    const about = JSON.parse(document.getElementById("scene-" + letter).textContent);
    const room = await createRoom(document.getElementById("viewer-" + letter), about, (name) => `${letter}-${name}`);
    if (!room) {
      said.textContent = "This browser has no WebGL, so nothing can turn here.";
      return;
    }
    room.canvas.style.touchAction = "pan-y";
    rooms.push(room);
  }

  // The camera of the room that was moved last is that of the other, about its own middle.
  let leader = rooms[0];
  function follow() {
    const other = rooms[1 - rooms.indexOf(leader)];
    const shift = other.middle.clone().sub(leader.middle);
    if (leader.middle.distanceTo(other.middle) < 1e-6 * leader.size) shift.set(0, 0, 0);
    other.camera.position.copy(leader.camera.position).add(shift);
    other.camera.quaternion.copy(leader.camera.quaternion);
    other.camera.fov = leader.camera.fov;
    other.camera.updateProjectionMatrix();
    other.controls.target.copy(leader.controls.target).add(shift);
    other.draw();
    return false;
  }
  for (const room of rooms) {
    room.controls.enableZoom = false;
    const lead = () => {
      for (const one of rooms) [one.controls.enabled, one.controls.enableZoom, one.controls.autoRotate] = [one === room, true, false];
      leader = room;
      turn(false);
    };
    room.frame.addEventListener("pointerdown", lead, true); // before the controls hear of it
    room.canvas.addEventListener("pointerleave", (event) => {
      if (event.pointerType === "mouse" && !event.buttons) for (const one of rooms) one.controls.enableZoom = false;
    });
    room.before.push(() => room === leader && follow());
  }
  rooms[1].controls.enabled = false;

  const turning = document.getElementById("compare-turn"), above = document.getElementById("compare-above");
  function turn(on) {
    for (const room of rooms) room.controls.autoRotate = on && room === leader;
    turning.setAttribute("aria-pressed", String(on));
    leader.draw();
  }
  turning.addEventListener("click", () => turn(!leader.controls.autoRotate));
  above.addEventListener("click", () => {
    const up = above.getAttribute("aria-pressed") !== "true";
    above.setAttribute("aria-pressed", String(up));
    turn(false);
    rooms.forEach((room) => room.touch());
    leader.fly(up ? leader.above() : leader.home());
  });
  const layers = [...document.querySelectorAll("#compare-layers [data-layer]")];
  async function show(layer) {
    for (const button of layers) button.setAttribute("aria-pressed", String(button.dataset.layer === layer));
    for (const room of rooms) await room.show(layer);
  }
  for (const button of layers) button.addEventListener("click", () => show(button.dataset.layer));
  await show("color");
  said.textContent = window.matchMedia("(pointer: coarse)").matches
    ? "Swipe sideways to turn both, two fingers to come near."
    : "Drag to turn both, right button to move, click and wheel to come near.";
  turn(!STILL);
})();
