"""Gives a scene of pinhole photos the distorted lens, or the focal length, that was estimated for them."""

from __future__ import annotations

from dataclasses import replace

from room2dgs.captures.lens import Lens, pinhole_of
from room2dgs.captures.scene import Frame, Scene
from room2dgs.geometry.camera import Camera


def with_lens(scene: Scene, lens: Lens) -> Scene:
    """The scene, its photos straightened on reading, and cameras of what is left of them; poses stay.

    Points that came with the capture no longer fit and are gone.

    Args:
        scene: photos without a lens, all of one shape.
        lens: at a size of that shape.

    Raises:
        InputError: a photo cannot be read, or the lens is none or leaves nothing of it.
    """
    lens.check()

    def straight(frame: Frame) -> Frame:
        full = frame.full_size()
        whole = lens.scaled_to(full)
        K, size, *_ = pinhole_of(whole)
        camera = Camera(K, *size, frame.camera.cam_from_world)
        small = frame.camera.width / full[0]
        if small < 1:
            camera = camera.resized(*(max(1, round(side * small)) for side in size))
        return replace(frame, camera=camera, lens=whole)

    train, test = (tuple(straight(frame) for frame in frames) for frames in (scene.train, scene.test))
    return replace(scene, train=train, test=test, given_points=None)


def with_focal(scene: Scene, factor: float) -> Scene:
    """The scene, all cameras with focal lengths `factor` times as long; photos, depth maps and poses stay.

    Points that came with the capture no longer fit and are gone.
    """

    def zoomed(frame: Frame) -> Frame:
        depth = frame.depth_map and replace(frame.depth_map, zoom=factor * frame.depth_map.zoom)
        return replace(frame, camera=frame.camera.zoomed(factor), depth_map=depth)

    train, test = (tuple(zoomed(frame) for frame in frames) for frames in (scene.train, scene.test))
    return replace(scene, train=train, test=test, given_points=None)
