"""The notebook runs from its first cell to its last, on a video of a known corner."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

NOTEBOOK = Path(__file__).resolve().parents[1] / "notebooks/video_to_mesh.ipynb"
QUICK = {
    "prepare": {"features": 700, "length": ["height", 1.3]}, "prior": "none", "stereo__enabled": False,
    "seeds__voxel_m": 0.1, "train": {"iterations": 20, "tensorboard": False}, "mesh__voxel_m": 0.05,
    "report": {"faces": 1000, "max_surfels": 1000},
}  # fmt: skip


@pytest.mark.slow
def test_the_notebook_makes_a_mesh_of_a_video(corner_walk, tmp_path):
    nbformat = pytest.importorskip("nbformat")
    client = pytest.importorskip("nbclient").NotebookClient
    pytest.importorskip("ipykernel")
    angles = np.radians(np.linspace(15.0, 70.0, 12))
    eyes = [[(2.2 + 0.2 * np.sin(9 * a)) * np.cos(a), (2.2 + 0.2 * np.sin(9 * a)) * np.sin(a), 1.3] for a in angles]
    pictures = [photo for _, photo in corner_walk(eyes, [[0.2, 0.2, 0.4]] * len(eyes))]
    height, width = pictures[0].shape[:2]
    writer = cv2.VideoWriter(str(tmp_path / "walk.avi"), cv2.VideoWriter_fourcc(*"MJPG"), 5, (width, height))
    for picture in pictures:
        writer.write(cv2.cvtColor(picture, cv2.COLOR_RGB2BGR))
    writer.release()
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    assert not any(cell.get("outputs") for cell in notebook.cells)  # stored without results
    assert len(notebook.cells) == 6
    (place,) = (i for i, cell in enumerate(notebook.cells) if "parameters" in cell.metadata.get("tags", ()))
    ours = f"VIDEO, OUT, SETTINGS = {str(tmp_path / 'walk.avi')!r}, {str(tmp_path / 'run')!r}, {QUICK!r}"
    notebook.cells.insert(place + 1, nbformat.v4.new_code_cell(ours))
    client(notebook, timeout=300, kernel_name="python3").execute()
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", ())]
    said = "".join(output.get("text", "") for output in outputs)
    shown = "".join(output.get("data", {}).get("text/html", "") for output in outputs)
    assert "12 photos placed, 0 left out" in said and " triangles, " in said and "Surfels(" in said
    assert "data:image/jpeg;base64," in shown
    assert (tmp_path / "run/mesh.ply").is_file() and (tmp_path / "run/export/mesh.glb").is_file()
