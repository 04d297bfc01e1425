// Arrays inside the page: blocks #bytes-NAME, base64 of zlib, and #bytes-glb, base64 of a GLB file.
"use strict";

function rawBytes(name) {
  const text = atob(document.getElementById("bytes-" + name).textContent.trim());
  return Uint8Array.from(text, (c) => c.charCodeAt(0));
}

// A function that takes one typed array after the other.
async function unpacked(name) {
  const stream = new Blob([rawBytes(name)]).stream().pipeThrough(new DecompressionStream("deflate"));
  const buffer = await new Response(stream).arrayBuffer();
  let at = 0;
  return (Type, count) => {
    const taken = new Type(buffer, at, count);
    at += Math.ceil(taken.byteLength / 4) * 4; // each begins at a multiple of four
    return taken;
  };
}

// Places, picture coordinates, indices and picture of a GLB file with one mesh.
async function glbParts(name) {
  const buffer = rawBytes(name).buffer;
  const length = new DataView(buffer).getUint32(12, true);
  const tree = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 20, length)));
  const part = (view, more = 0) => 28 + length + (view.byteOffset || 0) + more;
  const array = (index) => {
    const accessor = tree.accessors[index], view = tree.bufferViews[accessor.bufferView];
    const Type = { 5121: Uint8Array, 5123: Uint16Array, 5125: Uint32Array, 5126: Float32Array }[accessor.componentType];
    const count = { SCALAR: 1, VEC2: 2, VEC3: 3 }[accessor.type] * accessor.count;
    const at = part(view, accessor.byteOffset || 0);
    return new Type(buffer.slice(at, at + count * Type.BYTES_PER_ELEMENT));
  };
  const { attributes, indices } = tree.meshes[0].primitives[0];
  const view = tree.bufferViews[tree.images[0].bufferView];
  const file = new Blob([new Uint8Array(buffer, part(view), view.byteLength)], { type: tree.images[0].mimeType });
  return {
    position: array(attributes.POSITION),
    uv: array(attributes.TEXCOORD_0),
    index: array(indices),
    picture: await createImageBitmap(file),
  };
}
