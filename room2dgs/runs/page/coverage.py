"""What to film again: where the mesh was seen by few photos, at a slant, or ends; and which photos are blurred."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import cv2
import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree
from trimesh.graph import face_adjacency

from room2dgs.captures.scene import Frame, Scene
from room2dgs.captures.selection import evenly_spaced
from room2dgs.eval.boundary_kinds import FREE, NOT_SEEN, NOT_TRUSTED, WORDS
from room2dgs.eval.culling import sees
from room2dgs.eval.surface import Surface
from room2dgs.geometry.camera import Camera
from room2dgs.mesh.boundary_file import BoundaryEdges
from room2dgs.runs.page.mesh_layer import PageMesh
from room2dgs.runs.trust import Trust

MAX_CAMERAS = 150  # cameras, evenly spaced
INWARDS = 0.1  # of the way from a corner to its triangle's middle
FEW = 3  # photos: fewer and nothing checks the depth
SLANT_COS = 0.26  # 75 degrees between the normal and the best ray
LEAST_M2, LEAST_HOLE_M = 0.15, 0.35
MOST_SPOTS = 4  # of each kind
RIM = 0.6  # of the room's diagonal: an open edge so long is the rim of what was filmed, not a hole
HOLES = {
    NOT_SEEN: "A hole of {across:.1f} m: film into it, slowly, with its edges in the picture",
    NOT_TRUSTED: "A hole of {across:.1f} m that photos show, but whose depth is not sure (blank, shining, glass): film "
    "it from nearer, from several sides, with more light",
}
SHARP_WIDTH = 320
BLURRED = 0.4  # of the sharpness of its neighbours in the capture
NEIGHBOURS = 4  # to either side
MAX_PHOTOS = 300  # photos


class Spot(NamedTuple):
    """A place that wants more photos.

    Attributes:
        at: (3,) metres, world.
        text: what is wrong there and what would mend it.
        photo: name of the photo to look for it in; None: there are no photos.
    """

    at: np.ndarray
    text: str
    photo: str | None


class Coverage(NamedTuple):
    """How well cameras saw the vertices of a mesh.

    Attributes:
        photos: (N,) number of photos that see each; where not all cameras were asked, in proportion.
        steepest: (N,) largest cosine between its normal and a ray that sees it.
        off_m: (N,) median difference, metres, between the mesh and the depth that photos were given there, of the
            photos that see it; NaN where no such depth is known.
    """

    photos: np.ndarray
    steepest: np.ndarray
    off_m: np.ndarray


def coverage(room: PageMesh, frames: Sequence[Frame], trust: Mapping[str, Trust]) -> Coverage:
    """Which vertices the frames' cameras see, by casting rays against the mesh itself.

    Args:
        trust: frame name -> its depth; may be empty.
    """
    import trimesh

    surface = Surface(trimesh.Trimesh(room.vertices, room.faces, process=False))
    some = evenly_spaced(frames, MAX_CAMERAS)
    corners = room.vertices[room.faces]
    points = room.vertices.copy()
    # a little inside of a triangle: rays to the rim itself may slip by
    points[room.faces] = (1 - INWARDS) * corners + INWARDS * corners.mean(axis=1, keepdims=True)
    count, steepest = np.zeros(len(room.vertices)), np.zeros(len(room.vertices))
    off = np.full((len(some), len(room.vertices)), np.nan, np.float32)
    for number, frame in enumerate(some):
        camera = frame.camera
        seen = sees(points, camera, surface, surface)
        ray = camera.centre - points[seen]
        cosine = (ray * room.normals[seen]).sum(axis=1) / np.maximum(np.linalg.norm(ray, axis=1), 1e-9)
        count[seen] += 1
        steepest[seen] = np.maximum(steepest[seen], np.abs(cosine))
        if frame.name in trust:
            off[number, seen] = _off(points[seen], camera, trust[frame.name])
    return Coverage(count * (len(frames) / len(some)), steepest, _median(off))


def _off(points: np.ndarray, camera: Camera, trust: Trust) -> np.ndarray:
    """(N,) how far points lie from the depth of a view, metres; NaN where it has none."""
    if trust.depth is None:
        return np.full(len(points), np.nan)
    height, width = trust.depth.shape
    pixel, depth = camera.resized(width, height).project(points)
    inside = np.nan_to_num(pixel, nan=-1.0)
    x, y = (np.clip(inside[:, k].astype(int), 0, size - 1) for k, size in enumerate((width, height)))
    known = trust.depth[y, x].astype(float)
    return np.where(known > 0, np.abs(depth - known), np.nan)


def _median(off: np.ndarray) -> np.ndarray:
    """(N,) of each column's numbers; NaN where a column has none."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # columns without a number
        return np.nanmedian(off, axis=0)


def spots(room: PageMesh, seen: Coverage, frames: Sequence[Frame], boundary: BoundaryEdges | None = None) -> list[Spot]:
    """Places of the mesh that want more photos, the largest first.

    Args:
        boundary: of the mesh, by what lies beyond it: what is free wants none. None: not known.
    """
    few = (seen.photos[room.faces] < FEW).all(axis=1)
    slant = (seen.steepest[room.faces] < SLANT_COS).all(axis=1) & ~few
    findings = (
        (few, f"{{area:.1f}} m² that fewer than {FEW} photos see: step to the side and film it from two more places"),
        (slant, "{area:.1f} m² seen only at a slant: film it again from straight in front"),
    )
    found = []
    for bad, sentence in findings:
        for at, area in _patches(room, bad):
            where, photo = _beside(at, frames)
            found.append(Spot(at, sentence.format(area=area) + where, photo))
    for at, across, kind in _holes(room, boundary):
        where, photo = _beside(at, frames)
        found.append(Spot(at, HOLES[kind].format(across=across) + where, photo))
    return found


def advice(scene: Scene, seen: Coverage | None) -> list[str]:
    """Sentences about the capture as a whole."""
    lines = []
    if seen is not None and len(seen.photos):
        lines.append(
            f"Of the mesh's points, {np.mean(seen.photos >= 6):.0%} are seen by six photos or more, "
            f"{np.mean(seen.photos < FEW):.0%} by fewer than {FEW}."
        )
    blurred = blurred_photos(scene.frames)
    if blurred:
        lines.append(
            f"Much less detail than in the photos before and after: {_some(blurred)}. Unless a blank wall is why, they "
            "are blurred: walk more slowly there, or with more light."
        )
    else:
        lines.append("No photo has much less detail than those before and after it: none is badly blurred.")
    if scene.dropped:
        lines.append(f"Left out: {_some([f'{one.name} ({one.reason})' for one in scene.dropped])}.")
    return lines


def blurred_photos(frames: Sequence[Frame]) -> list[str]:
    """Names of photos with much less fine detail than those before and after them."""
    step = max(1, len(frames) // MAX_PHOTOS)
    some = frames[::step]
    detail = np.array([_detail(frame.color()) for frame in some])
    names = []
    for index, frame in enumerate(some):
        near = detail[max(0, index - NEIGHBOURS) : index + NEIGHBOURS + 1]
        if detail[index] < BLURRED * np.median(near):
            names.append(frame.name)
    return names


def _detail(photo: np.ndarray) -> float:
    """Standard deviation of the Laplacian of a small grey copy."""
    height = max(1, round(photo.shape[0] * SHARP_WIDTH / photo.shape[1]))
    grey = cv2.cvtColor(cv2.resize(photo, (SHARP_WIDTH, height), interpolation=cv2.INTER_AREA), cv2.COLOR_RGB2GRAY)
    return float(cv2.Laplacian(grey, cv2.CV_32F).std())


def _patches(room: PageMesh, bad: np.ndarray) -> list[tuple[np.ndarray, float]]:
    """Middle and area, m², of the largest connected sets of the marked triangles."""
    corners = room.vertices[room.faces]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    pairs = face_adjacency(room.faces)
    pairs = pairs[bad[pairs].all(axis=1)]
    graph = coo_matrix((np.ones(len(pairs), bool), pairs.T), shape=(len(bad), len(bad)))
    label = connected_components(graph, directed=False)[1]
    total = np.bincount(label[bad], weights=areas[bad], minlength=label.max() + 1)
    found = []
    for one in np.argsort(-total, kind="stable")[:MOST_SPOTS]:
        if total[one] < LEAST_M2:
            break
        inside = bad & (label == one)
        middles = corners[inside].mean(axis=1)
        middle = np.average(middles, axis=0, weights=areas[inside])
        found.append((middles[np.linalg.norm(middles - middle, axis=1).argmin()], float(total[one])))
    return found


def _holes(room: PageMesh, boundary: BoundaryEdges | None) -> list[tuple[np.ndarray, float, int]]:
    """Middle, size in metres and kind of the largest closed runs of edges that only one triangle has, but for those
    beyond which space is free."""
    edges = np.sort(room.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    unique, times = np.unique(edges, axis=0, return_counts=True)
    rim = unique[times == 1]
    count = len(room.vertices)
    label = connected_components(coo_matrix((np.ones(len(rim), bool), rim.T), shape=(count, count)), directed=False)[1]
    on_rim = np.unique(rim)
    diagonal = float(np.linalg.norm(np.ptp(room.vertices, axis=0)))
    found = []
    for one in np.unique(label[on_rim]):
        points = room.vertices[on_rim[label[on_rim] == one]]
        across = float(np.linalg.norm(np.ptp(points, axis=0)))
        kind = _kind_beyond(points, boundary)
        if LEAST_HOLE_M <= across < RIM * diagonal and kind != FREE:
            found.append((points.mean(axis=0), across, kind))
    return sorted(found, key=lambda hole: -hole[1])[:MOST_SPOTS]


def _kind_beyond(points: np.ndarray, boundary: BoundaryEdges | None) -> int:
    """The commonest kind of the boundary's edges that are nearest to points of a rim; not seen, if none is known."""
    if boundary is None or not len(boundary.kind):
        return NOT_SEEN
    nearest = cKDTree(boundary.ends.mean(axis=1)).query(points)[1]
    return int(np.bincount(boundary.kind[nearest], minlength=len(WORDS)).argmax())


def _beside(at: np.ndarray, frames: Sequence[Frame]) -> tuple[str, str | None]:
    """Which photo to look for the place in, in words and by its name."""
    inside = [frame for frame in frames if frame.camera.in_view(at[None])[0]]
    nearest = min(inside or frames, key=lambda frame: float(np.linalg.norm(frame.camera.centre - at)), default=None)
    if nearest is None:
        return "", None
    distance = float(np.linalg.norm(nearest.camera.centre - at))
    where = "in the picture of" if inside else "in no photo; nearest is"
    return f" ({where} {nearest.name}, {distance:.1f} m away).", nearest.name


def _some(names: Sequence[str]) -> str:
    return ", ".join(names[:8]) + (f" and {len(names) - 8} more" if len(names) > 8 else "")
