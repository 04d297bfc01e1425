"""Our GLB in Blender, which no one here wrote: metres, z up, and the colours as they are in the mesh."""

from __future__ import annotations

import json
import shutil
import subprocess

import numpy as np
import pytest

from room2dgs.export.axes import y_up_from
from room2dgs.export.mesh_files import glb

LOOK = """
import bpy, json, numpy, sys
numpy.bool = bool  # Debian 12's Blender asks for a name that its numpy no longer has
path, answer = sys.argv[-2:]
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.import_scene.gltf(filepath=path)
(found,) = (one for one in bpy.data.objects if one.type == "MESH")
places = [list(found.matrix_world @ vertex.co) for vertex in found.data.vertices]
layer = found.data.color_attributes[0]
colors = [[0.0, 0.0, 0.0]] * len(places)
if layer.domain == "POINT":
    colors = [list(one.color)[:3] for one in layer.data]
else:
    for loop, one in zip(found.data.loops, layer.data):
        colors[loop.vertex_index] = list(one.color)[:3]
metre = bpy.context.scene.unit_settings.scale_length
json.dump({"places": places, "colors": colors, "metre": metre, "faces": len(found.data.polygons)}, open(answer, "w"))
"""


@pytest.mark.slow
@pytest.mark.skipif(not shutil.which("blender"), reason="no Blender here (Debian: apt install blender)")
def test_blender_has_the_mesh_upright_in_metres_and_colour(painted, tmp_path):
    (tmp_path / "mesh.glb").write_bytes(glb(painted, y_up_from(np.array([0, 0, 1.0]))))
    (tmp_path / "look.py").write_text(LOOK)
    command = ["blender", "--background", "--factory-startup", "--python-exit-code", "3", "--python"]
    command += [str(tmp_path / "look.py"), "--", str(tmp_path / "mesh.glb"), str(tmp_path / "said.json")]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    said = json.loads((tmp_path / "said.json").read_text())
    assert said["metre"] == 1.0 and said["faces"] == len(painted.faces)
    places, colors = np.array(said["places"]), np.array(said["colors"])
    # Blender's world has z up, as the mesh's own: it must be where it was
    np.testing.assert_allclose(places.min(axis=0), painted.bounds[0], atol=1e-5)
    np.testing.assert_allclose(places.max(axis=0), painted.bounds[1], atol=1e-5)
    red = places[:, 2] - 2.5  # with the height, as `painted` is made
    srgb = np.stack([red, np.full_like(red, 30 / 255), np.full_like(red, 5 / 255)], axis=1)
    linear = np.where(srgb > 0.04045, ((srgb + 0.055) / 1.055) ** 2.4, srgb / 12.92)
    np.testing.assert_allclose(colors, linear, atol=0.005)
