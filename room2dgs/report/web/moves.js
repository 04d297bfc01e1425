// Ways to move: around the room, from above, and walking inside with keys, a drag and a joystick.
"use strict";

const PACE = 1.4; // metres a second
const KEYS = {
  w: [0, 1], ArrowUp: [0, 1], s: [0, -1], ArrowDown: [0, -1], a: [-1, 0], ArrowLeft: [-1, 0], d: [1, 0], ArrowRight: [1, 0],
};

// stick: the joystick's frame with its knob inside; null: none.
function createMoves(room, stick) {
  const { camera, canvas, controls, up, frame } = room;
  const moves = { mode: "around", changed: () => {} };
  const pressed = new Set();
  let push = [0, 0], last = 0, look = null, inside = false;
  const coarse = window.matchMedia("(pointer: coarse)").matches;

  // One finger goes on with the page unless it turns the room sideways; the wheel is the page's until somebody presses
  // inside. Walking and the full screen take all.
  function claims() {
    const all = moves.mode === "walk" || frame.closest(".filled");
    controls.enableZoom = Boolean(all) || inside || coarse;
    canvas.style.touchAction = all ? "none" : "pan-y";
  }

  async function go(mode, pose) {
    room.touch();
    moves.mode = mode;
    if (mode !== "around") turn(false);
    controls.enabled = mode !== "walk";
    controls.enableRotate = mode === "around";
    if (stick) stick.hidden = mode !== "walk";
    frame.dataset.mode = mode;
    claims();
    moves.changed();
    await room.fly(pose);
  }
  moves.around = () => go("around", room.home());
  moves.above = () => go("above", room.above());
  moves.walk = (pose) => go("walk", pose || start());

  // From the photo whose camera sees most of the room in front of it.
  function start() {
    const eyes = room.about.cameras.map((one) => ({
      position: new THREE.Vector3(...one.at), forward: new THREE.Vector3(one.turn[2], one.turn[5], one.turn[8]),
    }));
    const ahead = (eye) => room.middle.clone().sub(eye.position).dot(eye.forward);
    const best = eyes.sort((a, b) => ahead(b) - ahead(a))[0];
    if (!best) return { ...room.home(), fov: WALK_DEG };
    const level = best.forward.clone().addScaledVector(up, -best.forward.dot(up)).normalize();
    return { position: best.position, target: best.position.clone().addScaledVector(level, 0.1), fov: WALK_DEG };
  }

  function turn(on) {
    controls.autoRotate = on;
    moves.changed();
    room.draw();
  }
  moves.turn = turn;

  // Looks about on the spot: by so many radians to the left and up.
  function lookBy(left, raised) {
    const forward = camera.getWorldDirection(new THREE.Vector3()).applyAxisAngle(up, left);
    const pitch = Math.asin(Math.max(-1, Math.min(1, forward.dot(up))));
    const to = Math.max(-1.4, Math.min(1.4, pitch + raised));
    const level = forward.addScaledVector(up, -forward.dot(up)).normalize().multiplyScalar(Math.cos(to));
    room.place({
      position: camera.position.clone(), fov: camera.fov,
      target: camera.position.clone().add(level.addScaledVector(up, Math.sin(to)).multiplyScalar(0.1)),
    });
  }

  // One picture's way; true while somebody walks.
  function walked() {
    let [right, ahead] = push;
    for (const key of pressed) [right, ahead] = [right + KEYS[key][0], ahead + KEYS[key][1]];
    const now = performance.now(), seconds = Math.min(0.1, (now - last) / 1000);
    last = now;
    if (moves.mode !== "walk" || room.flying() || (!right && !ahead)) return false;
    const forward = camera.getWorldDirection(new THREE.Vector3());
    forward.addScaledVector(up, -forward.dot(up)).normalize();
    const way = forward.clone().multiplyScalar(ahead).addScaledVector(forward.cross(up), right);
    const to = camera.position.clone().addScaledVector(way, seconds * PACE);
    const off = to.clone().sub(room.middle);
    if (off.length() < 0.75 * room.size) camera.position.copy(to); // no farther than a little outside
    moves.left();
    return true;
  }
  moves.left = () => {}; // a photo's place was left
  room.before.push(walked);

  canvas.addEventListener("pointerdown", (event) => {
    inside = true;
    claims();
    frame.dataset.pressed = "true"; // its outline is for who came by the keyboard
    canvas.focus({ preventScroll: true });
    if (moves.mode !== "walk") return;
    look = { x: event.clientX, y: event.clientY, moved: false };
    try {
      canvas.setPointerCapture(event.pointerId);
    } catch (error) {} // the pointer is gone already
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!look || moves.mode !== "walk") return;
    const scale = (camera.fov * Math.PI) / 180 / frame.clientHeight;
    const across = event.clientX - look.x, down = event.clientY - look.y;
    if (!look.moved && Math.hypot(across, down) < 4) return;
    look = { x: event.clientX, y: event.clientY, moved: true };
    lookBy(across * scale, down * scale);
    moves.left();
  });
  for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, () => (look = null));
  canvas.addEventListener("pointerleave", (event) => {
    if (event.pointerType !== "mouse" || event.buttons) return;
    inside = false;
    claims();
  });
  document.addEventListener("fullscreenchange", claims);

  canvas.addEventListener("keydown", (event) => {
    const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    if (!(key in KEYS) || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    if (moves.mode === "walk") {
      pressed.add(key);
      last = performance.now();
      room.draw();
    } else if (moves.mode === "around") {
      turn(false);
      room.touch();
      const off = camera.position.clone().sub(controls.target);
      const [right, raised] = KEYS[key];
      const axis = off.clone().cross(up).normalize();
      off.applyAxisAngle(up, right * 0.1);
      const angle = off.angleTo(up) - raised * 0.1;
      if (raised && angle > 0.05 && angle < 3.09) off.applyAxisAngle(axis, raised * 0.1);
      room.place({ position: controls.target.clone().add(off), target: controls.target.clone(), fov: camera.fov });
    }
  });
  canvas.addEventListener("keyup", (event) => pressed.delete(event.key.length === 1 ? event.key.toLowerCase() : event.key));
  canvas.addEventListener("blur", () => {
    pressed.clear();
    delete frame.dataset.pressed;
  });

  if (stick) {
    const knob = stick.firstElementChild;
    const move = (event) => {
      const box = stick.getBoundingClientRect(), reach = box.width / 2;
      let right = (event.clientX - box.left - reach) / reach, ahead = -(event.clientY - box.top - reach) / reach;
      const length = Math.max(1, Math.hypot(right, ahead));
      push = [right / length, ahead / length];
      knob.style.transform = `translate(${push[0] * reach * 0.6}px, ${-push[1] * reach * 0.6}px)`;
      last = performance.now();
      room.draw();
    };
    stick.addEventListener("pointerdown", (event) => {
      stick.setPointerCapture(event.pointerId);
      move(event);
    });
    stick.addEventListener("pointermove", (event) => stick.hasPointerCapture(event.pointerId) && move(event));
    for (const end of ["pointerup", "pointercancel"]) {
      stick.addEventListener(end, () => {
        push = [0, 0];
        knob.style.transform = "";
      });
    }
  }
  moves.claims = claims;
  frame.dataset.mode = moves.mode;
  claims();
  return moves;
}

// A press without a drag: the function is given the place in pixels from the frame's corner.
function onPress(room, said) {
  let at = null;
  room.canvas.addEventListener("pointerdown", (event) => (at = [event.clientX, event.clientY]));
  room.canvas.addEventListener("pointerup", (event) => {
    if (!at || Math.hypot(event.clientX - at[0], event.clientY - at[1]) > 5) return;
    const box = room.frame.getBoundingClientRect();
    said(event.clientX - box.left, event.clientY - box.top, event.pointerType === "touch");
  });
}

// A bar of a round length under a view from above; false: no other picture is wanted.
function scaleBar(room, bar, unit) {
  const look = () => {
    const shown = room.frame.dataset.mode === "above" && !room.flying();
    bar.hidden = !shown;
    if (!shown) return false;
    const far = room.camera.position.distanceTo(room.controls.target);
    const pixels = room.frame.clientHeight / (2 * far * Math.tan((room.camera.fov * Math.PI) / 360)); // a metre's
    const power = 10 ** Math.floor(Math.log10(150 / pixels));
    const length = [5, 2, 1].map((one) => one * power).find((one) => one * pixels <= 150) || power;
    bar.style.width = `${length * pixels}px`;
    bar.firstElementChild.textContent = `${length} ${unit}`;
    return false;
  };
  room.before.push(look);
}
