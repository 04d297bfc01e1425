// The surfels of a run: flat discs.
"use strict";

// Discs: a quad in the plane of each, to 3 standard deviations, drawn from far to near.
async function readDiscs(about, name) {
  const { count, low: corner, step } = about;
  const next = await unpacked(name);
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

// From far to near, by bins of depth; nothing where the camera has hardly turned.
function sortDiscs(discs, camera) {
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
