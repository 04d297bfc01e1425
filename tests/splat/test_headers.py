"""The kernels' maths serves another machine's compiler too: headers alone, no intrinsics, one scalar at a time."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
import torch

from room2dgs import _C
from room2dgs.geometry.spherical_harmonics import sh_color
from room2dgs.splat import Surfels, reference

ROOT = Path(__file__).parents[2] / "room2dgs"
INCLUDES = ["-I", str(ROOT / "csrc"), "-I", str(ROOT / "splat" / "csrc")]

PROGRAM = """
#define R2_ISA isa_other
#define R2_HD inline
#include "bounds.h"
#include "pixel.h"
#include "sh.h"
#include <cstdio>
using namespace isa_other;

int main() {
  View view{};
  double s[9], sh[12], color[3], inverse, pixel[2], opacity;
  for (double& x : view.R) if (scanf("%lf", &x) != 1) return 1;
  for (double& x : view.t) if (scanf("%lf", &x) != 1) return 1;
  if (scanf("%lf %lf %lf %lf", &view.fx, &view.fy, &view.cx, &view.cy) != 4) return 1;
  view.near = 0.05, view.width = 53, view.height = 40;
  for (;;) {
    for (double& x : s) if (scanf("%lf", &x) != 1) return 0;
    for (double& x : sh) if (scanf("%lf", &x) != 1) return 1;
    if (scanf("%lf %lf %lf", &opacity, pixel, pixel + 1) != 3) return 1;
    float coefficients[12];
    for (int k = 0; k < 12; ++k) coefficients[k] = static_cast<float>(sh[k]);
    const Surfel<double> surfel = {{s[0], s[1], s[2]}, s[3], s[4], s[5], s[6], s[7], s[8]};
    const auto o = project(surfel, axes_of(surfel), view);
    color_of(coefficients, 4, view_direction(view, o, inverse), color);
    room2dgs::Record r{};
    r.cx = o.cx, r.cy = o.cy, r.z = o.p.z, r.den_max = o.p.z / view.near, r.log2_opacity = log2(opacity);
    r.aux = o.aux, r.auy = o.auy, r.avx = o.avx, r.avy = o.avy, r.bx = o.bx, r.by = o.by;
    const Hit<float> hit = intersect<float>(r, pixel[0] - r.cx, pixel[1] - r.cy);
    const auto back = hit_backward<float>(hit, true, 1.0f, 0.0f);
    Disc<double> d{};
    d.rho = 2 * log(opacity * 255), d.su = s[7], d.sv = s[8], d.tu = o.tu, d.tv = o.tv, d.plane = o.plane;
    d.cx = o.cx, d.cy = o.cy, d.dx = o.dx, d.dy = o.dy, d.z = o.p.z;
    const Reach<double> reach = reach_of(d, view);
    printf("%d %.9g %.9g %.9g %.9g %.9g %.9g", o.front, o.cx, o.cy, hit.rho, hit.z, hit.raw, back.opacity);
    printf(" %.9g %.9g %.9g %.9g %.9g\\n", color[0], color[1], color[2], reach.x0, reach.x1);
  }
}
"""


@pytest.fixture(scope="module")
def source(tmp_path_factory):
    path = tmp_path_factory.mktemp("headers") / "scalar.cpp"
    path.write_text(PROGRAM)
    return path


@pytest.fixture(scope="module")
def compiler():
    found = shutil.which("c++") or shutil.which("g++") or shutil.which("clang++")
    assert found, "the extension was built by a C++ compiler that is not on the path any more"
    return [found, "-std=c++17", *INCLUDES]


def test_the_headers_need_no_intrinsics(compiler, source):
    needed = subprocess.run([*compiler, "-M", str(source)], check=True, capture_output=True, text=True).stdout
    assert "pixel.h" in needed and "surfel.h" in needed
    assert "simd.h" not in needed and "immintrin.h" not in needed


def test_one_scalar_at_a_time_is_the_reference(compiler, source, make_surfels, make_view):
    program = source.with_suffix("")
    subprocess.run([*compiler, "-O1", "-ffp-contract=off", str(source), "-o", str(program)], check=True)
    surfels, (K, pose) = make_surfels(300, 33), make_view()
    exact = Surfels(*(x.double() for x in surfels))
    K, pose = K.double(), pose.double()
    p = reference.project(exact, K, pose, 0.05)
    pixels = p.center_px + 3 * torch.randn(300, 2, generator=torch.Generator().manual_seed(1)).double()
    rows = torch.cat([*exact[:3], exact.sh.reshape(300, 12), exact.opacities[:, None], pixels], dim=1)
    camera = [
        *pose[:3, :3].flatten().tolist(),
        *pose[:3, 3].tolist(),
        *(K[i, j] for i, j in ((0, 0), (1, 1), (0, 2), (1, 2))),
    ]
    text = " ".join(f"{float(x)!r}" for x in camera) + "\n" + "\n".join(" ".join(map(repr, r)) for r in rows.tolist())
    out = subprocess.run([str(program)], input=text, check=True, capture_output=True, text=True).stdout
    front, cx, cy, rho, z, raw, g_opacity, *others = (
        torch.tensor([[*map(float, line.split())] for line in out.splitlines()]).double().T
    )
    assert torch.equal(front.bool(), p.visible) and p.visible.sum() > 250

    delta = pixels - p.center_px
    den = 1 + (p.b * delta).sum(-1)
    hit = p.plane & (den > 1e-6) & (0.05 * den <= p.depth)
    u, v = ((a * delta).sum(-1) / den for a in (p.a_u, p.a_v))
    on_plane = hit & (u * u + v * v <= 2 * delta.square().sum(-1))
    expected_rho = torch.where(on_plane, u * u + v * v, 2 * delta.square().sum(-1))
    expected_z = torch.where(on_plane, p.depth / den, p.depth)
    expected_raw = exact.opacities * torch.exp(-expected_rho / 2)
    seen = p.visible & (expected_raw > 1 / 255)
    assert seen.sum() > 100 and on_plane[seen].any() and (~on_plane[seen]).any()
    for actual, expected in ((cx, p.center_px[:, 0]), (cy, p.center_px[:, 1]), (rho, expected_rho), (z, expected_z)):
        torch.testing.assert_close(actual[seen], expected[seen], rtol=1e-4, atol=1e-4)
    torch.testing.assert_close(raw[seen], expected_raw[seen], rtol=1e-4, atol=0)
    clamped = expected_raw < 0.99
    torch.testing.assert_close(g_opacity[seen], (expected_raw * clamped)[seen], rtol=1e-4, atol=0)
    *color, x0, x1 = others
    view = torch.nn.functional.normalize(exact.centers + pose[:3, :3].T @ pose[:3, 3], dim=-1)
    torch.testing.assert_close(
        torch.stack(color, -1).clamp_min(0)[seen], sh_color(exact.sh, view)[seen], rtol=1e-5, atol=1e-5
    )
    assert ((x0 <= pixels[:, 0]) & (pixels[:, 0] <= x1))[seen].all()


LOGARITHMS = """
#include "doubles.h"
#include <cstdio>
using namespace R2_ISA;

int main() {
  double x[kDoubles];
  for (int n = 0; scanf("%lf", &x[n]) == 1;) {
    if (++n < kDoubles) continue;
    n = 0;
    dn several;
    memcpy(&several, x, sizeof several);
    const Doubles found = log2_of(Doubles(several));
    for (int k = 0; k < kDoubles; ++k) {
      const double one = log2_of(x[k]), lane = reinterpret_cast<const double*>(&found)[k];
      printf("%.17g %d\\n", one, memcmp(&one, &lane, 8) == 0);
    }
  }
}
"""


AVX2 = ["-mavx2", "-mfma"]
OPTIONS = {"baseline": [], "avx2": AVX2, "avx512": [*AVX2, "-mavx512f", "-mavx512vl", "-mavx512dq", "-mavx512bw"]}


@pytest.mark.parametrize("isa", OPTIONS)
def test_the_logarithm_is_exact_by_one_double_and_by_several(compiler, tmp_path, isa):
    if [*OPTIONS].index(isa) > [*OPTIONS].index(_C.isa()):
        pytest.skip("not on this machine")
    source, program = tmp_path / "logarithms.cpp", tmp_path / "logarithms"
    source.write_text(LOGARITHMS)
    subprocess.run([*compiler, "-O1", "-ffp-contract=off", *OPTIONS[isa], str(source), "-o", str(program)], check=True)
    random = np.random.default_rng(0)
    powers = 2.0 ** np.arange(-100, 100)
    near_one = 1 + random.uniform(-1e-3, 1e-3, 400)
    roots = np.sqrt(0.5) * (1 + np.array([-1e-15, 0, 1e-15, 1e-9]))
    x = np.concatenate([powers, near_one, roots, random.uniform(1 / 255, 1, 2000), 10 ** random.uniform(-30, 30, 1000)])
    out = subprocess.run(
        [str(program)], input="\n".join(map(repr, x.tolist())), check=True, capture_output=True, text=True
    ).stdout
    found, same = np.array([line.split() for line in out.splitlines()], dtype=float).T
    expected = np.log2(x[: len(found)])
    assert len(found) > len(x) - 8 and same.all()
    assert (np.abs(found - expected) <= 1e-15 * np.maximum(1, np.abs(expected))).all()
    np.testing.assert_array_equal(found[: len(powers)], np.arange(-100, 100))
