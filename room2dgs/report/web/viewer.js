// The mesh and the discs of a run, turning. Reads the blocks #scene (JSON) and #bytes-* (base64 of zlib) of the page.
"use strict";

(async () => {
  const frame = document.getElementById("viewer");
  const said = document.getElementById("viewer-said");
  if (!frame) return;
  const about = JSON.parse(document.getElementById("scene").textContent);

  async function bytes(name) {
    const text = atob(document.getElementById("bytes-" + name).textContent.trim());
    const packed = Uint8Array.from(text, (c) => c.charCodeAt(0));
    const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
    const buffer = await new Response(stream).arrayBuffer();
    let at = 0;
    return (Type, count) => {
      const taken = new Type(buffer, at, count);
      at += Math.ceil(taken.byteLength / 4) * 4; // each begins at a multiple of four
      return taken;
    };
  }

  let renderer;
  try {
    renderer = new THREE.WebGLRenderer({ antialias: true, preserveDrawingBuffer: true });
  } catch (error) {
    said.textContent = "This browser has no WebGL, so nothing can turn here; the pictures below need none.";
    return;
  }
  THREE.ColorManagement.enabled = false; // colours are those of the photos, as they are
  renderer.outputColorSpace = THREE.LinearSRGBColorSpace;
  renderer.setClearColor(0xf4f4f2);
  renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
  frame.appendChild(renderer.domElement);

  const up = new THREE.Vector3(...about.up);
  const low = new THREE.Vector3(...about.low);
  const high = new THREE.Vector3(...about.high);
  const middle = low.clone().add(high).multiplyScalar(0.5);
  const size = high.distanceTo(low) || 1;
  const camera = new THREE.PerspectiveCamera(45, 1, size / 500, size * 10);
  camera.up.copy(up);
  const beside = new THREE.Vector3(...about.beside);
  camera.position.copy(middle).addScaledVector(beside, size * 0.75).addScaledVector(up, size * 0.6);
  const controls = new THREE.OrbitControls(camera, renderer.domElement);
  controls.target.copy(middle);
  controls.autoRotate = true;
  controls.autoRotateSpeed = 1.2;
  controls.addEventListener("start", () => turn(false));
  controls.addEventListener("change", () => draw());

  let asked = false, inView = true; // of pictures, see `draw`
  const scene = new THREE.Scene();
  scene.add(new THREE.AmbientLight(0xffffff, 1.7));
  const lamp = new THREE.DirectionalLight(0xffffff, 1.7); // at the eye
  camera.add(lamp);
  scene.add(camera);

  // the mesh: one geometry, and a set of colours for each thing that can be shown on it
  const mesh = await readMesh();
  const backs = new THREE.Mesh(mesh.geometry, ghost());
  scene.add(mesh, backs);
  for (const [number, spot] of about.spots.entries()) scene.add(sign(number + 1, spot));
  let discs = null; // read when first shown

  async function readMesh() {
    const next = await bytes("mesh");
    const { vertices, faces, layers } = about.mesh;
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
    geometry.computeVertexNormals();
    // faces look into the room: those that turn their back are but a ghost, and one looks in through the wall
    return new THREE.Mesh(geometry, new THREE.MeshBasicMaterial({ vertexColors: true, side: THREE.FrontSide }));
  }

  function ghost() {
    return new THREE.MeshBasicMaterial({
      vertexColors: true, side: THREE.BackSide, transparent: true, opacity: 0.12, depthWrite: false,
    });
  }

  function sign(number, spot) {
    const canvas = document.createElement("canvas");
    canvas.width = canvas.height = 64;
    const ink = canvas.getContext("2d");
    ink.fillStyle = "#c2185b";
    ink.beginPath();
    ink.arc(32, 32, 30, 0, 7);
    ink.fill();
    ink.fillStyle = "#fff";
    ink.font = "bold 38px sans-serif";
    ink.textAlign = "center";
    ink.textBaseline = "middle";
    ink.fillText(String(number), 32, 34);
    const material = new THREE.SpriteMaterial({ map: new THREE.CanvasTexture(canvas), depthTest: false });
    const sprite = new THREE.Sprite(material);
    sprite.position.set(...spot.at);
    sprite.scale.setScalar(size * 0.035);
    sprite.renderOrder = 2;
    return sprite;
  }

  // Discs: a quad in the plane of each, to 3 standard deviations, drawn from far to near.
  async function readDiscs() {
    const { count, low: corner, step } = about.discs;
    const next = await bytes("discs");
    const place = next(Uint16Array, 3 * count);
    const shape = next(Float32Array, 2 * count); // standard deviations, metres
    const turned = next(Int16Array, 4 * count); // w x y z
    const color = next(Uint8Array, 4 * count); // and opacity
    const wide = 1024;
    const rows = Math.ceil((3 * count) / wide);
    const texels = new Float32Array(4 * wide * rows);
    const centers = new Float32Array(3 * count);
    for (let i = 0; i < count; i++) {
      for (let k = 0; k < 3; k++) centers[3 * i + k] = corner[k] + place[3 * i + k] * step;
      const t = 12 * i;
      texels.set(centers.subarray(3 * i, 3 * i + 3), t);
      texels[t + 3] = color[4 * i + 3] / 255;
      for (let k = 0; k < 4; k++) texels[t + 4 + k] = turned[4 * i + k] / 32767;
      texels[t + 8] = shape[2 * i];
      texels[t + 9] = shape[2 * i + 1];
      texels[t + 10] = color[4 * i] + 256 * color[4 * i + 1];
      texels[t + 11] = color[4 * i + 2];
    }
    const map = new THREE.DataTexture(texels, wide, rows, THREE.RGBAFormat, THREE.FloatType);
    map.needsUpdate = true;
    const geometry = new THREE.InstancedBufferGeometry();
    const corners = new Float32Array([-1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1, 0]);
    geometry.setAttribute("position", new THREE.BufferAttribute(corners, 3));
    geometry.setIndex([0, 1, 2, 0, 2, 3]);
    const order = new Float32Array(count).map((_, i) => i);
    geometry.setAttribute("disc", new THREE.InstancedBufferAttribute(order, 1));
    geometry.instanceCount = count;
    const material = new THREE.RawShaderMaterial({
      glslVersion: THREE.GLSL3,
      uniforms: { map: { value: map } },
      transparent: true,
      depthWrite: false,
      side: THREE.FrontSide,
      vertexShader: `
        precision highp float;
        uniform highp sampler2D map;
        uniform mat4 modelViewMatrix, projectionMatrix;
        in vec3 position;
        in float disc;
        out vec2 at;
        out vec4 color;
        vec4 texel(int i) { return texelFetch(map, ivec2(i % ${wide}, i / ${wide}), 0); }
        vec3 turn(vec4 q, vec3 v) { return v + 2.0 * cross(q.yzw, cross(q.yzw, v) + q.x * v); }
        void main() {
          int i = 3 * int(disc + 0.5);
          vec4 a = texel(i), q = texel(i + 1), s = texel(i + 2);
          at = 3.0 * position.xy;
          float green = floor(s.z / 256.0);
          color = vec4(s.z - 256.0 * green, green, s.w, 255.0 * a.w) / 255.0;
          vec3 place = a.xyz + turn(q, vec3(at * s.xy, 0.0));
          gl_Position = projectionMatrix * modelViewMatrix * vec4(place, 1.0);
        }`,
      fragmentShader: `
        precision highp float;
        in vec2 at;
        in vec4 color;
        out vec4 shown;
        void main() {
          float weight = color.a * exp(-0.5 * dot(at, at));
          if (weight < 0.00392) discard;
          shown = vec4(color.rgb, weight);
        }`,
    });
    const found = new THREE.Mesh(geometry, material);
    found.frustumCulled = false;
    found.userData = { centers, order, depth: new Float32Array(count), last: null };
    return found;
  }

  function sortDiscs() {
    const { centers, order, depth, last } = discs.userData;
    const eye = camera.getWorldDirection(new THREE.Vector3());
    if (last && last.dot(eye) > 0.9995) return;
    discs.userData.last = eye.clone();
    const count = order.length, bins = 65536;
    let near = Infinity, far = -Infinity;
    for (let i = 0; i < count; i++) {
      depth[i] = centers[3 * i] * eye.x + centers[3 * i + 1] * eye.y + centers[3 * i + 2] * eye.z;
      near = Math.min(near, depth[i]);
      far = Math.max(far, depth[i]);
    }
    const starts = new Uint32Array(bins + 1);
    const factor = (bins - 1) / (far - near || 1);
    for (let i = 0; i < count; i++) starts[Math.floor((far - depth[i]) * factor) + 1]++;
    for (let b = 0; b < bins; b++) starts[b + 1] += starts[b];
    for (let i = 0; i < count; i++) order[starts[Math.floor((far - depth[i]) * factor)]++] = i;
    discs.geometry.attributes.disc.needsUpdate = true;
  }

  const buttons = [...document.querySelectorAll("#viewer-layers button[data-layer]")];
  async function show(layer) {
    for (const button of buttons) button.setAttribute("aria-pressed", String(button.dataset.layer === layer));
    for (const key of document.querySelectorAll("[data-key]")) key.hidden = key.dataset.key !== layer;
    if (layer === "discs" && !discs) {
      discs = await readDiscs();
      scene.add(discs);
    }
    if (discs) discs.visible = layer === "discs";
    mesh.visible = backs.visible = layer !== "discs";
    if (mesh.visible) {
      mesh.geometry.setAttribute("color", mesh.geometry.userData.layers[layer]);
      const Material = layer === "color" ? THREE.MeshBasicMaterial : THREE.MeshLambertMaterial;
      mesh.material.dispose();
      mesh.material = new Material({ vertexColors: true, side: THREE.FrontSide });
    }
    frame.dataset.shown = layer;
    draw();
  }
  for (const button of buttons) button.addEventListener("click", () => show(button.dataset.layer));

  const turning = document.getElementById("viewer-turn");
  function turn(on) {
    controls.autoRotate = on;
    turning.setAttribute("aria-pressed", String(on));
    draw();
  }
  turning.addEventListener("click", () => turn(!controls.autoRotate));

  // The wheel and one finger move the page until somebody presses inside: then they are the viewer's, till one leaves.
  const canvas = renderer.domElement;
  function take(on) {
    controls.enableZoom = on;
    canvas.style.touchAction = on ? "none" : "pan-y pinch-zoom";
    frame.classList.toggle("taken", on);
  }
  take(false);
  canvas.addEventListener("pointerdown", () => take(true));
  canvas.addEventListener("pointerleave", (event) => event.pointerType === "mouse" && !event.buttons && take(false));
  document.addEventListener("pointerdown", (event) => frame.contains(event.target) || take(false));

  function fit() {
    const width = frame.clientWidth || 800, height = Math.min(620, Math.max(280, width * 0.62));
    renderer.setSize(width, height);
    camera.aspect = width / height;
    camera.updateProjectionMatrix();
    draw();
  }

  // A picture is drawn when something has changed, and while the room turns where somebody can see it.
  function draw() {
    if (asked) return;
    asked = true;
    requestAnimationFrame(() => {
      asked = false;
      controls.update(); // moves the camera while it turns or slows down, and then asks for the next picture
      if (discs && discs.visible) sortDiscs();
      renderer.render(scene, camera);
      frame.dataset.drawn = "true";
      frame.dataset.pictures = Number(frame.dataset.pictures || 0) + 1;
      if (controls.autoRotate && inView) draw();
    });
  }
  new ResizeObserver(fit).observe(frame);
  new IntersectionObserver((entries) => {
    inView = entries.at(-1).isIntersecting;
    if (inView) draw();
  }).observe(frame);
  fit();
  if (window.matchMedia("(prefers-reduced-motion: reduce)").matches) turn(false);
  await show("color");
})();
