#include <cmath>
#include <vector>

#include "arrays.h"
#include "coloring.h"
#include "parallel.h"

namespace room2dgs {
namespace {

int64_t chunks(int64_t count) { return (count + kPointChunk - 1) / kPointChunk; }

void check_pinhole(double fx, double fy, double cx, double cy) {
  require(std::isfinite(fx) && fx > 0 && std::isfinite(fy) && fy > 0 && std::isfinite(cx) && std::isfinite(cy),
          "fx or fy is not above 0, or one of fx, fy, cx, cy is not finite");
}

void draw_faces(const Input& vertices, const Input& faces, double fx, double fy, double cx, double cy, double near,
                const Output& depth, const Output& face) {
  Arguments check;
  const int64_t count = lengths("vertices", vertices, 2)[0];
  const auto size = lengths("depth", depth, 2);
  DrawJob job{};
  job.count = lengths("faces", faces, 2)[0], job.height = size[0], job.width = size[1];
  job.vertices = check.input<float>("vertices", vertices, {count, 3});
  job.faces = check.input<int32_t>("faces", faces, {job.count, 3});
  job.depth = check.output<float>("depth", depth, {job.height, job.width});
  job.face = check.output<int32_t>("face", face, {job.height, job.width});
  check_pinhole(fx, fy, cx, cy);
  require(std::isfinite(near) && near > 0, "near is not above 0");
  require(job.count < (int64_t{1} << 31) && job.height < (1 << 24) && job.width < (1 << 24), "faces or depth are too many");
  job.fx = fx, job.fy = fy, job.cx = cx, job.cy = cy, job.near = near;
  for (int64_t k = 0; k < 3 * job.count; ++k)
    require(job.faces[k] >= 0 && job.faces[k] < count, "faces name a vertex that is not there");
  std::vector<int32_t> box(4 * job.count);
  job.box = box.data();
  nb::gil_scoped_release unlocked;
  const auto bound = R2_BEST(bound_faces);
  const auto draw = R2_BEST(draw_band);
  Region region;
  region.parallel_for(chunks(job.count), [&](int64_t chunk, int) { bound(job, chunk); });
  region.parallel_for((job.height + kBandRows - 1) / kBandRows, [&](int64_t band, int) { draw(job, band); });
}

void look_up(const Input& points, const Input& normals, const Input& spacing, const Input& depth, const Input& photo,
             const Input& soft, const OptionalInput& usable, double fx, double fy, double cx, double cy,
             const Input& cam_from_world, const Input& gain, double sharpness, double softness, const Output& quality,
             const Output& sharp, const Output& low) {
  Arguments check;
  LookJob job{};
  job.count = lengths("points", points, 2)[0];
  const auto drawn = lengths("depth", depth, 2), size = lengths("photo", photo, 3), small = lengths("soft", soft, 3);
  job.rows = drawn[0], job.columns = drawn[1];
  job.height = size[0], job.width = size[1], job.soft_height = small[0], job.soft_width = small[1];
  job.points = check.input<float>("points", points, {job.count, 3});
  job.normals = check.input<float>("normals", normals, {job.count, 3});
  job.spacing = check.input<float>("spacing", spacing, {job.count});
  job.depth = check.input<float>("depth", depth, {job.rows, job.columns});
  job.photo = check.input<uint8_t>("photo", photo, {job.height, job.width, 3});
  job.soft = check.input<uint8_t>("soft", soft, {job.soft_height, job.soft_width, 3});
  job.usable = check.input<uint8_t>("usable", usable, {job.height, job.width});
  const double* pose = check.input<double>("cam_from_world", cam_from_world, {3, 4});
  const float* gains = check.input<float>("gain", gain, {3});
  job.quality = check.output<float>("quality", quality, {job.count, kBest});
  job.sharp = check.output<uint8_t>("sharp", sharp, {job.count, kBest, 3});
  job.low = check.output<uint8_t>("low", low, {job.count, kBest, 3});
  check_pinhole(fx, fy, cx, cy);
  require(job.rows > 0 && job.columns > 0 && job.soft_height > 0 && job.soft_width > 0, "depth or soft is empty");
  require(std::isfinite(sharpness) && sharpness > 0 && std::isfinite(softness) && softness > 0,
          "sharpness or softness is not above 0");
  for (int c = 0; c < 3; ++c) require(std::isfinite(gains[c]) && gains[c] > 0, "gain is not above 0");
  for (int k = 0; k < 12; ++k) job.cam_from_world[k] = pose[k];
  for (int c = 0; c < 3; ++c) job.gain[c] = gains[c];
  job.fx = fx, job.fy = fy, job.cx = cx, job.cy = cy;
  job.sharpness = static_cast<float>(sharpness), job.softness_px = static_cast<float>(softness);
  nb::gil_scoped_release unlocked;
  const auto kernel = R2_BEST(look_up);
  parallel_for(chunks(job.count), [&](int64_t chunk, int) { kernel(job, chunk); });
}

void blend_views(const Input& quality, const Input& sharp, const Input& low, const Output& color, const Output& best) {
  Arguments check;
  BlendJob job{};
  job.count = lengths("quality", quality, 2)[0];
  job.quality = check.input<float>("quality", quality, {job.count, kBest});
  job.sharp = check.input<uint8_t>("sharp", sharp, {job.count, kBest, 3});
  job.low = check.input<uint8_t>("low", low, {job.count, kBest, 3});
  job.color = check.output<float>("color", color, {job.count, 3});
  job.share = check.output<float>("best", best, {job.count});
  nb::gil_scoped_release unlocked;
  const auto kernel = R2_BEST(blend);
  parallel_for(chunks(job.count), [&](int64_t chunk, int) { kernel(job, chunk); });
}

}  // namespace

void bind_coloring(nb::module_& m) {
  m.def("draw_faces", &draw_faces, as_is("vertices"), as_is("faces"), nb::arg("fx"), nb::arg("fy"), nb::arg("cx"),
        nb::arg("cy"), nb::arg("near"), as_is("depth"), as_is("face"),
        "Writes the depth (h, w) and the index of the nearest face, 0 and -1 where there is none; vertices (v, 3) are "
        "float32 in the camera's frame, faces (f, 3) int32.");
  m.def("look_up", &look_up, as_is("points"), as_is("normals"), as_is("spacing"), as_is("depth"), as_is("photo"),
        as_is("soft"), or_none("usable"), nb::arg("fx"), nb::arg("fy"), nb::arg("cx"), nb::arg("cy"),
        as_is("cam_from_world"), as_is("gain"), nb::arg("sharpness"), nb::arg("softness"), as_is("quality"),
        as_is("sharp"), as_is("low"),
        "Takes one photo into the best views (n, 5) of points: quality, falling, and levels of photo and blurred photo.");
  m.def("blend_views", &blend_views, as_is("quality"), as_is("sharp"), as_is("low"), as_is("color"), as_is("best"),
        "Writes the colours (n, 3) 0..255 that the best views of `look_up` give, and the quality of the best, 0 = none.");
}

}  // namespace room2dgs
