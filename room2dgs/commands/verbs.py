"""The commands by name."""

from __future__ import annotations

# verb -> its line in the help; the code is room2dgs/commands/<verb>.py
VERBS = {
    "demo": "a made room to try everything on",
    "app": "a page on this machine: drop a folder or a video, choose how fine, watch, look",
    "prepare": "a video or photos without poses to a capture that run reads",
    "run": "photos to a scored mesh: points, training, mesh, renders, scores",
    "train": "the first part of run: points and training",
    "depth": "dense depth of a capture by stereo, and a first mesh without training",
    "mesh": "mesh an earlier run (again)",
    "eval": "score an earlier run, or any mesh against a ground truth",
    "render": "pictures of an earlier run's views beside the photos",
    "view": "walk through an earlier run in a browser",
    "open": "the page of an earlier run, in this machine's browser",
    "report": "one page of an earlier run that opens in any browser",
    "compare": "two runs on one page: what differs, scores, both rooms seen by one camera",
    "export": "an earlier run for other programs: splats, GLB, COLMAP, depth maps and more",
    "table": "runs and other methods' meshes in the columns of the paper's Table I",
    "plan": "floor, ceiling and walls by name: a floor plan with dimensions",
    "measure": "lengths in an earlier run, each with its standard deviation",
    "scale": "an earlier run at another scale, by a known length",
    "ablate": "run the method without each of its parts: one table, pictures side by side",
    "completion": "completion of commands and settings by TAB, for bash, zsh or fish",
    "doctor": "what is installed here, and what will run on what",
    "bench": "measure the rasterizer or a prior: bench raster, bench prior SCENE",
}
