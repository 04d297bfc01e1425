"""The calibrations of Metashape's sensors.

cx, cy on disk count from the middle of the photo. Its p1, p2 are swapped against OpenCV's: Metashape's manual has
x' = x (1 + ...) + p1 (r^2 + 2 x^2) + 2 p2 x y, where OpenCV's p2 has the first.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from room2dgs.captures.known_keys import unknown_keys
from room2dgs.captures.lens import Lens
from room2dgs.captures.text_files import floats
from room2dgs.errors import InputError
from room2dgs.texts import shown

NUMBERS = (
    "f", "fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4", "p1", "p2", "p3", "p4", "b1", "b2", "skew",
)  # fmt: skip
OTHERWISE = ("resolution", "date", "rolling_shutter", "covariance", "meta", "software", "unit", "width", "height")
FISHEYES = ("fisheye", "equidistant_fisheye")
MAX_SKEW = 1.0  # pixels


def sensor_lens(sensor: ElementTree.Element, path: Path, warn: Callable[[str], None]) -> Lens | None:
    """The adjusted calibration of a sensor, wherever it stands; the initial one where there is no other.

    Args:
        warn: takes what a person should know.

    Returns:
        None without a calibration.

    Raises:
        InputError: a kind of camera that is not read, or numbers that are none.
    """
    name = shown(sensor.get("label") or sensor.get("id") or "?", 60)
    calibration = _chosen(sensor, f"{path} (sensor {name})", warn)
    if calibration is None:
        return None
    resolution = calibration.find("resolution")
    resolution = sensor.find("resolution") if resolution is None else resolution
    if resolution is None:
        return None
    kind = sensor.get("type") or calibration.get("type") or "frame"
    if kind != "frame" and kind not in FISHEYES:
        raise InputError(f"{path} has a sensor of type {shown(kind, 40)!r}, which is not read; undistort the photos")
    width, height = (xml_number(resolution.get(key), f"{path} (resolution)") for key in ("width", "height"))
    known = {key: xml_number(calibration.findtext(key, "0"), f"{path} ({key})") for key in NUMBERS}
    unknown = unknown_keys((child.tag for child in calibration), (*NUMBERS, *OTHERWISE), f"{path} (sensor {name})")
    if unknown:
        warn(unknown)
    _check_read(known, path, warn)
    if known["fx"] and not known["f"]:  # PhotoScan's first files: the principal point counts from the corner
        params = (known["fx"], known["fy"] or known["fx"], known["cx"], known["cy"])
    else:
        f = known["f"] or known["fy"]
        params = (f + known["b1"], f, known["cx"] + width / 2, known["cy"] + height / 2)
    k = [known[f"k{i}"] for i in (1, 2, 3, 4)]
    p = known["p2"], known["p1"]
    size = int(width), int(height)
    if kind in FISHEYES:
        if any(p):
            lens = Lens("THIN_PRISM_FISHEYE", (*params, k[0], k[1], *p, k[2], k[3], 0.0, 0.0), size, str(path))
        else:
            lens = Lens("OPENCV_FISHEYE", (*params, *k), size, str(path))
    elif k[3]:
        raise InputError(f"{path} has a lens with k4, which is not read; undistort the photos")
    else:
        lens = Lens("FULL_OPENCV", (*params, k[0], k[1], *p, k[2], 0.0, 0.0, 0.0), size, str(path))
    lens.check()
    return lens


def _chosen(sensor: ElementTree.Element, label: str, warn: Callable[[str], None]) -> ElementTree.Element | None:
    found = sensor.findall("calibration")
    if not found:
        return None
    adjusted = [one for one in found if one.get("class") == "adjusted"]
    if not adjusted:
        others = [one for one in found if one.get("class") != "initial"]
        if not others:
            warn(f"{label} has the initial calibration alone, which is taken; export the cameras after aligning them")
        return (others or found)[-1]
    focal = [one.findtext("f") or one.findtext("fx") or "none" for one in adjusted]
    if len({tuple((child.tag, child.text) for child in one) for one in adjusted}) > 1:
        warn(f"{label} has {len(adjusted)} adjusted calibrations (f={shown(', '.join(focal), 80)}); the last is taken")
    return adjusted[-1]


def _check_read(known: dict[str, float], path: Path, warn: Callable[[str], None]) -> None:
    skew = known["b2"] or known["skew"]
    if abs(skew) > MAX_SKEW:
        raise InputError(f"{path} has skewed pixels (b2={skew}), which is not read; undistort the photos")
    if skew:
        warn(f"{path} has pixels that are skewed by {skew:g} px (b2) from edge to middle, which is not used")
    if known["p3"] or known["p4"]:
        raise InputError(f"{path} has a lens with p3 or p4, which is not read; undistort the photos")


def xml_number(text: str | None, label: str) -> float:
    """A finite number of an element's text or an attribute.

    Raises:
        InputError: it is none.
    """
    found = floats(text or "", label, None, 1)[0]
    if not np.isfinite(found):
        raise InputError(f"{label} is not finite; export the cameras again")
    return found
