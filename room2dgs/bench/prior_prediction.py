"""What a configured prior says of one photo, at the photo's size, before any use of it; with the network's time."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from room2dgs.captures.scene import Frame
from room2dgs.config import PriorConfig
from room2dgs.depth.files import find_map, read_depth, read_normal
from room2dgs.depth.network.card import format_of
from room2dgs.depth.network.flip import Prediction as RawMap
from room2dgs.depth.network.maps import KINDS, at_camera, read_models
from room2dgs.depth.network.network import predictions, same_input
from room2dgs.depth.network.session import Network, open_network
from room2dgs.depth.normals.convention import camera_normals
from room2dgs.errors import InputError
from room2dgs.geometry.camera import Camera


@dataclass
class Prediction:
    """Maps at the camera's size; None where the prior has no such map.

    Attributes:
        depth: (H, W) float32 as the prior means it (metres, relative depth or disparity), 0 = invalid.
        depth_error: (H, W) float32 expected |error of ln depth|.
        normal: (H, W, 3) float32 unit, camera frame, OpenCV axes, facing the camera; 0 = invalid.
        normal_error: (H, W) float32 expected angle in radians.
        network_ms: "depth", "normal" or, where one run gives both, "depth + normal" -> milliseconds of the network
            alone.
    """

    depth: np.ndarray | None = None
    depth_error: np.ndarray | None = None
    normal: np.ndarray | None = None
    normal_error: np.ndarray | None = None
    network_ms: dict[str, float] = field(default_factory=dict)


class TimedSession:
    """An onnxruntime session that notes how long its runs take."""

    def __init__(self, session: Any) -> None:
        self._session = session
        self.seconds = 0.0

    def __getattr__(self, name: str) -> Any:
        return getattr(self._session, name)

    def run(self, *args: Any) -> list[Any]:
        """As the session's own."""
        start = time.perf_counter()
        results = self._session.run(*args)
        self.seconds += time.perf_counter() - start
        return results


def open_networks(config: PriorConfig) -> list[list[Network]]:
    """The configured networks, those together that one run of a model serves; each session is a `TimedSession`.

    Raises:
        InputError: neither depth nor normals are configured, depth is the truth itself or of a network that sees
            several photos at a time, or as `read_models` and `open_network`.
    """
    if all(getattr(config, kind).source == "none" for kind in KINDS):
        raise InputError("no prior is configured, there is nothing to measure; give for example prior=room_prior")
    if config.depth.source in ("sensor", "auto"):
        raise InputError(
            f"prior.depth.source={config.depth.source} would be measured against itself: the truth is the capture's "
            "own depth; give another prior/depth"
        )
    if config.depth.source == "onnx_multiview":
        raise InputError(
            "prior.depth.source=onnx_multiview sees several photos at a time, and single ones are measured here; "
            "`room2dgs eval` measures what a run makes of it"
        )
    groups: list[list[Network]] = []
    digests: list[str] = []
    for kind, model in read_models(config).items():
        settings = format_of(getattr(config, kind), kind)
        same = bool(groups) and digests[-1] == model.digest and same_input(groups[-1][0].settings, settings)
        session = groups[-1][0].session if same else None
        network = open_network(model.path, kind, settings, config.threads, config.provider, session)
        if same:
            groups[-1].append(network)
        else:
            groups.append([network._replace(session=TimedSession(network.session))])
        digests.append(model.digest)
    return groups


def prediction(
    photo: np.ndarray,
    photo_camera: Camera,
    camera: Camera,
    frame: Frame | None,
    groups: Sequence[Sequence[Network]],
    config: PriorConfig,
) -> Prediction | None:
    """What the prior says of one photo.

    Args:
        photo: (H, W, 3) uint8 RGB at its full size.
        photo_camera: of that size.
        camera: the same view at the size of the maps that are wanted.
        frame: whose files to read where maps come from files; None: there are none.
        groups: what `open_networks` gives.

    Returns:
        None if the prior has no map for this photo (a file is missing).

    Raises:
        InputError: as `predictions`, `read_depth` and `read_normal`.
    """
    found = Prediction()
    for networks in groups:
        networks[0].session.seconds = 0.0
        for network, raw in zip(networks, predictions(networks, photo, photo_camera), strict=True):
            _take(found, network.kind, raw, camera)
        found.network_ms[" + ".join(network.kind for network in networks)] = 1000.0 * networks[0].session.seconds
    for kind in KINDS:
        on_disk = _on_disk(frame, kind, config, camera) if frame and getattr(config, kind).source == "files" else None
        if on_disk is not None:
            _take(found, kind, on_disk, camera)
    if found.normal is not None:
        found.normal = camera_normals(found.normal, config.normal, camera).astype(np.float32)
    return None if found.depth is None and found.normal is None else found


def _take(found: Prediction, kind: str, raw: RawMap, camera: Camera) -> None:
    """One map into the prediction, at the camera's size."""
    values, valid, error = at_camera(raw, camera)
    setattr(found, kind, values if kind == "normal" else np.where(valid, values, 0.0).astype(np.float32))
    if error is not None:
        setattr(found, f"{kind}_error", error)


def _on_disk(frame: Frame, kind: str, config: PriorConfig, camera: Camera) -> RawMap | None:
    path = find_map(Path(getattr(config, kind).path or ""), frame)
    if path is None:
        return None
    read = read_normal(path, config.normal, camera) if kind == "normal" else read_depth(path, config.depth, camera)
    return RawMap(*read, None)
