// Binds Adam on the rows that a view has seen.
#include "../../train/csrc/block_adam.h"
#include "bind_device.h"

namespace R2_ISA {

using namespace room2dgs;

namespace {

void adam(const Output& parameters, const Input& gradients, const Output& first, const Output& second,
          const OptionalInput& seen, double rate, double beta1, double beta2, double epsilon, int64_t step,
          uint64_t queue) {
  Arguments check = on_device(gradients);
  const auto shape = lengths("gradients", gradients, 2);
  const int64_t rows = shape[0], width = shape[1];
  AdamStep s{};
  s.parameters = check.output<float>("parameters", parameters, {rows, width});
  s.gradients = check.input<float>("gradients", gradients, {rows, width});
  s.first = check.output<float>("first", first, {rows, width});
  s.second = check.output<float>("second", second, {rows, width});
  s.seen = check.input<uint8_t>("seen", seen, {rows});
  require(beta1 >= 0 && beta1 < 1 && beta2 >= 0 && beta2 < 1, "beta1 or beta2 is not in 0..1, 1 left out");
  require(step >= 1, "step counts from 1");
  s.rows = rows, s.width = width, s.rate = rate, s.beta1 = beta1, s.beta2 = beta2, s.epsilon = epsilon, s.step = step;
  nb::gil_scoped_release unlocked;
  const Queue on(queue, gradients.device_id());
  const OnDevice current(on);
  adam_rows(on, s);
}

}  // namespace

void bind_block_adam(nb::module_& m) {
  m.def("adam_rows", &adam, as_is("parameters"), as_is("gradients"), as_is("first"), as_is("second"), or_none("seen"),
        nb::arg("rate"), nb::arg("beta1"), nb::arg("beta2"), nb::arg("epsilon"), nb::arg("step"), nb::arg("queue") = 0,
        "One step of Adam, in place, for the rows whose `seen`, uint8, is not 0 (None: all); the others keep "
        "everything. queue: as in BlockFrame.");
}

}  // namespace R2_ISA
