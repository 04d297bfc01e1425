// A scalar that counts what is done with it: put through the templates of surfel.h, pixel.h and sh.h it tells how many
// operations one surfel or one pixel costs, by the very source that computes it (tools/roofline).
#pragma once

#include <cstdint>

#include "scalar.h"

namespace R2_ISA {

// An fma is one; a mask, a minimum and a comparison are `other`.
struct Operations {
  int64_t fma = 0, add = 0, multiply = 0, divide = 0, root = 0, power = 0, other = 0;
};

struct Counted {
  double value;
  Counted(double x = 0) : value(x) {}
  explicit operator float() const { return static_cast<float>(value); }
  static Operations& done() {
    static thread_local Operations operations;
    return operations;
  }
  friend Counted operator+(Counted a, Counted b) { return ++done().add, a.value + b.value; }
  friend Counted operator-(Counted a, Counted b) { return ++done().add, a.value - b.value; }
  friend Counted operator-(Counted a) { return -a.value; }  // a sign is free: operands have one
  friend Counted operator*(Counted a, Counted b) { return ++done().multiply, a.value * b.value; }
  friend Counted operator/(Counted a, Counted b) { return ++done().divide, a.value / b.value; }
  Counted& operator+=(Counted b) { return *this = *this + b; }
  Counted& operator-=(Counted b) { return *this = *this - b; }
  friend bool operator<(Counted a, Counted b) { return ++done().other, a.value < b.value; }
  friend bool operator>(Counted a, Counted b) { return ++done().other, a.value > b.value; }
  friend bool operator<=(Counted a, Counted b) { return ++done().other, a.value <= b.value; }
  friend bool operator>=(Counted a, Counted b) { return ++done().other, a.value >= b.value; }
  friend bool operator!=(Counted a, Counted b) { return ++done().other, a.value != b.value; }
  friend Counted fma(Counted a, Counted b, Counted c) { return ++done().fma, a.value * b.value + c.value; }
  friend Counted vsqrt(Counted a) { return ++done().root, __builtin_sqrt(a.value); }
  friend Counted vmin(Counted a, Counted b) { return ++done().other, a.value < b.value ? a : b; }
  friend Counted vmax(Counted a, Counted b) { return ++done().other, a.value > b.value ? a : b; }
  friend Counted select(bool mask, Counted yes, Counted no) { return ++done().other, mask ? yes : no; }
  friend Counted masked(bool mask, Counted x) { return ++done().other, mask ? x : Counted(0); }
  friend Counted exp2_from(Counted x) { return ++done().power, __builtin_exp2(x.value); }
};
template <>
struct Lanes<Counted> {
  using Mask = bool;
  static Counted all(float x) { return x; }
};

}  // namespace R2_ISA
