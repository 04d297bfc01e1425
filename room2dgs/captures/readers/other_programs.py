"""Recognises poses of other programs that are not read, and says what to export instead."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from room2dgs.captures.listing import Listing, natural
from room2dgs.errors import InputError
from room2dgs.regular_files import open_regular

FOLDERS = ("", "images/", "sparse/")  # that are looked into
ANY_EXPORT = "export the cameras as a COLMAP model"


class Program(NamedTuple):
    """Files of a program that hold poses.

    Attributes:
        patterns: of their names.
        what: what they are; mend: what to do.
    """

    patterns: tuple[str, ...]
    what: str
    mend: str = ANY_EXPORT


PROGRAMS = (
    Program(("*.psx", "*.psz"), "a project of Metashape", "export its cameras as .xml (File, Export, Export Cameras)"),
    Program(("*.rcproj", "*.rsproj"), "a project of RealityCapture", "export its registration as a COLMAP model"),
    Program(("bundle.out", "bundle.rd.out"), "Bundler's poses"),
    Program(("*.nvm",), "VisualSFM's poses"),
    Program(("reconstruction.json",), "OpenSfM's poses", "export them (opensfm export_colmap)"),
    Program(("*.sfm", "sfm_data*.json", "sfm_data*.bin"), "AliceVision's or OpenMVG's poses"),
    Program(("*.mvs",), "OpenMVS's scene"),
    Program(("*.p4d", "*_calibrated_external_camera_parameters.txt"), "Pix4D's poses"),
    Program(("poses_bounds.npy",), "LLFF's poses", "give the COLMAP model that they are of"),
    Program(("*_SfM.log",), "Tanks and Temples' poses", "name it trajectory.log, and its folder of photos image"),
    Program(("groundtruth.txt",), "TUM's poses", "put rgb.txt, which names the photos with their times, beside it"),
    Program(("trajectory.json",), "Open3D's poses", "write them as trajectory.log (write_pinhole_camera_trajectory)"),
    Program(("cameras.json",), "3D Gaussian Splatting's cameras", "give the COLMAP model that it was trained on"),
    Program(("traj.txt",), "Replica's poses", "put its photos into results/ beside it"),
    Program(("database.db",), "COLMAP's features without a model", "run the mapping"),
)
# files of many kinds, which are RealityCapture's if they begin so
BEGINNINGS = {"*.csv": ("#name,x,y", "#cameras", "name,x,y,alt"), "*.xmp": ("xcr:",)}
REALITY_CAPTURE = Program((), "RealityCapture's poses", "export the registration as a COLMAP model")
HEAD_BYTES = 1024


def poses_of_others(files: Listing) -> str | None:
    """A part of a sentence on poses that lie in a folder in a form that is not read; None: there are none."""
    for program in PROGRAMS:
        for folder in FOLDERS:
            found = natural(name for pattern in program.patterns for name in _matching(files, folder, pattern))
            if found:
                return _advice(folder + found[0], program)
    for pattern, beginnings in BEGINNINGS.items():
        for name in [folder + name for folder in FOLDERS[:2] for name in _matching(files, folder, pattern)[:1]]:
            if any(beginning in _head(files.root / name) for beginning in beginnings):
                return _advice(name, REALITY_CAPTURE)
    return None


def _advice(name: str, program: Program) -> str:
    return f"has {name}, {program.what}, which is not read: {program.mend}"


def _matching(files: Listing, folder: str, pattern: str) -> list[str]:
    return Listing(files.root / folder).matching(pattern) if not files.root.is_file() else []


def _head(path: Path) -> str:
    try:
        with open_regular(path) as file:
            return file.read(HEAD_BYTES).decode("utf-8-sig", errors="replace").lower()
    except (InputError, OSError):
        return ""
