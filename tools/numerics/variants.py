"""The rasterizer's approximations, each loosened or tightened alone: edits of the sources, built in a folder aside."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

from room2dgs.errors import InputError

ROOT = Path(__file__).resolve().parents[2]
SPLAT = "room2dgs/splat/csrc"


class Edit(NamedTuple):
    """One place in the sources, which must be there exactly once.

    Attributes:
        file: under the repository.
        old, new: text.
    """

    file: str
    old: str
    new: str


class Variant(NamedTuple):
    """A row of the table.

    Attributes:
        part: which approximation it is about.
        name: what it does about it.
        edits: to the shipped sources.
        isa: instruction set, or "" for the best.
        timed: its time means something; not where it imitates what other hardware would do.
    """

    part: str
    name: str
    edits: tuple[Edit, ...] = ()
    isa: str = ""
    timed: bool = True


def _floor(level: float) -> tuple[Edit, ...]:
    return (Edit("room2dgs/csrc/frame_arguments.h", "static_cast<float>(opacity_floor),", f"1.0f / {level:.1f}f,"),)


def _stop(level: str) -> tuple[Edit, ...]:
    return (Edit(f"{SPLAT}/pixel.h", "kTransmittanceMin = 1e-4f;", f"kTransmittanceMin = {level}f;"),)


def _filter(inverse_variance: float) -> tuple[Edit, ...]:
    new = f"kFilterInverseVariance = {inverse_variance:.1f}f;"
    return (Edit(f"{SPLAT}/surfel.h", "kFilterInverseVariance = 2.0f;", new),)


def _exp(new: str) -> tuple[Edit, ...]:
    """The powers of two, of eight lanes and of sixteen."""
    eight = ("room2dgs/csrc/simd.h", "f8", "splat")
    return tuple(
        Edit(file, *(text.format(type=kind, all=broadcast) for text in (_POLYNOMIAL, new)))
        for file, kind, broadcast in (eight, ("room2dgs/csrc/wide.h", "fw", "all"))
    )


_POLYNOMIAL = """  {type} p = {all}(0.001327647129073739f);
  p = fma(p, f, {all}(0.009675540961325169f));
  p = fma(p, f, {all}(0.05550713092088699f));
  p = fma(p, f, {all}(0.24022120237350464f));
  p = fma(p, f, {all}(0.6931469440460205f));
  p = fma(p, f, {all}(1.0000001192092896f));
"""
_CUBIC = """  {type} p = {all}(0.0558f);
  p = fma(p, f, {all}(0.2402f));
  p = fma(p, f, {all}(0.69314f));
  p = fma(p, f, {all}(1.0f));
"""
_LIBRARY = "  {type} p;\n  for (int k = 0; k < int(sizeof p / 4); ++k) p[k] = __builtin_exp2f(f[k]);\n"
_SHORT = """
template <class F>
inline F shortened(F x) {  // each of its floats to the 11 bits of a half's mantissa
  uint32_t bits[sizeof(F) / 4];
  __builtin_memcpy(bits, &x, sizeof x);
  for (uint32_t& b : bits) b = (b + 0x1000u) & ~0x1fffu;
  __builtin_memcpy(&x, bits, sizeof x);
  return x;
}
"""
_PROJECT = f"{SPLAT}/stages.h"
_FIRST = "R2_HD Surfel<double> load_surfel("  # of the functions there
_WITH_SHORT = Edit(_PROJECT, _FIRST, _SHORT + _FIRST)
_REACH = "d.rho = T(2 * kLn2) * (r.log2_opacity - log2_of(T(view.opacity_floor)));"


def _short(place: str) -> Edit:
    """A number of a record, where it is set, once."""
    name, _, value = place.partition(" = ")
    return Edit(_PROJECT, place, f"{name} = shortened({value})")


EXACT = Variant("", "none of them", (*_floor(25500), *_stop("1e-8")))
SHIPPED = Variant("", "shipped")
VARIANTS = (
    Variant("exp", "cubic", _exp(_CUBIC)),
    Variant("exp", "the library's", _exp(_LIBRARY)),
    Variant("opacity floor", "1/1000", _floor(1000)),
    Variant("opacity floor", "1/255", _floor(255)),
    Variant("opacity floor", "1/64", _floor(64)),
    Variant("early stop", "1e-6", _stop("1e-6")),
    Variant("early stop", "1e-3", _stop("1e-3")),
    Variant("early stop", "1e-2", _stop("1e-2")),
    Variant("filter", "half as wide", _filter(8.0)),
    Variant("bounds", "no masks inside tiles", (
        Edit(f"{SPLAT}/tile_hits.h", "reach_of(r, x, y) & alive;", "alive;"),
    )),
    Variant("bounds", "3 deviations whatever the opacity", (Edit(_PROJECT, _REACH, "d.rho = T(9);"),)),
    Variant("16 bits", "normals", (
        _WITH_SHORT,
        *(_short(f"r.normal[{k}] = narrow(o.side * s.axes.tw.{x})") for k, x in enumerate("xyz")),
    ), timed=False),
    Variant("16 bits", "slopes", (
        _WITH_SHORT,
        *(_short(f"r.{x} = narrow(o.{x})") for x in ("aux", "auy", "avx", "avy", "bx", "by")),
    ), timed=False),
    Variant("16 bits", "gradients of a tile", (
        _WITH_SHORT, Edit(_PROJECT, "sum[k] += entry[k];", "sum[k] += shortened(entry[k]);"),
    ), timed=False),
    Variant("SIMD", "AVX2 alone", isa="avx2"),
    Variant("SIMD", "4 lanes, no fused multiply-add", isa="baseline"),
)  # fmt: skip


class Builder:
    """Builds variants one after the other in one folder, so that what does not change is compiled once.

    Args:
        folder: for the sources and the build; made if missing.

    Raises:
        InputError: there are no sources beside the package.
    """

    def __init__(self, folder: Path) -> None:
        if not (ROOT / "CMakeLists.txt").is_file():
            raise InputError(f"{ROOT} has no sources to build variants of; run this in a checkout of the repository")
        self.source, self.build = folder / "source", folder / "build"
        sources = (p for p in sorted(ROOT.glob("room2dgs/**/csrc/**/*")) if p.is_file())
        self.files = [Path("CMakeLists.txt"), *(p.relative_to(ROOT) for p in sources)]

    def library(self, variant: Variant, keep: Path) -> Path:
        """The extension with the variant's edits, as a file of its own.

        Raises:
            InputError: a place to edit is not in the sources, or they do not compile.
        """
        for file in self.files:
            text = (ROOT / file).read_text(encoding="utf-8")
            for edit in variant.edits:
                if Path(edit.file) == file:
                    if text.count(edit.old) != 1:
                        raise InputError(f"{file} has changed: {edit.old!r} is not in it once; mend the variant")
                    text = text.replace(edit.old, edit.new)
            target = self.source / file
            if not target.is_file() or target.read_text(encoding="utf-8") != text:  # else nothing to compile anew
                target.parent.mkdir(parents=True, exist_ok=True)
                target.write_text(text, encoding="utf-8")
        path = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
        python = f"-DPython_EXECUTABLE={sys.executable}"
        _called(["cmake", "-S", self.source, "-B", self.build, "-DCMAKE_BUILD_TYPE=Release", python], path, variant)
        _called(["cmake", "--build", self.build, "--parallel", "2"], path, variant)
        built = next(self.build.glob("_C*.so"))
        keep.mkdir(parents=True, exist_ok=True)
        return Path(shutil.copy(built, keep / built.name))


def _called(command: list[str | Path], path: str, variant: Variant) -> None:
    done = subprocess.run(command, capture_output=True, text=True, env={**os.environ, "PATH": path}, check=False)
    if done.returncode:
        raise InputError(f"variant {variant.name!r} does not build: {(done.stderr or done.stdout)[-500:]}")
