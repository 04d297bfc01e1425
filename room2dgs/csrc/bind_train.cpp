#include "bind.h"

namespace room2dgs {
void bind_train(nb::module_&) {}
}  // namespace room2dgs
