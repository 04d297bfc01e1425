"""Checks all photos and masks of a scene before any work: broken ones are left out, and what masks hide is reported."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

from room2dgs.captures.assemble import MIN_VIEWS
from room2dgs.captures.capture_points import CapturePoints
from room2dgs.captures.hidden import hidden_notes, hidden_of
from room2dgs.captures.left_out import left_out
from room2dgs.captures.mask_images import MaskFacts, MaskImage, alpha_of, facts_of
from room2dgs.captures.scene import Dropped, Frame, Scene
from room2dgs.errors import InputError
from room2dgs.parallel_map import parallel_map


class _FileCheck(NamedTuple):
    """Into one view's files: why they cannot be used, or what the photo's alpha is, if it hides anything."""

    error: str | None = None
    alpha: MaskFacts | None = None


def checked(scene: Scene) -> Scene:
    """The scene without views whose photo or mask cannot be decoded; notes and warnings tell what masks hide.

    Raises:
        InputError: there are too many of these, or masks hide everything.
    """
    frames = scene.frames
    checks = dict(zip((frame.name for frame in frames), parallel_map(_check_files, frames), strict=True))
    masks = next((frame.masks for frame in frames if frame.masks is not None), None)
    for frame in frames if masks is not None else ():
        facts = masks.facts().get(frame.mask_photo) if masks and frame.mask_photo is not None else None
        if isinstance(facts, InputError) and checks[frame.name].error is None:
            checks[frame.name] = _FileCheck(str(facts))
    bad = {name: check.error for name, check in checks.items() if check.error is not None}
    message = left_out(bad, len(frames), "photos that cannot be used")
    scene = _with_checks(scene, checks, bad)
    if bad and len(scene.train) < MIN_VIEWS:
        raise InputError(next(iter(bad.values())))
    hidden = {frame.name: found for frame in scene.frames if (found := hidden_of(frame, checks[frame.name].alpha))}
    notes, warnings = hidden_notes(scene, hidden)
    warnings = [*([message] if message else []), *warnings]
    return replace(scene, notes=(*scene.notes, *notes), warnings=(*scene.warnings, *warnings))


def _check_files(frame: Frame) -> _FileCheck:
    try:
        if frame.cache is not None and frame.cache.has_room(3 * frame.camera.width * frame.camera.height):
            frame.color()
        elif not frame.transparent:
            frame.source.check()
        alpha = alpha_of(frame.source) if frame.transparent else None
    except InputError as error:
        return _FileCheck(str(error))
    return _FileCheck(alpha=None if alpha is None else facts_of(MaskImage(alpha, None)))


def _with_checks(scene: Scene, checks: Mapping[str, _FileCheck], bad: Mapping[str, str]) -> Scene:
    """Without the bad ones; photos whose alpha hides nothing count as opaque."""

    def seen(frame: Frame) -> Frame:
        opaque = frame.transparent and checks[frame.name].alpha is None
        return replace(frame, transparent=False) if opaque else frame

    train, test = (tuple(seen(one) for one in part if one.name not in bad) for part in (scene.train, scene.test))
    points = scene.given_points
    if isinstance(points, CapturePoints):
        points = points.of(train)
    dropped = (*scene.dropped, *(Dropped(name, why) for name, why in bad.items()))
    return replace(scene, train=train, test=test, dropped=dropped, given_points=points)
