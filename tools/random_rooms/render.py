"""Photos of a random room with exact depth and normals.

Light is baked once a room (soft shadows, bounces), colours are looked up in the shared pool of pictures, gloss is
one more ray: a tenth of a second a photo on one core.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np

from room2dgs.demo_room.atlas import Charts, lookup, pack, srgb_to_linear
from room2dgs.demo_room.geometry import Patch, TriangleSoup, triangulated
from room2dgs.demo_room.light import cast, hit_uv, light_atlas
from room2dgs.demo_room.render import ray_scene
from room2dgs.mesh.open3d import o3c_tensor, o3d
from room2dgs.tools.random_rooms.materials import Light, Surface
from room2dgs.tools.random_rooms.pictures import SIDE, mean_colors, pool

LIGHT_TEXEL = 0.09  # metres
BOUNCE_RAYS = 40
FINE = 2  # colour rays along each side of a pixel
SILVER = 0.92  # of the light that a mirror reflects
GLARE = 3.0  # radiance of the weakest light in the picture; white is 1
MIRRORED_FROM = 0.004  # metres above the surface


class View(NamedTuple):
    """One photo.

    Attributes:
        radiance: (H, W, 3) float32, linear, 1 = white.
        depth: (H, W) float32 z-depth at pixel centres, metres, 0 = a light or outside.
        normal: (H, W, 3) float32 unit normals in the camera's frame, facing the camera, 0 = as for depth.
    """

    radiance: np.ndarray
    depth: np.ndarray
    normal: np.ndarray


@dataclass(frozen=True)
class Room:
    """A lit room.

    Attributes:
        soup, scene: triangles and their ray-casting scene.
        light, charts: baked light (float32 atlas) and where each patch's lies.
        looks: what each patch looks like.
    """

    soup: TriangleSoup
    scene: o3d.t.geometry.RaycastingScene
    light: np.ndarray
    charts: Charts
    looks: Looks

    def distance(self, points: np.ndarray) -> np.ndarray:
        """(N,) metres from points (N, 3) to the nearest surface."""
        return self.scene.compute_distance(o3c_tensor(np.ascontiguousarray(points, np.float32))).numpy()

    def radiance(self, patch: np.ndarray, uv: np.ndarray) -> np.ndarray:
        """(N, 3) float32 linear radiance at parameters uv (N, 2) of patches (N,), gloss aside."""
        return albedo_at(self.looks, patch, uv) * lookup(self.light, self.charts.texels(patch, uv))


@dataclass(frozen=True)
class Looks:
    """The patches' materials as arrays of P rows.

    Attributes:
        picture: (P,) int32.
        per_uv: (P, 2) float32, texels a unit of u and of v.
        start: (P, 2) float32, texels at u = v = 0.
        turned: (P,) bool, u and v change places.
        tint: (P, 3) float32 mean colour, sRGB.
        contrast, gloss, roughness: (P,) float32.
        emits: (P,) bool.
    """

    picture: np.ndarray
    per_uv: np.ndarray
    start: np.ndarray
    turned: np.ndarray
    tint: np.ndarray
    contrast: np.ndarray
    gloss: np.ndarray
    roughness: np.ndarray
    emits: np.ndarray


def looks_of(patches: list[Patch], rng: np.random.Generator) -> Looks:
    """Reads the materials; `rng` draws where on its picture each patch lies."""
    count, means = len(patches), mean_colors()
    looks = Looks(
        picture=np.zeros(count, np.int32),
        per_uv=np.ones((count, 2), np.float32),
        start=(rng.random((count, 2)) * SIDE).astype(np.float32),
        turned=rng.random(count) < 0.5,
        tint=np.ones((count, 3), np.float32),
        contrast=np.ones(count, np.float32),
        gloss=np.zeros(count, np.float32),
        roughness=np.zeros(count, np.float32),
        emits=np.array([isinstance(patch.material, Light) for patch in patches]),
    )
    for row, patch in enumerate(patches):
        surface = patch.material
        if not isinstance(surface, Surface):
            continue
        looks.picture[row] = surface.picture
        looks.tint[row] = means[surface.picture] if surface.tint is None else surface.tint
        looks.contrast[row], looks.gloss[row] = surface.contrast, surface.gloss
        looks.roughness[row] = surface.roughness
        if surface.repeat is None:
            looks.per_uv[row], looks.start[row], looks.turned[row] = SIDE - 1e-3, 0.0, False
        else:
            looks.per_uv[row] = np.array(patch.size) * SIDE / surface.repeat
    return looks


def light_up(patches: list[Patch], rng: np.random.Generator) -> Room:
    """Lays pictures on the patches and bakes the light."""
    soup = triangulated(patches)
    scene = ray_scene(soup)
    looks = looks_of(patches, rng)
    charts = pack(patches, LIGHT_TEXEL, 512)
    albedo = srgb_to_linear(np.round(255 * looks.tint).astype(np.uint8))
    albedo[looks.emits] = 0
    lights = [(patch, np.array(patch.material.radiance)) for patch in patches if isinstance(patch.material, Light)]
    atlas = light_atlas(patches, soup, scene, charts, albedo, lights, BOUNCE_RAYS)
    weakest = min((float(radiance.mean()) for _, radiance in lights), default=1.0)
    for row in np.flatnonzero(looks.emits):
        (x, y), (w, h) = charts.corner[row], charts.size[row]
        material = patches[row].material
        assert isinstance(material, Light)
        atlas[y : y + h, x : x + w] = GLARE * np.array(material.radiance) / weakest
    return Room(soup, scene, atlas, charts, looks)


def render(
    room: Room,
    focal: float,
    world_from_cam: np.ndarray,
    width: int,
    height: int,
    rng: np.random.Generator,
    fine: int = FINE,
) -> View:
    """One photo of a camera whose principal point is the image's middle.

    Args:
        focal: pixels.
        world_from_cam: (4, 4), metres, OpenCV axes.
        rng: draws the mirrored rays' spread.
        fine: colour rays along each side of a pixel.
    """
    color_rays = rays(focal, world_from_cam, width, height, fine)
    color = shade(room, color_rays[0], color_rays[1], rng).reshape(height * fine, width * fine, 3)
    origins, directions = rays(focal, world_from_cam, width, height, 1)
    hits = cast(room.scene, origins, directions)
    depth, ids = hits["t_hit"], hits["primitive_ids"]
    solid = np.isfinite(depth)
    solid[solid] = ~room.looks.emits[room.soup.patch[ids[solid]]]
    normal = hits["primitive_normals"]
    normal = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    normal = normal * np.where((normal * directions).sum(1, keepdims=True) > 0, -1, 1)
    normal = (normal * solid[:, None]) @ world_from_cam[:3, :3].astype(np.float32)
    return View(
        cv2.resize(color, (width, height), interpolation=cv2.INTER_AREA),
        np.where(solid, depth, 0).reshape(height, width),
        normal.reshape(height, width, 3).astype(np.float32),
    )


def rays(focal: float, world_from_cam: np.ndarray, width: int, height: int, fine: int):
    """Origins and directions (N, 3) float32 of fine x fine rays a pixel; z in the camera is 1, so that t is depth."""
    x = ((np.arange(width * fine) + 0.5) / fine - width / 2) / focal
    y = ((np.arange(height * fine) + 0.5) / fine - height / 2) / focal
    right, down, forward = world_from_cam[:3, :3].T.astype(np.float32)
    directions = x.astype(np.float32)[None, :, None] * right + (y.astype(np.float32)[:, None, None] * down + forward)
    directions = directions.reshape(-1, 3)
    return np.broadcast_to(world_from_cam[:3, 3].astype(np.float32), directions.shape), directions


def shade(room: Room, origins: np.ndarray, directions: np.ndarray, rng: np.random.Generator | None) -> np.ndarray:
    """(N, 3) float32 radiance along rays; mirrors once, if `rng` is given; black where a ray left the room."""
    hits = cast(room.scene, origins, directions)
    missed = ~np.isfinite(hits["t_hit"])
    ids = np.where(missed, 0, hits["primitive_ids"])
    patch = room.soup.patch.take(ids)
    uv = hit_uv(room.soup, ids, hits["primitive_uvs"])
    color = room.radiance(patch, uv)
    color[missed] = 0
    if rng is None:
        return color
    rows = np.flatnonzero((room.looks.gloss[patch] > 0) & ~missed)
    if len(rows):
        normal, along = hits["primitive_normals"][rows], directions[rows]
        along = along / np.linalg.norm(along, axis=1, keepdims=True)
        normal = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
        normal *= np.where((normal * along).sum(1, keepdims=True) > 0, -1, 1)
        cosine = np.clip(-(normal * along).sum(1, keepdims=True), 0, 1)
        gloss = room.looks.gloss[patch[rows], None]
        share = np.where(gloss > 1, SILVER, gloss * (0.04 + 0.96 * (1 - cosine) ** 5)).astype(np.float32)
        spread = room.looks.roughness[patch[rows], None] * rng.standard_normal(along.shape, dtype=np.float32)
        mirrored = along + 2 * cosine * normal + spread
        points = origins[rows] + hits["t_hit"][rows, None] * directions[rows] + MIRRORED_FROM * normal
        color[rows] += share * (shade(room, points, mirrored, None) - color[rows])
    return color


def albedo_at(looks: Looks, patch: np.ndarray, uv: np.ndarray) -> np.ndarray:
    """(N, 3) float32 linear albedo at parameters uv (N, 2) of patches (N,); emitters are 1."""
    texel = uv * looks.per_uv.take(patch, axis=0) + looks.start.take(patch, axis=0)
    turned = looks.turned.take(patch)
    texel = np.where(turned[:, None], texel[:, ::-1], texel)
    texel = np.mod(texel, 2 * SIDE)  # mirrored at its edges: no seam
    texel = np.minimum(texel, 2 * SIDE - 1e-2 - texel).clip(0, SIDE - 1).astype(np.int64)
    pictures, number = pool(), looks.picture.take(patch)
    flat = (number.astype(np.int64) * SIDE + (SIDE - 1 - texel[:, 1])) * SIDE + texel[:, 0]
    value = pictures.reshape(-1, 3).take(flat, axis=0).astype(np.float32) / 255
    value = value - mean_colors().take(number, axis=0)
    value = looks.tint.take(patch, axis=0) + looks.contrast.take(patch)[:, None] * value
    color = srgb_to_linear(np.round(255 * np.clip(value, 0.01, 0.98)).astype(np.uint8))
    color[looks.emits.take(patch)] = 1
    return color
