// A room in a frame of the page: its mesh, with the photos on it where the page has them, and its surfels. Either may be
// missing.
"use strict";

const BUTTONS_PX = 120; // above and below
const FIELD_DEG = 40, TOP_DEG = 12, WALK_DEG = 68; // fields of view, from top to bottom
const STILL = window.matchMedia("(prefers-reduced-motion: reduce)").matches;

// The frame must have a size. Null without WebGL.
async function createRoom(frame, about, block = (name) => name) {
  let renderer;
  try {
    renderer = new THREE.WebGLRenderer({ antialias: true, alpha: true, preserveDrawingBuffer: true });
  } catch (error) {
    return null;
  }
  THREE.ColorManagement.enabled = false; // colours are those of the photos, as they are
  renderer.outputColorSpace = THREE.LinearSRGBColorSpace;
  renderer.setClearColor(0, 0);
  renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
  const canvas = renderer.domElement;
  frame.prepend(canvas);

  const up = new THREE.Vector3(...about.up);
  const low = new THREE.Vector3(...about.low), high = new THREE.Vector3(...about.high);
  const middle = low.clone().add(high).multiplyScalar(0.5);
  const size = high.distanceTo(low) || 1;
  const corners = [0, 1, 2, 3, 4, 5, 6, 7].map((i) =>
    new THREE.Vector3(i & 1 ? high.x : low.x, i & 2 ? high.y : low.y, i & 4 ? high.z : low.z));
  const camera = new THREE.PerspectiveCamera(FIELD_DEG, 1, size / 500, size * 20);
  camera.up.copy(up);
  const controls = new THREE.OrbitControls(camera, canvas);
  controls.autoRotateSpeed = 0.8;
  const scene = new THREE.Scene();
  scene.add(new THREE.AmbientLight(0xffffff, 1.5));
  camera.add(new THREE.DirectionalLight(0xffffff, 1.9)); // at the eye
  scene.add(camera);

  const plain = about.mesh ? await readMesh() : null;
  if (plain) scene.add(plain);
  const textured = about.glb ? await readTextured() : null;
  if (textured) scene.add(textured);
  let discs = null; // read when first shown

  async function readMesh() {
    const next = await unpacked(block("mesh"));
    const { vertices, faces, layers, spread } = about.mesh;
    const raw = next(Uint16Array, 3 * vertices);
    const position = new Float32Array(3 * vertices);
    for (let i = 0; i < position.length; i++) position[i] = about.mesh.low[i % 3] + raw[i] * about.mesh.step;
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(position, 3));
    geometry.setIndex(new THREE.BufferAttribute(next(Uint32Array, 3 * faces), 1));
    geometry.userData.layers = {};
    for (const layer of layers) {
      geometry.userData.layers[layer] = new THREE.BufferAttribute(next(Uint8Array, 3 * vertices), 3, true);
    }
    geometry.userData.spread = spread ? next(Uint8Array, vertices) : null; // millimetres
    geometry.computeVertexNormals();
    // faces look into the room; those that turn their back are left away, and one looks in through walls and ceiling
    return new THREE.Mesh(geometry, new THREE.MeshBasicMaterial({ vertexColors: true, side: THREE.FrontSide }));
  }

  async function readTextured() {
    const parts = await glbParts(block("glb"));
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(parts.position, 3));
    geometry.setAttribute("uv", new THREE.BufferAttribute(parts.uv, 2));
    geometry.setIndex(new THREE.BufferAttribute(parts.index, 1));
    const picture = new THREE.Texture(parts.picture);
    picture.flipY = false;
    picture.anisotropy = 4;
    picture.needsUpdate = true;
    const mesh = new THREE.Mesh(geometry, new THREE.MeshBasicMaterial({ map: picture, side: THREE.FrontSide }));
    const [a, b, c, d, e, f, g, h, i] = about.glb.scene_from_file;
    mesh.applyMatrix4(new THREE.Matrix4().set(a, b, c, 0, d, e, f, 0, g, h, i, 0, 0, 0, 0, 1));
    return mesh;
  }

  async function show(layer) {
    if (layer === "discs" && !discs) {
      discs = await readDiscs(about.discs, block("discs"));
      scene.add(discs);
    }
    if (discs) discs.visible = layer === "discs";
    if (textured) textured.visible = layer === "color";
    if (plain) plain.visible = layer !== "discs" && !(textured && layer === "color");
    if (plain?.visible) {
      plain.geometry.setAttribute("color", plain.geometry.userData.layers[layer]);
      const Material = layer === "color" ? THREE.MeshBasicMaterial : THREE.MeshLambertMaterial;
      plain.material.dispose();
      plain.material = new Material({ vertexColors: true, side: THREE.FrontSide });
    }
    frame.dataset.shown = layer;
    draw();
  }

  // How far from the middle the whole room is in the picture between the buttons, from any side at this height. Upper
  // corners in front are of walls that are left away.
  function distance(aim, direction, degrees) {
    const half = Math.tan((degrees * Math.PI) / 360), wide = 0.97 * half * camera.aspect;
    const tall = half * Math.max(0.5, 1 - BUTTONS_PX / frame.clientHeight);
    let far = 0;
    for (let turn = 0; turn < 8; turn++) {
      const back = direction.clone().applyAxisAngle(up, (turn * Math.PI) / 4);
      const right = new THREE.Vector3().crossVectors(up, back).normalize();
      const over = new THREE.Vector3().crossVectors(back, right);
      for (const corner of corners) {
        const to = corner.clone().sub(aim);
        const level = back.clone().addScaledVector(up, -back.dot(up));
        if (to.dot(up) > 0 && to.dot(level) > 0.1 * size * level.length() && level.length() > 0.1) continue;
        far = Math.max(far, to.dot(back) + Math.max(Math.abs(to.dot(right)) / wide, Math.abs(to.dot(over)) / tall));
      }
    }
    return far;
  }
  function from(aim, direction, degrees) {
    const away = direction.clone().normalize();
    return { position: aim.clone().addScaledVector(away, distance(aim, away, degrees)), target: aim.clone(), fov: degrees };
  }
  const beside = new THREE.Vector3(...about.beside), below = new THREE.Vector3(...about.below);
  const tallest = Math.max(...corners.map((corner) => corner.clone().sub(middle).dot(up)));
  const lower = middle.clone().addScaledVector(up, -0.45 * tallest); // what is near looks larger
  const home = () => from(lower, beside.clone().addScaledVector(up, 0.95), FIELD_DEG);
  const above = () => from(middle, up.clone().addScaledVector(below, 0.001), TOP_DEG);

  let flight = null;
  function place(pose) {
    camera.position.copy(pose.position);
    if (pose.quaternion) camera.quaternion.copy(pose.quaternion);
    else camera.lookAt(pose.target);
    camera.fov = pose.fov;
    camera.updateProjectionMatrix();
    if (pose.target) controls.target.copy(pose.target);
    draw();
  }
  // There in a second, or at once for whom movement is nothing; resolves on arrival.
  function fly(pose) {
    flight = null;
    const start = { position: camera.position.clone(), quaternion: camera.quaternion.clone(), fov: camera.fov };
    place(pose);
    if (STILL) return Promise.resolve();
    const end = { ...pose, position: camera.position.clone(), quaternion: camera.quaternion.clone() };
    camera.position.copy(start.position);
    camera.quaternion.copy(start.quaternion);
    return new Promise((done) => {
      flight = { start, end, since: performance.now(), done, enabled: controls.enabled };
      controls.enabled = false;
      draw();
    });
  }
  function step() {
    const { start, end, since, done, enabled } = flight;
    const share = Math.min(1, (performance.now() - since) / 800);
    const eased = share * share * (3 - 2 * share);
    camera.position.lerpVectors(start.position, end.position, eased);
    camera.quaternion.slerpQuaternions(start.quaternion, end.quaternion, eased);
    camera.fov = start.fov + (end.fov - start.fov) * eased;
    camera.updateProjectionMatrix();
    if (share < 1) return;
    flight = null;
    controls.enabled = enabled;
    done();
  }

  // A picture is drawn when something has changed, and while the room turns where somebody can see it.
  let asked = false, inView = true;
  const before = []; // functions that are called before each picture; true: another picture is wanted after it
  function draw() {
    if (asked) return;
    asked = true;
    requestAnimationFrame(() => {
      asked = false;
      if (flight) step();
      else if (controls.enabled) controls.update(); // while it turns or slows down it asks for the next picture
      const again = before.map((one) => one()).some(Boolean);
      if (discs && discs.visible) sortDiscs(discs, camera);
      renderer.render(scene, camera);
      frame.dataset.drawn = "true";
      frame.dataset.pictures = Number(frame.dataset.pictures || 0) + 1;
      if (flight || again || (controls.autoRotate && controls.enabled && inView)) draw();
    });
  }

  let touched = false; // by a person: until then the whole room stays in the picture
  function fit() {
    const width = frame.clientWidth, height = frame.clientHeight;
    if (!width || !height) return;
    renderer.setSize(width, height);
    camera.aspect = width / height;
    camera.updateProjectionMatrix();
    if (!touched) place(home());
    draw();
  }
  controls.addEventListener("start", () => (touched = true));
  controls.addEventListener("change", () => draw());
  new ResizeObserver(fit).observe(frame);
  new IntersectionObserver((entries) => {
    inView = entries.at(-1).isIntersecting;
    if (inView) draw();
  }).observe(frame);
  fit();

  const ray = new THREE.Raycaster();
  // Where a picture's place (pixels from the frame's corner) meets the mesh: {point, error_m}, or null.
  function hit(x, y) {
    if (!plain) return null;
    const at = new THREE.Vector2((2 * x) / frame.clientWidth - 1, 1 - (2 * y) / frame.clientHeight);
    ray.setFromCamera(at, camera);
    const [first] = ray.intersectObject(plain);
    if (!first) return null;
    const spread = plain.geometry.userData.spread, { a, b, c } = first.face;
    return { point: first.point, error_m: spread ? Math.max(spread[a], spread[b], spread[c]) / 1000 : null };
  }
  // Pixels of a point from the frame's corner; null behind the camera.
  function onScreen(point) {
    const seen = point.clone().applyMatrix4(camera.matrixWorldInverse);
    if (seen.z > 0) return null;
    seen.applyMatrix4(camera.projectionMatrix);
    return { x: ((seen.x + 1) / 2) * frame.clientWidth, y: ((1 - seen.y) / 2) * frame.clientHeight };
  }

  return {
    about, frame, canvas, scene, camera, controls, up, middle, size, corners, home, above, place, fly, draw, before, show, hit,
    onScreen, touch: () => (touched = true), flying: () => Boolean(flight),
  };
}
