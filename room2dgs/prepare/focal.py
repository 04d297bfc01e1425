"""The focal length of photos without poses: what their reconstruction determines, weighed with what lenses are like."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from room2dgs.colmap import ONE_THREAD, pycolmap
from room2dgs.prepare.features import FOCAL
from room2dgs.prepare.focal_by_edges import focal_by_edges
from room2dgs.prepare.focal_uncertainty import lens_estimate
from room2dgs.prepare.photos import ChosenPhoto
from room2dgs.sfm.matching import quiet

# The truth is so many standard deviations of the adjustment off: errors of features are not independent. Of made desks
# whose focal length is known it was up to 4.1, at distortions that are not there.
OPTIMISM = 4.0
MODEL_SIGMA = 0.005  # relative: real lenses are not quite as their models; of a phone with known lens it was this
WEAK = 0.05  # relative standard deviation from which on a focal length is not determined by the photos
# What is known before: of any lens, of one that the EXIF tells, of distortion that a phone has mended itself.
LENS_SIGMA, EXIF_SIGMA, DISTORTION_SIGMA = 0.3, 0.1, 0.03
IGNORANT = 1e6
LONGEST_STEP = 0.15  # of a focal length's logarithm at once: after a longer one points may end behind cameras
MAX_FOCAL, MIN_FOCAL = 1.7, 0.35  # of the longer side: others are zoomed, fisheyes, or mistakes
TURNS_DEG = 5.0  # cameras that all look the same way, within that, tell no focal length


@dataclass(frozen=True)
class Focal:
    """The focal length of the camera with most photos.

    Attributes:
        px: in pixels.
        sigma: relative standard deviation; None: it was given.
        by_photos: that of what the photos alone determine; None: it was given.
        exif: as the EXIF has it, pixels; None: it has none.
        edges: as straight edges in the photos tell it, pixels; None: they were not asked, or tell nothing.
        starts: focal lengths in pixels that adjustments from other starts ended with and that are as good.
    """

    px: float
    sigma: float | None = None
    by_photos: float | None = None
    exif: float | None = None
    edges: float | None = None
    starts: tuple[float, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        return asdict(self)

    @property
    def weak(self) -> bool:
        """Whether neither photos nor EXIF determine it."""
        return self.sigma is not None and self.sigma > WEAK and self.exif is None


def focal_from_dict(known: dict[str, Any]) -> Focal:
    """What `Focal.as_dict` gave, also after it was JSON."""
    return Focal(**{**known, "starts": tuple(known["starts"])})


def measured_focal(model: pycolmap.Reconstruction, photos: Sequence[ChosenPhoto]) -> Focal:
    """What the photos alone determine."""
    found = lens_estimate(model)
    if found is None:
        return Focal(_mean_focal(model), np.inf, np.inf)
    sigma = float(np.hypot(OPTIMISM * np.sqrt(found.covariance[0, 0]), MODEL_SIGMA))
    return Focal(float(np.exp(found.values[0])), sigma, sigma, _exif_px(model, found.camera_id, photos))


def is_determined(focal: Focal, model: pycolmap.Reconstruction) -> bool:
    """Whether the photos determine a focal length, and one that lenses have."""
    side = max(max(camera.width, camera.height) for camera in model.cameras.values())
    assert focal.by_photos is not None  # as measured
    return focal.by_photos <= WEAK and (focal.exif is not None or MIN_FOCAL <= focal.px / side <= MAX_FOCAL)


def weighed(
    model: pycolmap.Reconstruction, focal: Focal, images: Path | None = None, others: Sequence[float] = ()
) -> Focal:
    """Moves the lens to where photos, edges and what is known of lenses agree, and adjusts poses and points to it.

    Each has a normal distribution, and the answer that of their product: photos that determine the lens keep theirs.

    Args:
        model: is changed.
        focal: as measured in it.
        images: folder of the photos, whose edges are asked; None: they are not.
        others: focal lengths of models that are as good, pixels.
    """
    found = lens_estimate(model)
    if found is None:
        return focal
    camera = model.camera(found.camera_id)
    likely = focal.exif or FOCAL * max(camera.width, camera.height)
    before = np.r_[np.log(likely), np.zeros(len(found.values) - 1)]
    spread = np.r_[LENS_SIGMA if focal.exif is None else EXIF_SIGMA, [DISTORTION_SIGMA] * (len(before) - 1)]
    own = OPTIMISM**2 * found.covariance
    own[0, 0] = max([own[0, 0], *((np.log(one / focal.px) / 2) ** 2 for one in others)])
    values, covariance = _product(found.values, own, before, np.diag(spread**2))
    _hold(model, found.camera_id, values)
    edges = None if images is None else focal_by_edges(model, images)
    if edges is not None:
        told = values.copy()
        told[0] += edges.log_ratio
        loose = np.diag(np.r_[edges.sigma**2, [IGNORANT] * (len(values) - 1)])  # of distortion edges say nothing
        values, covariance = _product(values, covariance, told, loose)
        _hold(model, found.camera_id, values)
    return replace(
        focal,
        px=float(np.exp(values[0])),
        sigma=float(np.sqrt(covariance[0, 0])),
        edges=None if edges is None else float(np.exp(told[0])),
        starts=tuple(others),
    )


def _product(
    one: np.ndarray, covariance: np.ndarray, other: np.ndarray, other_covariance: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Mean and covariance of the product of two normal distributions."""
    gain = covariance @ np.linalg.inv(covariance + other_covariance)
    return one + gain @ (other - one), covariance - gain @ covariance


def _hold(model: pycolmap.Reconstruction, main: int, values: np.ndarray) -> None:
    """All focal lengths change as the main camera's does, in small steps; the rest is adjusted to them."""
    camera = model.camera(main)
    by_log = values[0] - np.log(camera.mean_focal_length())
    by_extra = values[1:] - np.array(camera.params)[list(camera.extra_params_idxs())]
    steps = max(1, int(np.ceil(abs(by_log) / LONGEST_STEP)))
    for _ in range(steps):
        for camera_id, camera in model.cameras.items():
            params = np.array(camera.params)
            params[list(camera.focal_length_idxs())] *= np.exp(by_log / steps)
            if camera_id == main:
                params[list(camera.extra_params_idxs())] += by_extra / steps
            camera.params = params.tolist()
        _adjust(model)


def _adjust(model: pycolmap.Reconstruction) -> None:
    """Poses and points to the lens."""
    options, config = pycolmap.BundleAdjustmentOptions(), pycolmap.BundleAdjustmentConfig()
    options.refine_focal_length = options.refine_extra_params = options.print_summary = False
    options.ceres.min_num_residuals_for_cpu_multi_threading = ONE_THREAD
    for image_id in sorted(model.reg_image_ids()):
        config.add_image(image_id)
    config.fix_gauge(pycolmap.BundleAdjustmentGauge.TWO_CAMS_FROM_WORLD)
    with quiet():
        pycolmap.create_default_bundle_adjuster(options, config, model).solve()
    model.update_point_3d_errors()


def _exif_px(model: pycolmap.Reconstruction, camera_id: int, photos: Sequence[ChosenPhoto]) -> float | None:
    """Of the first placed photo of a camera; all of them have the same."""
    names = {model.image(i).name for i in model.reg_image_ids() if model.image(i).camera_id == camera_id}
    return next((photo.focal_px for photo in photos if photo.name in names), None)


def _mean_focal(model: pycolmap.Reconstruction) -> float:
    return float(np.median([camera.mean_focal_length() for camera in model.cameras.values()]))


def turn_deg(model: pycolmap.Reconstruction) -> float:
    """Degrees between the two most different orientations of the cameras, at most 90 from the first photo's."""
    turns = [model.image(i).cam_from_world().rotation.matrix() for i in sorted(model.reg_image_ids())]
    cosines = [(np.trace(one @ turns[0].T) - 1) / 2 for one in turns]
    return float(np.degrees(np.arccos(np.clip(min(cosines, default=1.0), -1, 1))))


def focal_line(focal: Focal) -> str:
    """The focal length with how sure it is."""
    if focal.sigma is None:
        return f"focal length {focal.px:.0f} px, as given"
    return f"focal length {focal.px:.0f} px +-{focal.sigma:.1%}"


def focal_doubt(focal: Focal, size: tuple[int, int], turned_deg: float) -> str | None:
    """A warning of a focal length that is a guess; None: it is known or determined.

    Args:
        size: (width, height) of the photos.
        turned_deg: as `turn_deg`.
    """
    if not focal.weak:
        return None
    assert focal.sigma is not None
    why = "the camera always looks the same way" if turned_deg < TURNS_DEG else "too little is seen from too few sides"
    ends = [*focal.starts, focal.px]
    if focal.edges is not None:
        why += f", though edges in them tell {focal.edges:.0f} px"
    equal = f"; from {min(ends):.0f} to {max(ends):.0f} px fit the photos alike" if focal.starts else ""
    return (
        f"the photos do not determine the focal length ({focal.px:.0f} px +-{focal.sigma:.0%}{equal}), because {why}: "
        "the room may come out bent, and too deep or too flat; give "
        f"scene.intrinsics=[FX,FY,{size[0] / 2:g},{size[1] / 2:g}] of the lens, or photos with their EXIF, or film "
        "again and turn the camera while you walk"
    )
