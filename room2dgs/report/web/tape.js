// A tape measure: two places on the mesh, the way between them, and how sure it is.
"use strict";

// label: what the length is written in. With on = true presses are places.
function createTape(room, label, unit) {
  const tape = { on: false, length: null };
  const ends = [];
  const line = new THREE.Line(
    new THREE.BufferGeometry(), new THREE.LineBasicMaterial({ color: 0xffd24a, depthTest: false }));
  line.renderOrder = 3;
  line.frustumCulled = false;
  const dots = [0, 1].map(() => dot());
  room.scene.add(line, ...dots);

  function dot() {
    const canvas = document.createElement("canvas");
    canvas.width = canvas.height = 32;
    const ink = canvas.getContext("2d");
    ink.fillStyle = "#1a1c22";
    ink.beginPath();
    ink.arc(16, 16, 15, 0, 7);
    ink.fill();
    ink.fillStyle = "#ffd24a";
    ink.beginPath();
    ink.arc(16, 16, 10, 0, 7);
    ink.fill();
    const material = new THREE.SpriteMaterial({
      map: new THREE.CanvasTexture(canvas), depthTest: false, sizeAttenuation: false,
    });
    const sprite = new THREE.Sprite(material);
    sprite.renderOrder = 4;
    sprite.visible = false;
    return sprite;
  }

  function drawn() {
    for (const [index, one] of dots.entries()) {
      one.visible = index < ends.length;
      if (!one.visible) continue;
      one.position.copy(ends[index].point);
      one.scale.setScalar((28 * Math.tan((room.camera.fov * Math.PI) / 360)) / room.frame.clientHeight); // 14 pixels
    }
    line.visible = ends.length === 2;
    const at = line.visible && room.onScreen(ends[0].point.clone().add(ends[1].point).multiplyScalar(0.5));
    label.hidden = !at;
    if (at) label.style.transform = `translate(-50%, -130%) translate(${at.x}px, ${at.y}px)`;
    return false;
  }
  room.before.push(drawn);

  tape.press = (x, y) => {
    const found = room.hit(x, y);
    if (!found) return;
    if (ends.length === 2) ends.length = 0;
    ends.push(found);
    if (ends.length === 2) {
      line.geometry.setFromPoints(ends.map((one) => one.point));
      tape.length = ends[0].point.distanceTo(ends[1].point);
      const errors = ends.map((one) => one.error_m);
      const error = errors.includes(null) ? null : Math.hypot(...errors);
      label.textContent = `${tape.length.toFixed(3)} ${unit}` + (error === null ? "" : ` ± ${Math.max(error, 0.001).toFixed(3)}`);
    }
    room.draw();
  };
  tape.set = (on) => {
    tape.on = on;
    ends.length = 0;
    room.canvas.style.cursor = on ? "crosshair" : "";
    room.draw();
  };
  return tape;
}
