"""Inference of a network that sees several photos of one room at a time, with their poses and intrinsics."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from room2dgs.config.card import Card, CardViews
from room2dgs.depth.network.card import card_format
from room2dgs.depth.network.fit import Fit, fitted, input_intrinsics, network_input
from room2dgs.depth.network.flip import Prediction
from room2dgs.depth.network.network import decoded, input_fit, shaped
from room2dgs.depth.network.session import FLOATS, Network, described, session_of, shape_in_words
from room2dgs.depth.network.windows import window_poses
from room2dgs.errors import InputError, first_line
from room2dgs.geometry.camera import Camera

LEAST_CONFIDENCE = 1e-6


class MultiviewNetwork(NamedTuple):
    """An open network.

    Attributes:
        network: its session, and how one photo of a window goes in and comes out.
        views: what the card says of windows.
        photos: how many a window has.
        confident: its expected error is a confidence, the larger the surer.
    """

    network: Network
    views: CardViews
    photos: int
    confident: bool


def open_multiview(path: Path, card: Card, threads: int | None, provider: str) -> MultiviewNetwork:
    """Load a network and check that its card names what it has.

    A file is traced with a number of photos and gives wrong numbers, without a word, for any other.

    Args:
        path: the .onnx file.
        card: with `views` and `depth`.
        threads, provider: as `open_network`.

    Raises:
        InputError: it cannot be loaded, a named input or output is not there, or the number of photos is not known
            or is not the file's.
    """
    views, depth = card.views, card.depth
    assert views is not None and depth is not None
    session = session_of(path, threads, provider)
    has = described(session)
    inputs = {arg.name: arg for arg in session.get_inputs()}
    outputs = [arg.name for arg in session.get_outputs()]
    settings = replace(card_format(card, "depth"), error_output=depth.error or depth.confidence)
    extra = {"views.poses": views.poses, "input.intrinsics": card.input.intrinsics}
    taken = {key: name for key, name in extra.items() if name}
    for key, name in taken.items():
        _check_named(key, name, inputs, path, has)
    made = {"depth.output": depth.output, "depth.mask": depth.mask, "depth.error": depth.error}
    for key, asked in (made | {"depth.confidence": depth.confidence}).items():
        if asked:
            _check_named(key, asked, outputs, path, has)
    image = inputs[_photos_input(card, [name for name in inputs if name not in taken.values()], path, has)]
    named = [name for name in (settings.mask, settings.error_output) if name]
    output = depth.output or _only([name for name in outputs if name not in named], path, has)
    _check_photos(image, settings.layout, path, has)
    shapes = [image.shape[-4], *(inputs[name].shape[-3] for name in taken.values() if len(inputs[name].shape) >= 3)]
    count = _count([side for side in shapes if isinstance(side, int)], views.count, path, has)
    network = Network(path, "depth", settings, session, image, (output, *named))
    return MultiviewNetwork(network, views, count, depth.confidence is not None)


def window_maps(net: MultiviewNetwork, photos: Sequence[np.ndarray], cameras: Sequence[Camera]) -> list[Prediction]:
    """Maps of a window's photos, at the size at which the network gives them.

    Args:
        photos: `count` photos, (H, W, 3) uint8 RGB each; the first is the reference.
        cameras: of the photos' sizes.

    Returns:
        For each photo, or for the first alone if `views.answers` says so. Depth is as the network means it; the error
        is of ln depth or, where the network gives a confidence, its inverse, which only ranks pixels.

    Raises:
        InputError: the network cannot run, or gives something that is no such map.
    """
    network, settings = net.network, net.network.settings
    size = input_fit(network, cameras[0])
    fits = [size, *(_fit_beside(size, camera, settings.fit) for camera in cameras[1:])]
    images = np.concatenate([network_input(photo, fit, settings) for photo, fit in zip(photos, fits, strict=True)])
    feeds = {network.image.name: shaped(images, network.image, network)}
    inputs = {arg.name: arg for arg in network.session.get_inputs()}
    if settings.intrinsics:
        K = np.stack([input_intrinsics(camera, fit) for camera, fit in zip(cameras, fits, strict=True)])
        feeds[settings.intrinsics] = shaped(K, inputs[settings.intrinsics], network)
    if net.views.poses:
        arg = inputs[net.views.poses]
        poses = window_poses(cameras, net.views)
        feeds[arg.name] = shaped(poses[:, :3] if arg.shape[-2] == 3 else poses, arg, network)
    names = list(network.outputs)
    try:
        results = network.session.run(names, feeds)
    except Exception as error:  # onnxruntime has a dozen kinds, all plain exceptions
        raise InputError(
            f"{network.path} cannot run on {net.photos} photos of {size.width}x{size.height} ({first_line(error)}); it "
            f"has {described(network.session)}"
        ) from error
    answers = net.photos if net.views.answers == "all" else 1
    by_name = {name: _by_view(result, answers, name, network) for name, result in zip(names, results, strict=True)}
    found = [
        decoded(network, {name: values[view] for name, values in by_name.items()}, fits[view], cameras[view])
        for view in range(answers)
    ]
    return [_doubting(one) for one in found] if net.confident else found


def _doubting(found: Prediction) -> Prediction:
    """With the inverse of the confidence in place of an error."""
    assert found.error is not None
    return found._replace(error=(1.0 / np.maximum(found.error, LEAST_CONFIDENCE)).astype(np.float32))


def _check_named(key: str, name: str, there: Any, path: Path, has: str) -> None:
    if name not in there:
        raise InputError(f"{key}={name} in the card is not in {path}; it has {has}")


def _photos_input(card: Card, names: Sequence[str], path: Path, has: str) -> str:
    """The input for the photos, which is the only one that the card says nothing else of."""
    if card.input.name and card.input.name not in names:
        raise InputError(f"input.name={card.input.name} in the card is not in {path}; it has {has}")
    if len(names) != 1:
        raise InputError(
            f"{path} takes {', '.join(names) or 'no photos'}: name what is not the photos as input.intrinsics or "
            f"views.poses in its card, or export it without; it has {has}"
        )
    return names[0]


def _only(names: Sequence[str], path: Path, has: str) -> str:
    if len(names) != 1:
        raise InputError(f"{path} needs depth.output=NAME in its card; it has {has}")
    return names[0]


def _check_photos(image: Any, layout: str, path: Path, has: str) -> None:
    """Four axes, or five with a batch of one in front: photos, and those of a photo in the layout's order."""
    if image.type not in FLOATS:
        raise InputError(f"{path} takes no photos of floating-point numbers as {image.name}; it has {has}")
    if len(image.shape) not in (4, 5):
        raise InputError(
            f"{path} takes no photos as {image.name} {shape_in_words(image)}: that would be (1, photos, 3, height, "
            f"width) or (photos, 3, height, width); it has {has}"
        )
    if len(image.shape) == 5 and isinstance(image.shape[0], int) and image.shape[0] != 1:
        raise InputError(f"{path} takes {image.shape[0]} windows at a time; export it for one: it has {has}")
    channels = image.shape[-3] if layout == "nchw" else image.shape[-1]
    if isinstance(channels, int) and channels != 3:
        raise InputError(
            f"{path} has no three channels where input.layout={layout} in its card expects them; it has {has}"
        )


def _count(fixed: Sequence[int], wanted: int | None, path: Path, has: str) -> int:
    """Photos of a window: the file's number, which no card can change."""
    if len(set(fixed)) > 1:
        raise InputError(f"{path} does not take as many poses or intrinsics as photos; export it again: it has {has}")
    if fixed and wanted not in (None, fixed[0]):
        raise InputError(
            f"{path} was exported for {fixed[0]} photos at a time and gives wrong numbers for views.count={wanted}; "
            "leave that out of its card, or export it for as many"
        )
    if not fixed and wanted is None:
        raise InputError(
            f"{path} takes any number of photos, but gives wrong numbers for another one than it was traced with; give "
            "that as views.count in its card"
        )
    count = fixed[0] if fixed else wanted
    assert count is not None
    if count < 2:
        raise InputError(f"{path} sees one photo at a time; give prior/depth=onnx and a card without views")
    return count


def _fit_beside(size: Fit, camera: Camera, how: str) -> Fit:
    """Where a photo lies in an input whose size another one has decided."""
    fit = fitted(camera, size.height, size.width, "stretch" if how == "stretch" else "pad")
    almost = abs(fit.inner_height - size.height) <= 1 and abs(fit.inner_width - size.width) <= 1
    return size if how == "cover" and almost else fit


def _by_view(result: np.ndarray, count: int, name: str, network: Network) -> np.ndarray:
    """An output with the photos first."""
    values = np.asarray(result)
    while values.ndim > 3 and values.shape[0] == 1:
        values = values[0]
    if count == 1:
        return values[None]
    if values.ndim < 3 or values.shape[0] != count:
        raise InputError(
            f"{network.path} gives {name} as {np.shape(result)}, no maps of {count} photos; if it is of the first "
            'alone, say "answers": "first" in the card\'s views'
        )
    return values
