// Arrays from Python are taken as they are, never converted, and checked here before a kernel sees their memory.
#pragma once

#include <algorithm>
#include <cstdint>
#include <initializer_list>
#include <optional>
#include <string>
#include <type_traits>
#include <vector>

#include "bind.h"

namespace room2dgs {

using Input = nb::ndarray<nb::ro>;
using Output = nb::ndarray<>;
using OptionalInput = std::optional<Input>;
using OptionalOutput = std::optional<Output>;

// Arguments that are taken as they are, and those that may be None besides.
inline auto as_is(const char* name) { return nb::arg(name).noconvert(); }
inline auto or_none(const char* name) { return nb::arg(name).noconvert().none(); }

inline void require(bool condition, const std::string& sentence) {
  if (!condition) throw nb::value_error(sentence.c_str());
}

inline std::string shape_text(const int64_t* shape, size_t ndim) {
  std::string text = "(";
  for (size_t k = 0; k < ndim; ++k) text += (k ? ", " : "") + std::to_string(shape[k]);
  return text + (ndim == 1 ? ",)" : ")");
}

template <class T>
const char* dtype_text() {
  if (std::is_integral_v<T>) return sizeof(T) == 1 ? "uint8" : sizeof(T) == 2 ? "int16" : sizeof(T) == 4 ? "int32" : "int64";
  return sizeof(T) == 4 ? "float32" : "float64";
}

// The arguments of one call. A shape that does not fit is a ValueError; another dtype, device or memory order is a
// TypeError, since a conversion would write results into a copy that nobody sees. What is written may share memory
// with nothing else: kernels read rows that other threads have finished.
class Arguments {
 public:
  using Shape = std::initializer_list<int64_t>;

  Arguments() = default;
  // Arrays of a GPU.
  static Arguments on_cuda(int device_id) {
    Arguments arguments;
    arguments.device_type_ = nb::device::cuda::value, arguments.device_id_ = device_id;
    return arguments;
  }

  template <class T>
  const T* input(const char* name, const Input& array, Shape shape) {
    check<T>(name, array, shape);
    const T* data = static_cast<const T*>(const_cast<const void*>(array.data_handle()));
    data = at_offset(data, array.byte_offset());
    note(name, data, array, sizeof(T), false);
    return data;
  }
  template <class T>
  T* output(const char* name, const Output& array, Shape shape) {
    check<T>(name, array, shape);
    T* data = at_offset(static_cast<T*>(array.data_handle()), array.byte_offset());
    note(name, data, array, sizeof(T), true);
    return data;
  }
  // None gives null.
  template <class T>
  const T* input(const char* name, const OptionalInput& array, Shape shape) {
    return array ? input<T>(name, *array, shape) : nullptr;
  }
  template <class T>
  T* output(const char* name, const OptionalOutput& array, Shape shape) {
    return array ? output<T>(name, *array, shape) : nullptr;
  }

 private:
  struct Range {
    const char *name, *begin, *end;
    bool written;
  };
  std::vector<Range> ranges_;
  int device_type_ = nb::device::cpu::value, device_id_ = 0;

  template <class T>
  static T* at_offset(T* data, uint64_t bytes) {
    using Byte = std::conditional_t<std::is_const_v<T>, const char, char>;
    return bytes ? reinterpret_cast<T*>(reinterpret_cast<Byte*>(data) + bytes) : data;
  }

  template <class T, class Array>
  void check(const char* name, const Array& array, Shape shape) const {
    const std::string argument = name;
    const bool cuda = device_type_ == nb::device::cuda::value;
    if (array.device_type() != device_type_ || (cuda && array.device_id() != device_id_))
      throw nb::type_error((argument + " is not on " + (cuda ? "GPU " + std::to_string(device_id_) : "the CPU")).c_str());
    if (array.dtype() != nb::dtype<T>())
      throw nb::type_error((argument + " has another dtype than " + dtype_text<T>()).c_str());
    bool same = array.ndim() == shape.size();
    for (size_t k = 0; same && k < shape.size(); ++k) same = array.shape_ptr()[k] == shape.begin()[k];
    require(same, argument + " has shape " + shape_text(array.shape_ptr(), array.ndim()) + ", not " +
                      shape_text(shape.begin(), shape.size()));
    if (array.size() == 0) return;
    int64_t step = 1;
    for (size_t k = array.ndim(); k-- > 0; step *= array.shape_ptr()[k])
      if (array.shape_ptr()[k] != 1 && array.stride(k) != step)
        throw nb::type_error((argument + " is not contiguous, the last axis first").c_str());
    if (reinterpret_cast<uintptr_t>(array.data_handle()) % alignof(T) || array.byte_offset() % alignof(T))
      throw nb::type_error((argument + " does not start at a multiple of its items' size").c_str());
  }

  template <class Array>
  void note(const char* name, const void* data, const Array& array, size_t item, bool written) {
    const char* begin = static_cast<const char*>(data);
    const Range range = {name, begin, begin + item * array.size(), written};
    for (const Range& other : ranges_)
      require(!((written || other.written) && range.begin < other.end && other.begin < range.end),
              std::string(name) + " shares memory with " + other.name);
    ranges_.push_back(range);
  }
};

// Lengths of the axes of an array whose shape sets that of the others; `axes` of them or a ValueError.
template <class Array>
std::vector<int64_t> lengths(const char* name, const Array& array, size_t axes) {
  require(array.ndim() == axes, std::string(name) + " has " + std::to_string(array.ndim()) + " axes, not " +
                                    std::to_string(axes));
  return {array.shape_ptr(), array.shape_ptr() + axes};
}

}  // namespace room2dgs
