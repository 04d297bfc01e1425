// The photos' cameras in the room: a press on one, on a photo or on a place to film again flies there and shows the photo.
"use strict";

// over: the frame of the photo over the room, with an img, a figcaption and a range inside.
function createPhotos(room, moves, over) {
  const { about, scene, frame } = room;
  const photos = { shown: null, changed: () => {} }, signs = [];
  const group = new THREE.Group();
  group.visible = false;
  group.add(frusta(), path());
  scene.add(group);
  for (const [number, spot] of about.spots.entries()) scene.add(sign(number + 1, spot));
  const image = over.querySelector("img"), words = over.querySelector("figcaption span");
  const fade = over.querySelector("input");

  function frusta() {
    const points = [], s = about.camera_m;
    for (const one of about.cameras) {
      const t = one.turn, corner = (x, y) => {
        const v = [((x - one.cx) / one.fx) * s, ((y - one.cy) / one.fy) * s, s];
        return new THREE.Vector3(...[0, 1, 2].map((k) => one.at[k] + t[3 * k] * v[0] + t[3 * k + 1] * v[1] + t[3 * k + 2] * v[2]));
      };
      const eye = new THREE.Vector3(...one.at);
      const rim = [corner(0, 0), corner(one.width, 0), corner(one.width, one.height), corner(0, one.height)];
      rim.forEach((point, k) => points.push(eye, point, point, rim[(k + 1) % 4]));
    }
    const geometry = new THREE.BufferGeometry().setFromPoints(points);
    return new THREE.LineSegments(geometry, new THREE.LineBasicMaterial({ color: 0x6ee7ff }));
  }
  function path() {
    const points = about.path.map((one) => new THREE.Vector3(...one));
    const material = new THREE.LineBasicMaterial({ color: 0xff8a3d, depthTest: false });
    const line = new THREE.Line(new THREE.BufferGeometry().setFromPoints(points), material);
    line.renderOrder = 1;
    return line;
  }
  function sign(number, spot) {
    const canvas = document.createElement("canvas");
    canvas.width = canvas.height = 64;
    const ink = canvas.getContext("2d");
    ink.fillStyle = "#d81b60";
    ink.beginPath();
    ink.arc(32, 32, 30, 0, 7);
    ink.fill();
    ink.fillStyle = "#fff";
    ink.font = "bold 38px sans-serif";
    ink.textAlign = "center";
    ink.textBaseline = "middle";
    ink.fillText(String(number), 32, 34);
    const material = new THREE.SpriteMaterial({
      map: new THREE.CanvasTexture(canvas), depthTest: false, sizeAttenuation: false,
    });
    const sprite = new THREE.Sprite(material);
    sprite.position.set(...spot.at);
    sprite.renderOrder = 2;
    signs.push(sprite);
    return sprite;
  }

  function drawn() {
    for (const one of signs) one.scale.setScalar((52 * Math.tan((room.camera.fov * Math.PI) / 360)) / frame.clientHeight);
    if (photos.shown !== null && !room.flying()) lay(about.cameras[photos.shown]);
    return false;
  }
  room.before.push(drawn);

  // The photo where its pixels belong in the picture.
  function lay(one) {
    const scale = frame.clientHeight / 2 / Math.tan((room.camera.fov * Math.PI) / 360) / one.fy;
    image.style.width = `${one.width * scale}px`;
    image.style.height = `${one.height * scale}px`;
    image.style.left = `${frame.clientWidth / 2 - one.cx * scale}px`;
    image.style.top = `${frame.clientHeight / 2 - one.cy * scale}px`;
  }

  photos.show = async (index) => {
    const one = about.cameras[index];
    photos.leave();
    const t = one.turn; // rows of the turn from the camera, x right, y down, z ahead, to the world
    const turn = new THREE.Matrix4().set(t[0], -t[1], -t[2], 0, t[3], -t[4], -t[5], 0, t[6], -t[7], -t[8], 0, 0, 0, 0, 1);
    const width = Math.max(one.cx, one.width - one.cx), height = Math.max(one.cy, one.height - one.cy);
    const scale = Math.min(frame.clientWidth / 2 / width, frame.clientHeight / 2 / height);
    photos.shown = index;
    photos.changed();
    await moves.walk({
      position: new THREE.Vector3(...one.at), quaternion: new THREE.Quaternion().setFromRotationMatrix(turn),
      fov: (360 / Math.PI) * Math.atan(frame.clientHeight / 2 / (one.fy * scale)),
    });
    if (photos.shown !== index) return;
    image.src = one.photo;
    image.alt = `photo ${one.name}`;
    words.textContent = one.name;
    fade.value = 100;
    image.style.opacity = 1;
    over.hidden = false;
    frame.dataset.photo = one.name;
    room.draw();
  };
  photos.leave = () => {
    if (photos.shown === null) return;
    photos.shown = null;
    over.hidden = true;
    delete frame.dataset.photo;
    photos.changed();
  };
  moves.left = photos.leave;
  fade.addEventListener("input", () => (image.style.opacity = fade.value / 100));

  // The nearest camera or sign at a place of the picture; null: none.
  photos.at = (x, y, touch) => {
    let found = null, least = touch ? 26 : 16;
    const look = (point, camera) => {
      const seen = room.onScreen(point), away = seen ? Math.hypot(seen.x - x, seen.y - y) : Infinity;
      if (away < least) [found, least] = [camera, away];
    };
    for (const spot of about.spots) if (spot.camera !== null) look(new THREE.Vector3(...spot.at), spot.camera);
    if (group.visible) about.cameras.forEach((one, index) => look(new THREE.Vector3(...one.at), index));
    return found;
  };
  photos.cameras = (on) => {
    group.visible = on;
    room.draw();
  };
  photos.visible = () => group.visible;
  return photos;
}
