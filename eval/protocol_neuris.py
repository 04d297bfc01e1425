"""Protocol `neuris`: NeuRIS's ScanNet evaluation, very probably that of GaussianRoom and 2DGS-Room.

1. Ground truth: keep the faces that some pixel's ray hits first. Its silhouette in each view is that view's mask.
2. Prediction: drop the vertices outside the ground truth's bounding box x 1.1; keep the faces that some pixel's ray
   hits first; drop the vertices that lie in no view's image, or that *any* view projects where its mask is empty.
3. Vertices, averaged in cells of 2 cm, nearest neighbours. So the scores depend on the tessellation.

Images are 640 wide, rays go through every second pixel, as published. Where it differs: rays go through
pixel centres, the views are all usable frames of the scene, and a prediction of large faces is cut to edges of 2 cm
first, so that it counts as the surface that it is.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import trimesh

from room2dgs.errors import InputError
from room2dgs.eval.protocol import MeshFile, Options, Result, by_vertex
from room2dgs.eval.surface import Surface
from room2dgs.geometry.camera import Camera
from room2dgs.mesh.area import area_m2

IMAGE_WIDTH = 640
RESOLUTION_LEVEL = 2  # rays through every second pixel
BOX_SCALE = 1.1  # of the ground truth's bounding box, about its middle
DOWNSAMPLE_M = 0.02
MOST_PIECES = 20_000_000  # faces of a prediction after it was cut: 7 GB
LARGEST_PIECE_M2 = 3**0.5 / 4 * DOWNSAMPLE_M**2
PART = 2_000_000  # faces made together to count them
MOST_OF_ONE = 12  # halvings that one face may need: its edges are 80 m long
MOST_HALVINGS = 20


def neuris(pred: MeshFile, gt: MeshFile, cameras: Sequence[Camera], options: Options) -> Result:
    """Score by NeuRIS's protocol; of `options` only threshold_m is used.

    Raises:
        InputError: the prediction is so large that no memory holds it in pieces of 2 cm.
    """
    views = [_small(camera) for camera in cameras]
    truth = _first_hit_faces(gt.mesh, views)
    masks = [np.isfinite(hits.t) for hits in map(Surface(truth).seen_by, views)]
    judged = _first_hit_faces(_inside_box(_fine(pred), gt.mesh), views)
    judged = judged.vertices[_inside_masks(judged.vertices, views, masks)]
    constants = {
        "image_width": IMAGE_WIDTH,
        "resolution_level": RESOLUTION_LEVEL,
        "bounding_box_scale": BOX_SCALE,
        "views": len(cameras),
        "prediction_edge_max_m": DOWNSAMPLE_M,
    }
    return by_vertex("neuris", pred, gt, (judged, truth.vertices), DOWNSAMPLE_M, options.threshold_m, constants)


def _fine(pred: MeshFile) -> trimesh.Trimesh:
    """The same surface with edges no longer than the cells in which vertices are averaged.

    A mesh of 1 cm voxels, for which the rules were made, stays as it is.
    """
    mesh = pred.mesh
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    edges = np.linalg.norm(vertices[faces] - vertices[np.roll(faces, 1, axis=1)], axis=2)
    if not len(edges) or edges.max() <= DOWNSAMPLE_M:
        return mesh
    if too_many_pieces(vertices, faces, edges.max(axis=1)):
        raise InputError(
            f"{pred.path or 'the prediction'} has an area of {area_m2(vertices, faces):.3g} m2, of which protocol "
            f"neuris would make more than {MOST_PIECES // 10**6} million faces of 2 cm; is it in millimetres? Scale it "
            "to metres, or leave neuris out of eval.protocols"
        )
    pieces = trimesh.remesh.subdivide_to_size(vertices, faces, DOWNSAMPLE_M, max_iter=MOST_HALVINGS)
    return trimesh.Trimesh(pieces[0], pieces[1], process=False)


def too_many_pieces(vertices: np.ndarray, faces: np.ndarray, longest: np.ndarray, most: int = MOST_PIECES) -> bool:
    """Whether more faces than memory holds would come of cutting edges in halves until none is longer than a cell.

    Args:
        longest: (F,) the faces' longest edges, metres.
        most: faces.
    """
    if area_m2(vertices, faces) / LARGEST_PIECE_M2 > most:
        return True
    halvings = np.ceil(np.log2(np.maximum(longest / DOWNSAMPLE_M, 1)))
    pieces = 4.0**halvings  # at most
    if pieces.sum() <= most or halvings.max() > MOST_OF_ONE:
        return bool(halvings.max() > MOST_OF_ONE)
    # needles: what comes of them is known only when they are cut, a part at a time
    order = np.argsort(pieces)
    part = np.cumsum(pieces[order]) // PART
    total = 0
    for one in np.split(order, np.flatnonzero(np.diff(part)) + 1):
        cut = trimesh.remesh.subdivide_to_size(vertices, faces[one], DOWNSAMPLE_M, max_iter=MOST_HALVINGS)
        total += len(cut[1])
        if total > most:
            return True
    return False


def _small(camera: Camera) -> Camera:
    return camera.resized_to_width(IMAGE_WIDTH // RESOLUTION_LEVEL)


def _first_hit_faces(mesh: trimesh.Trimesh, views: Sequence[Camera]) -> trimesh.Trimesh:
    surface = Surface(mesh)
    hit = np.zeros(len(mesh.faces), dtype=bool)
    for camera in views:
        triangle = surface.seen_by(camera).triangle
        hit[triangle[triangle >= 0]] = True
    return _part(mesh, hit)


def _inside_box(mesh: trimesh.Trimesh, box_of: trimesh.Trimesh) -> trimesh.Trimesh:
    low, high = box_of.vertices.min(axis=0), box_of.vertices.max(axis=0)
    middle, half = (low + high) / 2, (high - low) / 2 * BOX_SCALE
    inside = (np.abs(mesh.vertices - middle) <= half).all(axis=1)
    return _part(mesh, inside[mesh.faces].all(axis=1))


def _inside_masks(points: np.ndarray, views: Sequence[Camera], masks: Sequence[np.ndarray]) -> np.ndarray:
    """(N,) bool: in some view's image, and in no view's image outside its mask."""
    somewhere = np.zeros(len(points), dtype=bool)
    outside = np.zeros(len(points), dtype=bool)
    for camera, mask in zip(views, masks, strict=True):
        pixel, _ = camera.project(points)
        image = np.flatnonzero(camera.inside(pixel))
        column, row = pixel[image].astype(np.int64).T
        somewhere[image] = True
        outside[image] |= ~mask.reshape(camera.height, camera.width)[row, column]
    return somewhere & ~outside


def _part(mesh: trimesh.Trimesh, faces: np.ndarray) -> trimesh.Trimesh:
    """The chosen faces and the vertices they use."""
    used, renumbered = np.unique(np.asarray(mesh.faces)[faces], return_inverse=True)
    return trimesh.Trimesh(mesh.vertices[used], renumbered.reshape(-1, 3), process=False)
