"""Makes depth and normal priors of a chosen quality from a capture's ground-truth depth, for studies.

    python -m room2dgs.tools.simulate_priors SCENE OUT --abs-rel 0.05 --normal-deg 16 --seed 0

Written: OUT/depth/<i>.png (16-bit millimetres) or .npy (metres), OUT/normal/<i>.png (8-bit, camera frame, OpenCV
axes, facing the camera), OUT/priors.json and OUT/README.txt, which say SIMULATED and what was measured. Whatever
is trained with them says so too. The same options give the same bytes.

The errors are those of networks: smooth warps of the depth, a part of them the same from every view (so that
fusing views does not average it out), a scale and a shift for each view, edges that bleed, normals that are wrong
over whole regions and in the fine.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

import cv2
import numpy as np
from scipy.ndimage import distance_transform_edt

from room2dgs.captures.read import read_scene
from room2dgs.captures.scene import Frame
from room2dgs.commands.flags import add_flags
from room2dgs.config import load_config
from room2dgs.errors import InputError
from room2dgs.files import whole_folder
from room2dgs.geometry.depth_maps import depth_normals
from room2dgs.tools.command_line import command_line
from room2dgs.tools.prior_errors import WorldField, blurred_depth, image_field, turned

CONTENT = {"depth", "normal", "priors.json", "README.txt"}
# wavelength of what all views get wrong alike, metres
SHARED_WAVELENGTH_M = 2.0
CALIBRATION_FRAMES, CALIBRATION_STEPS = 8, 4
# a 16-bit PNG ends here
MAX_MM = 65535


@dataclass(frozen=True)
class PriorOptions:
    """What quality to make.

    Attributes:
        abs_rel: mean relative depth error that is left after each view's best scale and shift.
        scale_sigma: deviation of the views' scales (log).
        shift_sigma: deviation of the views' shifts, metres.
        warp: bumps of the smooth depth error across a photo.
        shared: share of the errors' variance that is the same from every view, 0 to 1.
        edge_blur: deviation of the blur of depth, pixels.
        normal_deg: mean angular error of the normals, degrees.
        noise_only: maps of pure noise, which know nothing of the scene.
        depth_format: png or npy.
        seed: fixes everything.
    """

    abs_rel: float = 0.05
    scale_sigma: float = 0.05
    shift_sigma: float = 0.05
    warp: float = 4.0
    shared: float = 0.3
    edge_blur: float = 1.5
    normal_deg: float = 16.0
    noise_only: bool = False
    depth_format: str = "png"
    seed: int = 0


LIMITS = {
    "abs_rel": (0, 0.5),
    "scale_sigma": (0, 1),
    "shift_sigma": (0, 1),
    "warp": (1, 64),
    "shared": (0, 1),
    "edge_blur": (0, 50),
    "normal_deg": (0, 45),
    "seed": (0, 2**63 - 1),
}


@dataclass(frozen=True)
class Truth:
    """One frame's ground truth and its unit errors, to be scaled.

    Attributes:
        depth: (H, W) metres, 0 = none.
        normal: (H, W, 3) camera frame, facing the camera; 0 = none.
        rays: (H, W, 3).
        warp: (H, W) unit depth error.
        turn: (H, W, 3) unit normal error.
        log_scale, shift_m: of the view.
    """

    depth: np.ndarray
    normal: np.ndarray
    rays: np.ndarray
    warp: np.ndarray
    turn: np.ndarray
    log_scale: float
    shift_m: float


def simulate_priors(
    scene: Path | str, out: Path | str, options: PriorOptions | None = None, overwrite: bool = False
) -> dict[str, float]:
    """Writes simulated priors; they appear at `out` only when they are complete.

    Args:
        scene: a capture with depth.
        out: folder to write.
        options: which quality.
        overwrite: replace earlier priors at `out`.

    Returns:
        What was measured: abs_rel and delta1 as written and after each view's best scale and shift,
        normal_deg; means over all valid pixels.

    Raises:
        InputError: an option is out of range, the capture has no depth, or `out` must not be replaced.
    """
    options = options or PriorOptions()
    _check_options(options)
    out = Path(out)
    _check_free(out, overwrite)
    config = load_config([f"scene.path={scene}", "out=unused", "scene.test_every=0"]).scene
    frames = [frame for frame in read_scene(config).train if frame.depth_path]
    if not frames:
        raise InputError(f"{Path(scene) / 'depth'} has no depth maps; priors are simulated from ground-truth depth")
    with whole_folder(out) as partial:
        measured = _write(partial, frames, options)
    return measured


def spoilt_depth(truth: Truth, amplitude: float, edge_blur: float) -> np.ndarray:
    """(H, W) the prior's depth in metres, 0 = none."""
    depth = blurred_depth(truth.depth, edge_blur) * np.exp(amplitude * truth.warp + truth.log_scale) + truth.shift_m
    return np.where(truth.depth > 0, np.maximum(depth, 0.01), 0.0)


def depth_errors(prior: np.ndarray, truth: np.ndarray) -> tuple[float, float]:
    """(AbsRel, delta1) over pixels valid in both: mean |d - d*| / d*, share with max(d/d*, d*/d) < 1.25."""
    valid = (prior > 0) & (truth > 0)
    if not valid.any():
        return float("nan"), float("nan")
    ratio = prior[valid] / truth[valid]
    return float(np.abs(ratio - 1.0).mean()), float((np.maximum(ratio, 1.0 / ratio) < 1.25).mean())


def best_fit(prior: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """The prior with the scale and shift of least squared relative error; 0 stays 0."""
    valid = (prior > 0) & (truth > 0)
    if valid.sum() < 2:
        return prior
    columns = np.stack([prior[valid] / truth[valid], 1.0 / truth[valid]], axis=1)
    scale, shift = np.linalg.lstsq(columns, np.ones(len(columns)), rcond=None)[0]
    return np.where(prior > 0, np.maximum(scale * prior + shift, 1e-3), 0.0)


def mean_angle(prior: np.ndarray, truth: np.ndarray) -> float:
    """Degrees between unit normals, mean over pixels where both are known."""
    known = prior.any(axis=-1) & truth.any(axis=-1)
    if not known.any():
        return float("nan")
    return float(np.degrees(np.arccos((prior[known] * truth[known]).sum(axis=-1).clip(-1.0, 1.0))).mean())


def _write(out: Path, frames: list[Frame], options: PriorOptions) -> dict[str, float]:
    """All files into the empty folder `out`."""
    (out / "depth").mkdir()
    (out / "normal").mkdir()
    warp, turn = (0.0, 0.0) if options.noise_only else _amplitudes(frames, options)
    errors = []
    for index, frame in enumerate(frames):
        truth = _truth(frame, index, options)
        if options.noise_only:
            depth, normal = _noise(truth, index, options)
        else:
            depth = spoilt_depth(truth, warp, options.edge_blur)
            normal = turned(truth.normal, turn * truth.turn, truth.rays)
        depth = np.minimum(depth, MAX_MM / 1000.0)
        errors.append(
            (
                *depth_errors(depth, truth.depth),
                *depth_errors(best_fit(depth, truth.depth), truth.depth),
                mean_angle(normal, truth.normal),
            )
        )
        name = frame.name if frame.shares_stem else frame.color_path.stem
        _save_depth(out / "depth" / name, depth, options.depth_format)
        _save_png(out / "normal" / f"{name}.png", _rgb(normal)[..., ::-1])
    names = ("abs_rel", "delta1", "abs_rel_aligned", "delta1_aligned", "normal_deg")
    means = np.nanmean(np.array(errors), axis=0)
    measured = {name: round(float(mean), 4) for name, mean in zip(names, means, strict=True)}
    label = {"simulated": True, "frames": len(frames), "options": asdict(options), "measured": measured}
    (out / "priors.json").write_text(json.dumps(label, indent=1) + "\n", encoding="utf-8")
    (out / "README.txt").write_text(_readme(measured, options), encoding="utf-8")
    return measured


def _truth(frame: Frame, index: int, options: PriorOptions) -> Truth:
    known = frame.depth()
    assert known is not None
    depth = known.astype(np.float64)
    camera = frame.camera
    height, width = depth.shape
    # twice: wide where the surface goes on, narrow at its edges
    wide, narrow = depth_normals(depth, camera, step=4, max_jump=0.05), depth_normals(depth, camera)
    normal = np.where(wide.any(axis=-1, keepdims=True), wide, narrow)
    rays = camera.rays()
    own = np.random.default_rng([options.seed, 1, index])
    common = np.random.default_rng([options.seed, 2])
    shared_warp, shared_turn = WorldField(common, SHARED_WAVELENGTH_M), WorldField(common, SHARED_WAVELENGTH_M, 3)
    filled = depth
    if (depth > 0).any() and not (depth > 0).all():
        nearest = distance_transform_edt(depth <= 0, return_distances=False, return_indices=True)
        filled = depth[tuple(nearest)]
    xyz = camera.unproject_map(filled)
    same, other = np.sqrt(options.shared), np.sqrt(1.0 - options.shared)
    warp = same * shared_warp.at(xyz)[..., 0] + other * image_field(own, height, width, options.warp)
    own_turn = np.stack(
        [
            0.8 * image_field(own, height, width, 2 * options.warp) + 0.6 * image_field(own, height, width, width / 6)
            for _ in range(3)
        ],
        axis=-1,
    )
    turn = same * camera.turned_to_camera(shared_turn.at(xyz)) + other * own_turn
    log_scale, shift = own.normal(size=2) * (options.scale_sigma, options.shift_sigma)
    return Truth(depth, normal, rays, warp, turn, float(log_scale), float(shift))


def _amplitudes(frames: list[Frame], options: PriorOptions) -> tuple[float, float]:
    """Factors of the unit errors that give the wanted AbsRel and mean angle on some of the frames."""
    chosen = np.unique(np.linspace(0, len(frames) - 1, CALIBRATION_FRAMES).astype(int))
    truths = [_truth(frames[index], int(index), options) for index in chosen]

    def abs_rel(factor: float) -> float:
        priors = [best_fit(spoilt_depth(truth, factor, options.edge_blur), truth.depth) for truth in truths]
        return float(
            np.nanmean([depth_errors(prior, truth.depth)[0] for prior, truth in zip(priors, truths, strict=True)])
        )

    def angle(factor: float) -> float:
        return float(
            np.nanmean(
                [mean_angle(turned(truth.normal, factor * truth.turn, truth.rays), truth.normal) for truth in truths]
            )
        )

    return _solve(abs_rel, options.abs_rel, options.abs_rel), _solve(angle, options.normal_deg, 0.3)


def _solve(measure: Callable[[float], float], wanted: float, start: float) -> float:
    """The factor whose measure is the wanted one; 0 if the measure is above it already without."""
    least = measure(0.0)
    if not wanted > least:
        return 0.0
    factor = start
    for _ in range(CALIBRATION_STEPS):
        gained = measure(factor) - least
        factor *= min(4.0, max(0.25, (wanted - least) / max(gained, 1e-9)))
    return factor


def _noise(truth: Truth, index: int, options: PriorOptions) -> tuple[np.ndarray, np.ndarray]:
    """Depth and normals that have nothing to do with the scene; the normals face the camera all the same."""
    rng = np.random.default_rng([options.seed, 3, index])
    depth = rng.uniform(0.5, 6.0, size=truth.depth.shape)
    normal = rng.normal(size=truth.normal.shape)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    return depth, np.where((normal * truth.rays).sum(axis=-1, keepdims=True) > 0, -normal, normal)


def _rgb(normal: np.ndarray) -> np.ndarray:
    """(H, W, 3) uint8, n = rgb / 127.5 - 1; black where there is none."""
    coded = np.round((normal + 1.0) * 127.5).clip(0, 255).astype(np.uint8)
    return np.where(normal.any(axis=-1, keepdims=True), coded, 0).astype(np.uint8)


def _save_depth(path: Path, depth: np.ndarray, suffix: str) -> None:
    if suffix == "npy":
        np.save(path.with_name(path.name + ".npy"), depth.astype(np.float32))
    else:
        _save_png(path.with_name(path.name + ".png"), np.round(1000.0 * depth).astype(np.uint16))


def _save_png(path: Path, image: np.ndarray) -> None:
    """A full disk raises OSError, where cv2.imwrite only returns False."""
    path.write_bytes(cv2.imencode(".png", image)[1].tobytes())


def _readme(measured: dict[str, float], options: PriorOptions) -> str:
    unit = "16-bit PNG, millimetres" if options.depth_format == "png" else ".npy, metres"
    kind = "pure noise" if options.noise_only else "ground truth, spoilt"
    return (
        f"SIMULATED priors ({kind}). No network made them; results with them are studies, not claims.\n\n"
        f"depth   {unit}, z-depth, 0 = invalid\n"
        "normal  8-bit PNG, n = rgb / 127.5 - 1, camera frame, OpenCV axes, facing the camera, black = invalid\n\n"
        f"AbsRel {measured['abs_rel']:.4f}, delta1 {measured['delta1']:.4f}; after each view's best scale and shift "
        f"{measured['abs_rel_aligned']:.4f}, {measured['delta1_aligned']:.4f}\n"
        f"normals {measured['normal_deg']:.1f} degrees off in the mean\n"
        f"options {json.dumps(asdict(options))}\n"
    )


def _check_options(options: PriorOptions) -> None:
    for name, (low, high) in LIMITS.items():
        value = getattr(options, name)
        if not low <= value <= high:
            raise InputError(f"{name} is {value}; give a value from {low} to {high}")
    if options.depth_format not in ("png", "npy"):
        raise InputError(f"depth_format is {options.depth_format}; choose from png, npy")


def _check_free(out: Path, overwrite: bool) -> None:
    """Raises InputError if writing to `out` would replace something that is not ours."""
    if out.is_symlink() or (out.exists() and not out.is_dir()):
        raise InputError(f"{out} is not a folder; choose another name")
    names = {path.name for path in out.iterdir()} if out.exists() else set()
    if names and not overwrite:
        raise InputError(f"{out} is not empty; choose another folder or add --overwrite")
    if names - CONTENT:
        raise InputError(f"{out} holds {sorted(names - CONTENT)[0]}, which is no part of priors; choose another folder")


@command_line("simulate_priors")
def main(arguments: list[str]) -> None:
    """The command line."""
    parser = argparse.ArgumentParser(
        prog="simulate_priors",
        description="Make depth and normal priors of a chosen quality from ground-truth depth.",
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    helps = {
        "abs_rel": "mean relative depth error left after each view's best scale and shift",
        "scale_sigma": "deviation of the views' scales (log)",
        "shift_sigma": "deviation of the views' shifts in metres",
        "warp": "bumps of the smooth depth error across a photo",
        "shared": "share of the errors' variance that is the same from every view",
        "edge_blur": "blur of the depth in pixels",
        "normal_deg": "mean angular error of the normals",
        "noise_only": "maps of pure noise",
        "depth_format": "png (16-bit millimetres) or npy (metres)",
        "seed": "fixes everything",
    }
    parser.add_argument("scene", type=Path, help="capture with ground-truth depth")
    parser.add_argument("out", type=Path, help="folder to write")
    add_flags(parser, PriorOptions, helps)
    parser.add_argument("--overwrite", action="store_true", help="replace earlier priors in that folder")
    given = vars(parser.parse_args(arguments))
    scene, out, overwrite = given.pop("scene"), given.pop("out"), given.pop("overwrite")
    measured = simulate_priors(scene, out, PriorOptions(**given), overwrite)
    print(f"{out}: SIMULATED priors, " + ", ".join(f"{name} {value}" for name, value in measured.items()))


if __name__ == "__main__":
    sys.exit(main())
