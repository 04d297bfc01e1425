"""COLMAP: images/ and a sparse model (cameras, images, points3D; binary or text).

Poses are world-to-camera with OpenCV axes, cx, cy count pixel centres at +0.5. Scale and orientation are what made the
model; by itself it has no metres. Its points become the seeds.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path, PurePosixPath

from room2dgs.captures.capture import W2C_OPENCV, Capture, Shot
from room2dgs.captures.colmap_model import Model, ModelImage, is_model, read_model
from room2dgs.captures.depth_maps import depth_file
from room2dgs.captures.listing import Listing, gt_mesh_in, inside, listed, natural
from room2dgs.captures.photos import PhotoFile
from room2dgs.captures.text_files import read_json_object
from room2dgs.config import SceneConfig
from room2dgs.errors import InputError

LAYOUT = "images/ and sparse/0/{cameras,images,points3D}.{bin,txt}"
MODELS = ("sparse/0", "sparse", ".", "colmap/sparse/0", "colmap/sparse", "colmap", "colmap/0")
PREPARED = "prepare.json"
PHOTOS = ("images", "rgb", "color", "input", ".")


def is_colmap(files: Listing) -> bool:
    """A model in one of the usual places."""
    places = ("" if place == "." else f"{place}/" for place in MODELS)
    return any(f"{place}cameras{end}" in files for place in places for end in (".bin", ".txt"))


def read_colmap(root: Path, config: SceneConfig) -> Capture:
    """Read a COLMAP project.

    Raises:
        InputError: see `room2dgs.captures.read.read_scene`.
    """
    found = [root / place for place in MODELS if is_model(root / place)]
    if not found:
        raise InputError(f"{root} has no COLMAP model; it has {LAYOUT}")
    folder = found[0]
    notes = _other_models(folder)
    model = read_model(folder)
    tops = [root, *folder.parents] if folder != root else [root, root.parent, root.parent.parent]
    photos = photo_folder(model, [top / name for top in tops if is_below(top, root) for name in PHOTOS])
    prepared = prepared_scale(root)
    beside = [root] if photos == root else [photos.parent, root]
    places = [place / name for place in beside for name in ("masks", "mask")]
    masks = next((place for place in places if place.is_dir()), None)
    return Capture(
        root,
        "colmap",
        model_shots(model, photos, masks, depths=root / "depth" if prepared else None),
        W2C_OPENCV,
        metric=prepared is not None,
        why=prepared or "COLMAP gives none",
        points=model.points if model.has_points else None,
        gt_mesh=gt_mesh_in(root),
        notes=notes,
        warnings=_warnings(root),
    )


def _warnings(root: Path) -> list[str]:
    """What `room2dgs prepare` doubts of the capture."""
    path = root / PREPARED
    said = read_json_object(path).get("warnings") if path.is_file() else None
    return [line for line in said if isinstance(line, str)] if isinstance(said, list) else []


def prepared_scale(root: Path) -> str | None:
    """Why a capture that `room2dgs prepare` made is in metres; None: it is none, or its scale is unknown."""
    path = root / PREPARED
    if not path.is_file():
        return None
    verdict = read_json_object(path)
    scale = verdict.get("scale")
    if verdict.get("metric") is not True or not isinstance(scale, dict):
        return None
    sigma = scale.get("sigma")
    sure = f", +-{sigma:.0%}" if isinstance(sigma, float) else ""
    return f"{PREPARED}: by {str(scale.get('source'))[:40]}{sure}"


def is_below(top: Path, root: Path) -> bool:
    """The capture's folder, what is in it, and the two above it, where a model's folder itself was given."""
    return top.is_relative_to(root) or top in (root.parent, root.parent.parent)


def model_shots(
    model: Model,
    photos: Path,
    masks: Path | None,
    names: dict[str, str] | None = None,
    depths: Path | None = None,
) -> list[Shot]:
    """The images of a model, in natural order of their names.

    Args:
        photos, masks: folders; None: no masks.
        names: of the files, by the model's names; None: the same.
        depths: a folder of depth maps in millimetres (.npy: metres), named as the photos; None: there is none.
    """
    images = {image.name: image for image in model.images}
    shots = [_shot(images[name], model, photos, masks, names) for name in natural(images)]
    if depths is None:
        return shots
    files = {Path(name).stem: depths / name for name in natural(listed(depths))}
    return [
        replace(shot, depth=depth_file(path, 1.0 if path.suffix == ".npy" else 0.001))
        if (path := files.get(shot.path.stem))
        else shot
        for shot in shots
    ]


def photo_folder(model: Model, places: list[Path]) -> Path:
    """The first of some folders that holds the model's first photo.

    Raises:
        InputError: none does.
    """
    if not model.images:
        raise InputError(f"{model.folder} has no images; run the mapping again")
    name = model.images[0].name
    for place in places:
        if inside(place, name, model.folder).is_file():
            return place
    tried = ", ".join(dict.fromkeys(str(place) for place in places[:3]))
    raise InputError(f"{model.folder} names the photo {name}, which is not in {tried}; put the photos into images/")


def _shot(image: ModelImage, model: Model, photos: Path, masks: Path | None, names: dict[str, str] | None) -> Shot:
    name = names[image.name] if names else image.name
    mask = mask_file(masks, name) if masks else None
    return Shot(
        image.name,
        inside(photos, name, model.folder),
        image.cam_from_world,
        model.cameras[image.camera],
        mask=PhotoFile(mask) if mask else None,
    )


def mask_file(folder: Path, name: str) -> Path | None:
    """A photo's mask: <name>.png with the photo's suffix before it (COLMAP) or without (nerfstudio)."""
    path = PurePosixPath(name)
    for text in (f"{name}.png", str(path.with_suffix(".png"))):
        file = inside(folder, text, folder)
        if file.is_file():
            return file
    return None


def _other_models(folder: Path) -> list[str]:
    """A mapping that fell apart left several models; the one that is read is named."""
    others = [name for name in natural(listed(folder.parent)) if name.isdigit() and name != folder.name]
    others = [name for name in others if is_model(folder.parent / name)] if folder.name.isdigit() else []
    if not others:
        return []
    return [f"models: {folder} is read, {', '.join(others)} beside it are not; give scene.path of another to read that"]
