"""A run's splats in web viewers that others wrote, next to our own rendering from the same camera.

    npm install three@0.180.0 @sparkjsdev/spark@2.2.0 @mkkellogg/gaussian-splats-3d@0.4.7     # both MIT
    python tests/export/web_viewer.py RUN node_modules [--out DIR] [--views N]

It exports splats.ply, opens it in headless Chromium, and prints the PSNR of each screenshot against our rendering and,
for scale, against the photo. Pictures, side by side, go to --out. Not a test: it wants npm's packages.
"""

from __future__ import annotations

import argparse
import base64
import functools
import http.server
import importlib.util
import json
import tempfile
import threading
from pathlib import Path

import cv2
import numpy as np
import torch

from room2dgs import cli
from room2dgs.captures.scene import Frame
from room2dgs.eval.image_metrics import psnr
from room2dgs.geometry.camera_tensors import view_matrices
from room2dgs.pipeline.scene import scene_of_run
from room2dgs.runs.folder import earlier_run
from room2dgs.splat import render
from room2dgs.train import load_surfels

spec = importlib.util.spec_from_file_location("chromium", Path(__file__).parents[1] / "runs/chromium.py")
chromium = importlib.util.module_from_spec(spec)
spec.loader.exec_module(chromium)

SETTLED_FRAMES = 12  # splats are sorted beside the drawing: this many pictures later they are in order
IMPORTS = {
    "three": "/node_modules/three/build/three.module.js",
    "three/addons/": "/node_modules/three/examples/jsm/",
    "spark": "/node_modules/@sparkjsdev/spark/dist/spark.module.js",
    "gs3d": "/node_modules/@mkkellogg/gaussian-splats-3d/build/gaussian-splats-3d.module.js",
}
PAGE = """<!doctype html><link rel="icon" href="data:,">
<style>body{margin:0;overflow:hidden;background:#000}canvas{display:block}</style>
<script type="importmap">{"imports": IMPORT_MAP}</script><body><script type="module">
import * as THREE from "three";
const name = location.hash.slice(1), wait = () => new Promise(requestAnimationFrame);
const renderer = new THREE.WebGLRenderer({antialias: false, preserveDrawingBuffer: true});
document.body.append(renderer.domElement);
const camera = new THREE.PerspectiveCamera();
let drawn;
if (name === "spark") {
  const {SparkRenderer, SplatMesh} = await import("spark");
  const scene = new THREE.Scene();
  scene.add(new SparkRenderer({renderer}));
  const splats = new SplatMesh({url: "/splats.ply"});
  scene.add(splats);
  await splats.initialized;
  drawn = () => renderer.render(scene, camera);
} else {
  const {SceneRevealMode, Viewer} = await import("gs3d");
  const viewer = new Viewer({selfDrivenMode: false, renderer, camera, useBuiltInControls: false,
                             sharedMemoryForWorkers: false, rootElement: document.body,
                             sceneRevealMode: SceneRevealMode.Instant});
  await viewer.addSplatScene("/splats.ply", {showLoadingUI: false});
  drawn = () => { viewer.update(); viewer.render(); };
}
window.look = async ({width, height, fov, matrix}) => {
  renderer.setPixelRatio(1);
  renderer.setSize(width, height);
  camera.fov = fov; camera.aspect = width / height; camera.near = 0.05; camera.far = 100;
  camera.updateProjectionMatrix();
  new THREE.Matrix4().set(...matrix).decompose(camera.position, camera.quaternion, camera.scale);
  camera.updateMatrixWorld(true);
  for (let i = 0; i < FRAMES; i++) { drawn(); await wait(); }
  return renderer.domElement.toDataURL("image/png");
};
window.ready = true;
</script>"""
READY = """new Promise((done) => {
  const end = performance.now() + 200e3;
  const look = () => window.ready || performance.now() > end ? done(window.ready) : setTimeout(look, 50);
  look();
})"""


class Served(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *_: object) -> None:
        pass


def file_from_world(ply: Path) -> np.ndarray:
    """(3, 3), from the file's comment."""
    head = ply.read_bytes()[:4000].partition(b"end_header")[0].decode()
    numbers = next(line for line in head.splitlines() if "file_from_world" in line).partition(")")[2].split()
    return np.array(numbers, float).reshape(3, 3)


def seen_by(tab: chromium.Tab, frame: Frame, rotation: np.ndarray) -> np.ndarray:
    """(H, W, 3) uint8: what the viewer draws. Its camera looks along -z with y up, its centre is the picture's."""
    camera = frame.camera
    pose = np.linalg.inv(camera.cam_from_world)
    pose[:3] = rotation @ pose[:3]
    view = {
        "width": camera.width,
        "height": camera.height,
        "fov": float(np.degrees(2 * np.arctan(camera.height / 2 / camera.K[1, 1]))),
        "matrix": (pose @ np.diag([1.0, -1, -1, 1])).ravel().tolist(),
    }
    data = base64.b64decode(tab.run(f"look({json.dumps(view)})").partition(",")[2])
    return cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)[..., ::-1].copy()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("run", type=Path)
    parser.add_argument("node_modules", type=Path)
    parser.add_argument("--out", type=Path, default=Path("web_viewer"))
    parser.add_argument("--viewers", default="spark,gs3d")
    parser.add_argument("--views", type=int, default=4)
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    config = earlier_run([f"run={options.run}"])
    surfels = load_surfels(options.run / "surfels.safetensors")
    held_out = scene_of_run(config).test
    frames = held_out[:: max(1, len(held_out) // options.views)][: options.views]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        assert cli.main(["export", f"run={options.run}", "to=splats", f"out={folder}"]) == 0
        (folder / "node_modules").symlink_to(options.node_modules.resolve())
        page = PAGE.replace("IMPORT_MAP", json.dumps(IMPORTS)).replace("FRAMES", str(SETTLED_FRAMES))
        (folder / "index.html").write_text(page)
        server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Served, directory=name))
        threading.Thread(target=server.serve_forever, daemon=True).start()
        rotation = file_from_world(folder / "splats.ply")
        rows = []
        for viewer in options.viewers.split(","):
            with chromium.tab(folder / f"profile_{viewer}", 900, 700) as tab:
                tab.call("Page.navigate", url=f"http://127.0.0.1:{server.server_port}/index.html#{viewer}")
                assert tab.run(READY), f"{viewer} did not open the file: {tab.said}"
                for frame in frames:
                    rows.append((viewer, frame, seen_by(tab, frame, rotation)))
                print(f"{viewer} said: {tab.said or 'nothing'}")
        server.shutdown()
    for viewer, frame, shot in rows:
        with torch.no_grad():
            ours = render(surfels, *view_matrices(frame.camera), *frame.camera.size).color.clamp(0, 1)
        ours, photo = ours.numpy(), frame.color()
        print(
            f"{viewer:<6} {frame.name:<8} PSNR to our rendering {psnr(shot, ours):.2f} dB; to the photo "
            f"{psnr(shot, photo):.2f} dB (ours {psnr(ours, photo):.2f} dB)"
        )
        beside = np.concatenate([shot, (ours * 255).round().astype(np.uint8)], axis=1)
        cv2.imwrite(str(options.out / f"{viewer}_{frame.name}.png"), beside[..., ::-1])


if __name__ == "__main__":
    main()
