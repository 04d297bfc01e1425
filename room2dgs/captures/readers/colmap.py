"""COLMAP: images/ and a sparse model (cameras, images, points3D; binary or text).

Poses are world-to-camera with OpenCV axes, cx, cy count pixel centres at +0.5. Scale and orientation are what made the
model; by itself it has no metres. Its points become the seeds.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path, PurePosixPath

from room2dgs.captures.capture import W2C_OPENCV, Capture, Shot
from room2dgs.captures.colmap_model import Model, ModelImage, count_in_text, is_binary, is_model, read_model
from room2dgs.captures.depth_maps import depth_file
from room2dgs.captures.listing import PHOTO_SUFFIXES, Listing, gt_mesh_in, inside, listed, natural
from room2dgs.captures.mask_files import fitting_masks, mask_files, mask_folders
from room2dgs.captures.photo_names import in_folder, shared_stems
from room2dgs.captures.photos import PhotoFile
from room2dgs.captures.reader import Reader
from room2dgs.captures.text_files import read_json_object
from room2dgs.captures.unmatched import called_map
from room2dgs.config import SceneConfig
from room2dgs.errors import InputError
from room2dgs.regular_files import how, written_otherwise

LAYOUT = "images/ and sparse/0/{cameras,images,points3D}.{bin,txt}"
# Where models lie; a place may hold one, or several in folders called by numbers.
PLACES = ("sparse", ".", "colmap/sparse", "colmap")
PREPARED = "prepare.json"
# the later ones are smaller copies, which stand in for the photos; their intrinsics are scaled
PHOTOS = ("images", "rgb", "color", "input", ".", "images_2", "images_4", "images_8")
DEPTHS = ("depth", "depths", "depth_maps")
SAMPLED = 100  # photos that are looked for in each folder
FEW_POSED = 0.5  # of the photos; fewer poses are warned of


def is_colmap(files: Listing) -> bool:
    """A model in one of the usual places."""
    if files.root.is_file():
        return False
    return any(
        {"cameras.bin", "cameras.txt"} & listed(folder) for place in PLACES for folder in _folders(files.root, place)
    )


def read_colmap(root: Path, config: SceneConfig) -> Capture:
    """Read a COLMAP project.

    Raises:
        InputError: see `room2dgs.captures.read.read_scene`.
    """
    model, photos, notes = _model(root)
    warnings = [*_warnings(root), *model.warnings]
    notes += [*_two_forms(model), *_no_points(model)]
    names = [image.name for image in model.images]
    prepared = prepared_scale(root)
    beside = [root] if photos == root else [photos.parent, root, photos]
    folders = mask_folders(dict.fromkeys(beside))
    masks, found = fitting_masks([folder for folder in folders if folder != photos], names)
    if masks is not None and len(folders) > 1:
        others = ", ".join(folder.name for folder in folders if folder != masks)
        notes.append(f"masks: {masks} is used for {len(found)} of {len(names)} photos, {others} beside it not")
    depths = next((root / name for name in DEPTHS if natural(listed(root / name))), None)
    if depths is not None and not prepared:
        notes.append(
            f"{depths} has {len(listed(depths))} files and is not read: a COLMAP model does not tell their unit; "
            f"prior/depth=files prior.depth.path={depths} takes maps that are called as the photos"
        )
    if not (root / PREPARED).is_file():
        message, few = _posed(model, photos)
        (warnings if few else notes).extend(message)
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
        warnings=warnings,
    )


def _folders(root: Path, place: str) -> list[Path]:
    """A place and the folders in it that are called by numbers, in the order in which models are looked for."""
    folder = root / place
    numbered = [folder / name for name in natural(listed(folder)) if name.isdecimal()]
    return [*numbered, folder] if place.endswith("sparse") else [folder, *numbered]


def _model(root: Path) -> tuple[Model, Path, list[str]]:
    """Of several models in one place the one with poses of most photos that are there, the photos' folder, and notes.

    Raises:
        InputError: there is none, or none can be read.
    """
    found: list[Path] = []
    for place in PLACES:
        found = found or [folder for folder in _folders(root, place) if is_model(folder)]
    if not found:
        raise _no_model(root)
    read: list[tuple[Model, Path, int]] = []
    failed: dict[Path, InputError] = {}
    for folder in found:
        try:
            model = read_model(folder)
            photos = photo_folder(model, photo_places(root, folder))
        except InputError as error:
            failed[folder] = error
            continue
        count = len(model.images) if len(found) == 1 else _there(model, photos)
        read.append((model, photos, count))
    if not read:
        raise next(iter(failed.values()))
    model, photos, count = max(read, key=lambda one: one[2])  # the first of several
    if len(found) == 1:
        return model, photos, []
    others = [f"{other.folder.name} ({number})" for other, _, number in read if other is not model]
    others += [f"{folder.name} (it cannot be read: {error})" for folder, error in failed.items()]
    message = (
        f"models: {model.folder} is read, with poses of {count} photos that are there; {', '.join(others)} beside it"
    )
    return model, photos, [f"{message} not; give scene.path of another to read that"]


def _no_model(root: Path) -> InputError:
    for place in PLACES:
        for folder in _folders(root, place):
            for end in (".bin", ".txt"):
                if (folder / f"cameras{end}").is_file():
                    return InputError(f"{folder} has cameras{end} and no images{end}; export the whole model again")
    return InputError(f"{root} has no COLMAP model; it has {LAYOUT}")


def photo_places(root: Path, folder: Path) -> list[Path]:
    """Where the photos of the model in a folder may lie."""
    tops = [root, *folder.parents] if folder != root else [root, root.parent, root.parent.parent]
    return [top / name for top in tops if is_below(top, root) for name in PHOTOS]


def _there(model: Model, photos: Path) -> int:
    return sum(inside(photos, image.name, model.folder).is_file() for image in model.images)


def _two_forms(model: Model) -> list[str]:
    """A word where a binary model and a text one lie in one folder and differ."""
    count = count_in_text(model.folder) if is_binary(model.folder) else None
    if count is None or count == len(model.images):
        return []
    return [
        f"{model.folder} has a binary model of {len(model.images)} images, which is read, and one as text of {count}, "
        "which is not; delete the one that is out of date"
    ]


def _no_points(model: Model) -> list[str]:
    """A word where the model has no points."""
    if model.has_points:
        return []
    ply = model.folder / "points3D.ply"
    other = f"; points.source=file points.file={ply} takes those of the PLY beside it" if ply.is_file() else ""
    return [f"{model.folder} has no points (points3D.bin or .txt), so that photos are matched for them{other}"]


def _posed(model: Model, photos: Path) -> tuple[list[str], bool]:
    """A word where the model has poses of some of the photos alone, and whether they are few."""
    named = {image.name.replace("\\", "/") for image in model.images}
    there = {name for name in in_folder(photos) if name.lower().endswith(PHOTO_SUFFIXES)}
    there = {name for name in there if name in named or not called_map(name)}
    if photos.name not in PHOTOS:  # it has other things, too
        alike = {_kind(name) for name in named}
        there = {name for name in there if _kind(name) in alike}
    posed = len(named & there)
    if posed >= len(there):
        return [], False
    message = f"{model.folder} has poses of {posed} of the {len(there)} photos in {photos}; the others are not used"
    if posed >= FEW_POSED * len(there):
        return [message], False
    return [f"{message}; map them again (room2dgs prepare), or give scene.path of another model"], True


def _kind(name: str) -> tuple[str, str]:
    """By which photos of a capture are alike: folder and suffix."""
    path = PurePosixPath(name)
    return str(path.parent), path.suffix.lower()


def _warnings(root: Path) -> list[str]:
    """What `room2dgs prepare` doubts of the capture."""
    path = root / PREPARED
    message = read_json_object(path).get("warnings") if path.is_file() else None
    return [line for line in message if isinstance(line, str)] if isinstance(message, list) else []


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
    order = natural(images)
    files = {name: names[name] if names else name for name in order}
    found = mask_files(masks, list(files.values())) if masks else {}
    shots = [_shot(images[name], model, photos, files[name], found.get(files[name])) for name in order]
    if depths is None:
        return shots
    shared = shared_stems(shot.path for shot in shots)
    maps = {Path(name).stem: depths / name for name in natural(listed(depths))}
    return [
        replace(shot, depth=depth_file(path, 1.0 if path.suffix == ".npy" else 0.001))
        if shot.path.stem not in shared and (path := maps.get(shot.path.stem))
        else shot
        for shot in shots
    ]


def photo_folder(model: Model, places: list[Path]) -> Path:
    """The folder that holds most of a model's photos, the first of several.

    Raises:
        InputError: none holds any.
    """
    if not model.images:
        raise InputError(f"{model.folder} has no images; run the mapping again")
    names = [image.name for image in model.images]
    some = names[:: max(1, len(names) // SAMPLED)]
    counts = {place: _count(place, some, model) for place in dict.fromkeys(places)}
    best = max(counts, key=lambda place: counts[place])
    if not counts[best]:
        best = max(counts, key=lambda place: _count(place, names, model))
        if not _count(best, names, model):
            raise _no_photos(model, names[0], list(counts))
    return best


def _count(place: Path, names: list[str], model: Model) -> int:
    return sum(inside(place, name, model.folder).is_file() for name in names) if place.is_dir() else 0


def _no_photos(model: Model, name: str, places: list[Path]) -> InputError:
    message = f"{model.folder} names the photo {name}, which is not in"
    for place in places:
        path = inside(place, name, model.folder)
        while not path.parent.exists():
            path = path.parent
        alike = None if path.exists() else written_otherwise(path)
        if alike:
            return InputError(
                f"{message} {place}; {alike} is there, which {how(path.name, alike)}: rename it to {path.name}"
            )
    tried = ", ".join(str(place) for place in places[:3])
    return InputError(f"{message} {tried}; put the photos into images/")


def _shot(image: ModelImage, model: Model, photos: Path, name: str, mask: Path | None) -> Shot:
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


READER = Reader(is_colmap, read_colmap, LAYOUT)
