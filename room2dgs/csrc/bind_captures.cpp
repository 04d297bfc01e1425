#include "arrays.h"
#include "normal_codes.h"

namespace room2dgs {
namespace {

void pack_normals(const Input& normals, const Output& codes) {
  Arguments check;
  const int64_t count = lengths("normals", normals, 2)[1];
  const float* from = check.input<float>("normals", normals, {3, count});
  int16_t* to = check.output<int16_t>("codes", codes, {2, count});
  nb::gil_scoped_release unlocked;
  R2_BEST(pack_normals)(from, count, to);
}

void unpack_normals(const Input& codes, const Output& normals) {
  Arguments check;
  const int64_t count = lengths("codes", codes, 2)[1];
  const int16_t* from = check.input<int16_t>("codes", codes, {2, count});
  float* to = check.output<float>("normals", normals, {3, count});
  nb::gil_scoped_release unlocked;
  R2_BEST(unpack_normals)(from, count, to);
}

}  // namespace

void bind_captures(nb::module_& m) {
  m.def("pack_normals", &pack_normals, as_is("normals"), as_is("codes"),
        "Writes the codes (2, pixels), int16, of normals (3, pixels), float32.");
  m.def("unpack_normals", &unpack_normals, as_is("codes"), as_is("normals"), "The way back: unit normals, or 0.");
}

}  // namespace room2dgs
