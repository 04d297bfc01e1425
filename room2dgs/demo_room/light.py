"""Baked light: soft shadows from the lamps and diffuse bounces, independent of the view."""

from __future__ import annotations

import numpy as np

from room2dgs.demo_room.atlas import LIGHT_TEXEL, Charts, pack, srgb_to_linear
from room2dgs.demo_room.geometry import EMITTER, Patch, TriangleSoup
from room2dgs.mesh.open3d import o3c_tensor, o3d

BOUNCE_RAYS = 64
BOUNCES = 3
LIGHT_SAMPLES = 5  # along each side of an emitter
OFFSET = 0.004  # metres that rays start above their surface
COLOUR_OF_LIGHT = {"down": (1.0, 0.93, 0.82), "side": (0.86, 0.94, 1.0)}
LAMP_TO_WINDOW = 3.5  # radiance of the lamp for a window of 1
GLARE = 2.5  # an emitter's own radiance in the picture: overexposed


def cast(scene: o3d.t.geometry.RaycastingScene, origins: np.ndarray, directions: np.ndarray) -> dict[str, np.ndarray]:
    """First hits of N rays.

    Returns:
        t_hit (N,) in units of the direction's length (inf without a hit), primitive_ids (N,), primitive_uvs (N, 2),
        primitive_normals (N, 3).
    """
    rays = np.concatenate([origins, directions], axis=1, dtype=np.float32, casting="same_kind")
    hits = scene.cast_rays(o3c_tensor(rays))
    return {key: hits[key].numpy() for key in ("t_hit", "primitive_ids", "primitive_uvs", "primitive_normals")}


def hit_uv(soup: TriangleSoup, ids: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """(N, 2) float32 patch parameters at barycentric weights (N, 2; 2nd and 3rd corner) of triangles (N,)."""
    corners = soup.uv_frames.take(ids, axis=0)
    uv = corners[:, 0:2]
    uv += weights[:, :1] * corners[:, 2:4]
    uv += weights[:, 1:] * corners[:, 4:6]
    return uv


def bake_light(
    patches: list[Patch],
    soup: TriangleSoup,
    scene: o3d.t.geometry.RaycastingScene,
    paint: np.ndarray,
    paint_charts: Charts,
) -> tuple[np.ndarray, Charts]:
    """Irradiance / pi of every patch, so that radiance = albedo x light.

    Args:
        patches, soup, scene: the room, its triangles and their ray-casting scene (one geometry).
        paint, paint_charts: colours of the patches, for the bounces.

    Returns:
        (H, W, 3) float32 atlas scaled so that the mean radiance of the room is mid-grey, and its charts.
    """
    charts = pack(patches, LIGHT_TEXEL, 512)
    colors = mean_colors(patches, paint, paint_charts)
    lights = [(patch, radiance(patch)) for patch in patches if patch.material is EMITTER]
    atlas = light_atlas(patches, soup, scene, charts, colors, lights)
    for patch, (x, y), (w, h) in zip(patches, charts.corner, charts.size, strict=True):
        if patch.material is EMITTER:
            atlas[y : y + h, x : x + w] = GLARE
    return atlas, charts


def radiance(emitter: Patch) -> np.ndarray:
    """(3,) radiance of a lamp (facing down) or a window."""
    down = emitter.points_at(np.zeros(1), np.zeros(1))[1][0, 2] < -0.5
    return np.array(COLOUR_OF_LIGHT["down" if down else "side"]) * (LAMP_TO_WINDOW if down else 1.0)


def light_atlas(
    patches: list[Patch],
    soup: TriangleSoup,
    scene: o3d.t.geometry.RaycastingScene,
    charts: Charts,
    colors: np.ndarray,
    lights: list[tuple[Patch, np.ndarray]],
    bounce_rays: int = BOUNCE_RAYS,
) -> np.ndarray:
    """(H, W, 3) float32 atlas of irradiance / pi, the room's mean radiance scaled to mid-grey.

    Args:
        patches, soup, scene: the room, its triangles and their ray-casting scene (one geometry).
        charts: of the atlas.
        colors: (P, 3) linear albedo of the patches, for the bounces.
        lights: emitters and their radiance (3,).
        bounce_rays: directions a texel.
    """
    owner, index, position, normal = light_texels(patches, charts)
    direct = direct_light(lights, scene, position, normal)
    lit, seen, buried = bounced_light(soup, scene, charts, position, normal, index, direct, colors, bounce_rays)
    atlas = np.zeros((charts.shape[0] * charts.shape[1], 3), np.float32)
    albedo = colors[owner]
    lit *= 0.20 / np.average(albedo * lit, axis=0, weights=seen).mean()
    atlas[index] = lit + 0.01
    covered = np.zeros(len(atlas), bool)
    covered[index[buried]] = True
    picture = atlas.reshape(*charts.shape, 3)
    spread_into_buried(picture, covered.reshape(charts.shape), charts)
    return picture


def light_texels(patches: list[Patch], charts: Charts) -> tuple[np.ndarray, ...]:
    """Owner patch (N,), flat atlas index (N,), position and normal (N, 3) of every light texel."""
    owner, index, position, normal = [], [], [], []
    for number, (patch, (x, y), (w, h)) in enumerate(zip(patches, charts.corner, charts.size, strict=True)):
        u, v = np.meshgrid((np.arange(w) + 0.5) / w, (np.arange(h) + 0.5) / h)
        points, normals = patch.points_at(u.ravel(), v.ravel())
        columns, rows = np.meshgrid(x + np.arange(w), y + np.arange(h))
        owner.append(np.full(w * h, number))
        index.append((rows * charts.shape[1] + columns).ravel())
        position.append(points + OFFSET * normals)
        normal.append(normals)
    return np.concatenate(owner), np.concatenate(index), np.concatenate(position), np.concatenate(normal)


def direct_light(lights: list[tuple[Patch, np.ndarray]], scene, position: np.ndarray, normal: np.ndarray):
    """(N, 3) irradiance / pi from emitters and their radiances (3,) through shadow rays."""
    total = np.zeros((len(position), 3))
    steps = (np.arange(LIGHT_SAMPLES) + 0.5) / LIGHT_SAMPLES
    u, v = (axis.ravel() for axis in np.meshgrid(steps, steps))
    for patch, tint in lights:
        points, normals = patch.points_at(u, v)
        share = patch.size[0] * patch.size[1] / (np.pi * len(points))
        for point, facing in zip(points, normals, strict=True):
            to_light = point + 0.01 * facing - position
            squared = np.maximum(np.einsum("ni,ni->n", to_light, to_light), 0.04)
            cosines = np.maximum(np.einsum("ni,ni->n", to_light, normal), 0) * np.maximum(-to_light @ facing, 0)
            strength = share * cosines / squared**2
            lit = np.flatnonzero(strength > 0)
            rays = np.concatenate([position[lit], to_light[lit]], axis=1).astype(np.float32)
            shadow = scene.test_occlusions(o3c_tensor(rays), 0.0, 0.999).numpy()
            total[lit] += (strength[lit] * ~shadow)[:, None] * tint
    return total


def mean_colors(patches: list[Patch], paint: np.ndarray, charts: Charts) -> np.ndarray:
    """(P, 3) mean linear albedo of each patch; emitters reflect nothing."""
    colors = np.zeros((len(patches), 3))
    for number, (patch, (x, y), (w, h)) in enumerate(zip(patches, charts.corner, charts.size, strict=True)):
        if patch.material is not EMITTER:
            step_x, step_y = max(1, w // 32), max(1, h // 32)
            colors[number] = srgb_to_linear(paint[y : y + h : step_y, x : x + w : step_x]).mean(axis=(0, 1))
    return colors


def bounced_light(soup, scene, charts, position, normal, index, direct, albedo, rays: int) -> tuple[np.ndarray, ...]:
    """Direct light plus diffuse bounces.

    The same cosine-distributed directions serve every texel, so that the light stays smooth over a surface.

    Returns:
        lit: (N, 3) light with bounces.
        seen: (N,) weight of a texel in the mean brightness: its openness.
        buried: (N,) bool, inside another solid (behind a cupboard, under a table leg).
    """
    golden = np.pi * (3 - np.sqrt(5))
    k = np.arange(rays)
    radius = np.sqrt((k + 0.5) / rays)
    local = np.stack([radius * np.cos(golden * k), radius * np.sin(golden * k), np.sqrt(1 - radius**2)], 1)
    helper = np.where(np.abs(normal[:, 2:]) < 0.9, [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]])
    tangent = np.cross(helper, normal)
    tangent /= np.maximum(np.linalg.norm(tangent, axis=1, keepdims=True), 1e-12)
    bitangent = np.cross(normal, tangent)
    targets = np.zeros((rays, len(position)), np.int64)
    reflect = np.zeros((rays, len(position), 3), np.float32)
    backs, openness = np.zeros(len(position)), np.zeros(len(position))
    row_of_texel = np.zeros(charts.shape[0] * charts.shape[1], np.int64)
    row_of_texel[index] = np.arange(len(index))
    for ray, (a, b, c) in enumerate(local):
        direction = a * tangent + b * bitangent + c * normal
        hits = cast(scene, position, direction)
        rows = np.flatnonzero(np.isfinite(hits["t_hit"]))
        patch = soup.patch[hits["primitive_ids"][rows]]
        texel = np.round(
            charts.texels(patch, hit_uv(soup, hits["primitive_ids"][rows], hits["primitive_uvs"][rows]))
        ).astype(np.int64)
        targets[ray, rows] = row_of_texel[texel[:, 1] * charts.shape[1] + texel[:, 0]]
        reflect[ray, rows] = albedo[patch]
        backs[rows] += np.einsum("ni,ni->n", hits["primitive_normals"][rows], direction[rows]) > 0
        openness[rows] += np.minimum(hits["t_hit"][rows], 1.0)
    lit = direct
    for _ in range(BOUNCES):
        bounced = np.zeros_like(direct)
        for ray in range(rays):
            bounced += reflect[ray] * lit[targets[ray]]
        lit = direct + bounced / rays
    buried = backs > 0.4 * rays
    return lit, np.where(buried, 0.0, openness), buried


def spread_into_buried(atlas: np.ndarray, buried: np.ndarray, charts: Charts) -> None:
    """Gives buried texels the light of open neighbours, so that no dark fringe surrounds the furniture."""
    for (x, y), (w, h) in zip(charts.corner, charts.size, strict=True):
        light, hidden = atlas[y : y + h, x : x + w], buried[y : y + h, x : x + w].copy()
        if not hidden.any() or hidden.all():
            continue
        for _ in range(2):
            known = np.pad((~hidden).astype(np.float32), 1)
            padded = np.pad(light * ~hidden[..., None], ((1, 1), (1, 1), (0, 0)))
            total = padded[:-2, 1:-1] + padded[2:, 1:-1] + padded[1:-1, :-2] + padded[1:-1, 2:]
            count = known[:-2, 1:-1] + known[2:, 1:-1] + known[1:-1, :-2] + known[1:-1, 2:]
            filled = hidden & (count > 0)
            light[filled] = total[filled] / count[filled][:, None]
            hidden &= ~filled
