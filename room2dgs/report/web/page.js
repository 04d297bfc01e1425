// The page of a run: its buttons, and what they do in the room.
"use strict";

(async () => {
  const frame = document.getElementById("viewer"), stage = document.getElementById("stage");
  const find = (name) => document.getElementById("viewer-" + name);
  document.addEventListener("click", (event) => {
    const command = event.target.closest("[data-copy]");
    if (!command) return;
    navigator.clipboard?.writeText(command.dataset.copy).then(() => (command.textContent = "Copied"), () => {});
  });
  if (!frame) return;
  const about = JSON.parse(document.getElementById("scene").textContent);
  const room = await createRoom(frame, about);
  const said = find("said");
  if (!room) {
    said.textContent = "This browser has no WebGL, so nothing can turn here; the pictures below need none.";
    stage.classList.add("without");
    return;
  }
  room.canvas.tabIndex = 0;
  room.canvas.setAttribute("role", "application");
  room.canvas.setAttribute("aria-label", "The room in three dimensions; arrow keys turn it");
  const moves = createMoves(room, find("stick"));
  const tape = createTape(room, find("length"), about.unit);
  const photos = createPhotos(room, moves, find("photo"));
  scaleBar(room, find("scale"), about.unit);

  const coarse = window.matchMedia("(pointer: coarse)").matches;
  const hints = coarse
    ? {
        around: "Swipe sideways to turn, two fingers to come near",
        above: "Two fingers move and come near",
        walk: "Drag to look, the stick walks",
        tape: "Tap two places",
      }
    : {
        around: "Drag to turn, right button to move, click and wheel to come near",
        above: "Drag to move, click and wheel to come near",
        walk: "Drag to look, W A S D or arrows to walk",
        tape: "Click two places",
      };

  const layers = [...find("layers").querySelectorAll("button")];
  async function show(layer) {
    for (const button of layers) button.setAttribute("aria-pressed", String(button.dataset.layer === layer));
    for (const key of document.querySelectorAll("[data-key]")) key.hidden = key.dataset.key !== layer;
    await room.show(layer);
  }
  for (const button of layers) button.addEventListener("click", () => show(button.dataset.layer));

  const press = (name, on) => find(name).setAttribute("aria-pressed", String(on));
  function tell() {
    for (const mode of ["around", "above", "walk"]) press(mode, moves.mode === mode);
    press("turn", room.controls.autoRotate);
    press("tape", tape.on);
    press("cameras", photos.visible());
    said.textContent = tape.on ? hints.tape : hints[moves.mode];
    for (const one of document.querySelectorAll("#viewer-strip [data-camera]")) {
      one.setAttribute("aria-pressed", String(Number(one.dataset.camera) === photos.shown));
    }
  }
  moves.changed = photos.changed = tell;

  find("around").addEventListener("click", () => (photos.leave(), moves.around()));
  find("above").addEventListener("click", () => {
    photos.leave();
    photos.cameras(true);
    moves.above();
  });
  find("walk").addEventListener("click", () => (photos.leave(), photos.cameras(false), moves.walk()));
  find("turn").addEventListener("click", async () => {
    const on = !room.controls.autoRotate;
    if (on && moves.mode !== "around") await moves.around();
    moves.turn(on);
  });
  find("tape").addEventListener("click", () => {
    moves.turn(false);
    tape.set(!tape.on);
    tell();
  });
  find("cameras").addEventListener("click", () => {
    photos.cameras(!photos.visible());
    tell();
  });
  find("leave").addEventListener("click", () => photos.leave());
  room.controls.addEventListener("start", () => moves.turn(false));

  onPress(room, (x, y, touch) => {
    if (tape.on) return tape.press(x, y);
    const camera = photos.at(x, y, touch);
    if (camera !== null) photos.show(camera);
  });

  // The whole screen; telephones that have none for parts of a page fill the window.
  function fill(on) {
    stage.classList.toggle("filled", on);
    press("full", on);
    moves.claims();
    if (on) stage.requestFullscreen?.().catch(() => {});
    else if (document.fullscreenElement) document.exitFullscreen();
  }
  find("full").addEventListener("click", () => fill(!stage.classList.contains("filled")));
  document.addEventListener("fullscreenchange", () => document.fullscreenElement || fill(false));
  document.addEventListener("keydown", (event) => {
    if (event.key !== "Escape") return;
    if (tape.on) find("tape").click();
    else if (photos.shown !== null) photos.leave();
    else if (stage.classList.contains("filled")) fill(false);
  });

  const strip = find("strip");
  for (const [index, camera] of about.cameras.entries()) {
    const button = document.createElement("button");
    button.type = "button";
    button.dataset.camera = String(index);
    const image = document.createElement("img");
    image.src = camera.photo;
    image.alt = `fly to photo ${camera.name}`;
    image.loading = "lazy";
    button.append(image);
    strip.append(button);
  }
  document.addEventListener("click", (event) => {
    const one = event.target.closest("[data-camera]");
    if (!one) return;
    photos.show(Number(one.dataset.camera));
    if (!strip.contains(one)) stage.scrollIntoView({ behavior: STILL ? "auto" : "smooth", block: "center" });
  });

  // The GLB lies in the page: it can be had without the run's folder.
  for (const link of document.querySelectorAll("[data-inside]")) {
    link.addEventListener("click", (event) => {
      event.preventDefault();
      const file = new Blob([rawBytes(link.dataset.inside)], { type: "model/gltf-binary" });
      const save = document.createElement("a");
      save.href = URL.createObjectURL(file);
      save.download = link.getAttribute("href");
      save.click();
      setTimeout(() => URL.revokeObjectURL(save.href), 10000);
    });
  }

  await show("color");
  moves.turn(!STILL);
  tell();
})();
