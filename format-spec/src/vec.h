// Vectors in double precision.
#pragma once

#include "lsp/layout.h"

namespace lsp::format {

struct Vec {
  double x, y, z;
  double operator[](int axis) const { return axis == 0 ? x : axis == 1 ? y : z; }
};
inline Vec to_vec(const lsp_float3& v) { return {v.x, v.y, v.z}; }
inline Vec operator+(const Vec& a, const Vec& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline Vec operator-(const Vec& a, const Vec& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline Vec operator*(const Vec& a, double s) { return {a.x * s, a.y * s, a.z * s}; }
inline double dot(const Vec& a, const Vec& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Vec cross(const Vec& a, const Vec& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

}  // namespace lsp::format
