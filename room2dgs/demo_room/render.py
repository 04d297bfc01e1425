"""Frames of the room: colour from ray-cast supersamples, z-depth from one ray through each pixel's centre."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from room2dgs.demo_room.atlas import TEXEL, Charts, linear_to_srgb, lookup, pack, paint_atlas, srgb_to_linear
from room2dgs.demo_room.geometry import EMITTER, Patch, TriangleSoup, triangulated
from room2dgs.demo_room.light import bake_light, cast, hit_uv
from room2dgs.mesh.open3d import o3c_tensor, o3d

SUPERSAMPLES = 3  # along each side of a pixel; odd, so that one ray goes through its centre


@dataclass(frozen=True)
class Room:
    """A room ready for rendering.

    Attributes:
        patches: its surfaces.
        soup, scene: their triangles and the ray-casting scene of these triangles.
        paint, paint_charts: colours (uint8 sRGB) and where each patch's lie.
        light, light_charts: baked light (float32, radiance = albedo x light) and where each patch's lies.
    """

    patches: list[Patch]
    soup: TriangleSoup
    scene: o3d.t.geometry.RaycastingScene
    paint: np.ndarray
    paint_charts: Charts
    light: np.ndarray
    light_charts: Charts

    def radiance(self, patch: np.ndarray, uv: np.ndarray) -> np.ndarray:
        """(N, 3) float32 linear radiance at parameters uv (N, 2) of patches (N,)."""
        albedo = srgb_to_linear(lookup(self.paint, self.paint_charts.texels(patch, uv)))
        return albedo * lookup(self.light, self.light_charts.texels(patch, uv))

    def distance(self, points: np.ndarray) -> np.ndarray:
        """(N,) metres from points (N, 3) to the nearest surface."""
        return self.scene.compute_distance(o3c_tensor(np.ascontiguousarray(points, np.float32))).numpy()


def ray_scene(soup: TriangleSoup) -> o3d.t.geometry.RaycastingScene:
    """The triangles in a ray-casting scene; built on one thread, so that it is the same every time."""
    scene = o3d.t.geometry.RaycastingScene(nthreads=1)
    scene.add_triangles(o3c_tensor(soup.vertices), o3c_tensor(soup.triangles))
    return scene


def build_room(patches: list[Patch], seed: int) -> Room:
    """Paints and lights the patches."""
    soup = triangulated(patches)
    scene = ray_scene(soup)
    charts = pack(patches, TEXEL, 4096)
    paint = paint_atlas(patches, charts, seed)
    light, light_charts = bake_light(patches, soup, scene, paint, charts)
    return Room(patches, soup, scene, paint, charts, light, light_charts)


def pinhole(width: int, height: int, fov: float) -> np.ndarray:
    """(3, 3) float64 K with square pixels and centres at +0.5; `fov` is the horizontal angle in degrees."""
    focal = width / 2 / np.tan(np.radians(fov) / 2)
    return np.array([[focal, 0.0, width / 2], [0.0, focal, height / 2], [0.0, 0.0, 1.0]])


def render(
    room: Room, K: np.ndarray, world_from_cam: np.ndarray, width: int, height: int, gloss: float
) -> tuple[np.ndarray, np.ndarray]:
    """One exact frame.

    Args:
        K: (3, 3) in pixels, pixel centres at +0.5.
        world_from_cam: (4, 4), metres.
        gloss: strength of the floor's mirror reflection, 0 to 1.

    Returns:
        (height, width, 3) float32 linear radiance, averaged over the pixel's area, 1 = white;
        (height, width) float64 z-depth in metres at the pixel's centre, 0 on lights.
    """
    fine = SUPERSAMPLES
    x = ((np.arange(width * fine) + 0.5) / fine - K[0, 2]) / K[0, 0]
    y = ((np.arange(height * fine) + 0.5) / fine - K[1, 2]) / K[1, 1]
    # in the camera (x, y, 1), so that t_hit is the z-depth
    right, down, forward = world_from_cam[:3, :3].T.astype(np.float32)
    from_column = x.astype(np.float32)[None, :, None] * right
    from_row = y.astype(np.float32)[:, None, None] * down + forward
    directions = (from_column + from_row).reshape(-1, 3)
    origins = np.broadcast_to(world_from_cam[:3, 3].astype(np.float32), directions.shape)
    hits = cast(room.scene, origins, directions)
    color = shade(room, hits)
    if gloss > 0:
        add_reflections(room, color, hits, origins, directions, gloss)
    color = color.reshape(height * fine, width * fine, 3)
    color = cv2.resize(color, (width, height), interpolation=cv2.INTER_AREA)  # the exact mean of fine x fine
    centre = (slice(fine // 2, None, fine),) * 2
    depth = hits["t_hit"].reshape(height * fine, width * fine)[centre].astype(np.float64)
    ids = hits["primitive_ids"].reshape(height * fine, width * fine)[centre]
    lights = np.array([patch.material is EMITTER for patch in room.patches])
    solid = np.isfinite(depth)
    solid[solid] = ~lights[room.soup.patch[ids[solid]]]
    return color, np.where(solid, depth, 0.0)


def shade(room: Room, hits: dict[str, np.ndarray]) -> np.ndarray:
    """(N, 3) float32 radiance of hits; black where a ray left the room."""
    missed = np.isinf(hits["t_hit"])
    ids = np.where(missed, 0, hits["primitive_ids"])
    uv = hit_uv(room.soup, ids, hits["primitive_uvs"])
    color = room.radiance(room.soup.patch.take(ids), uv)
    color[missed] = 0
    return color


def add_reflections(room: Room, color, hits, origins, directions, gloss: float) -> None:
    """Adds to `color` what the polished floor mirrors (Schlick's Fresnel term for glass)."""
    floor = np.array([patch.tag == "floor" for patch in room.patches])
    rows = np.flatnonzero(np.isfinite(hits["t_hit"]))
    rows = rows[floor[room.soup.patch[hits["primitive_ids"][rows]]]]
    if not len(rows):
        return
    cosine = -directions[rows, 2] / np.linalg.norm(directions[rows], axis=1)
    share = gloss * (0.04 + 0.96 * (1 - cosine) ** 5)
    points = origins[rows] + hits["t_hit"][rows][:, None] * directions[rows] + np.array([0, 0, 0.002], np.float32)
    mirrored = shade(room, cast(room.scene, points, directions[rows] * np.array([1, 1, -1], np.float32)))
    color[rows] += share[:, None].astype(np.float32) * (mirrored - color[rows])


def exposed(color: np.ndarray, gain: float, noise: float, rng: np.random.Generator) -> np.ndarray:
    """(H, W, 3) uint8 sRGB photo of linear radiance: gain, clipping, tone curve, noise (8-bit levels)."""
    levels = 255 * linear_to_srgb(color * np.float32(gain))
    levels = levels + np.float32(noise) * rng.standard_normal(levels.shape, dtype=np.float32)
    return np.round(np.clip(levels, 0, 255)).astype(np.uint8)
