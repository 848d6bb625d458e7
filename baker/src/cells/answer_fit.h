// From the sampled rays of a shaft to the answer that its entry gives: nothing, a plane, or a split between
// two.
//
// A shaft that sees an edge or a silhouette has no single representative: its entry then holds two answers
// and a linear form over the ray's place in the shaft whose sign chooses, fitted by weighted least squares.
#pragma once

#include <array>
#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

namespace lsp {

constexpr uint32_t kNoPlane = UINT32_MAX;
constexpr int kPlaces =
    5;  // coordinates of a ray's place in a shaft of an origin table; a far table has four

// A ray of a shaft and what it truly meets. t counts in shares of its way through the cell.
struct ShaftSample {
  std::array<float, kPlaces> place;  // in [-1, 1] each
  glm::vec3 origin, way;             // from the cell's centre; way: to where it leaves the cell
  float t;                           // of what it meets
  uint32_t plane;                    // of what it meets, kNoPlane: nothing in the cell
};

struct Plane {
  glm::vec3 normal;  // unit length
  float distance;    // from the cell's centre along the normal
};

// An answer: nothing (kNoPlane), a plane, or a split between two of these.
struct Answer {
  bool split = false;
  uint32_t a = kNoPlane, b = kNoPlane;        // of a split: where the form is positive, and where not
  std::array<int8_t, kPlaces + 1> weights{};  // of the places and 1, up to kSplitWeight in size
  float loss = 0;  // share of the rays answered wrongly, as measured in part on rays that chose nothing
};

struct FitOptions {
  bool splits = true;
  float depth_weight =
      0.25f;  // of a depth error of a quarter of a cell's edge and more, against a wrong answer
};

constexpr int kSplitWeight = 31;

// Chooses for `samples`, every fourth of which (of 24 and more) only measures. `near` where rays begin in the
// cell: then nothing behind the origin counts.
class AnswerFit {
 public:
  AnswerFit(const FitOptions& options, float cell_size) : options_(options), size_(cell_size) {}

  Answer choose(std::span<const Plane> planes, std::span<const ShaftSample> samples, bool near);

 private:
  float loss(std::span<const Plane> planes, const ShaftSample& s, uint32_t plane, bool near) const;
  bool fit_split(std::span<const ShaftSample> samples, const float* first, const float* second,
                 Answer& answer, float& cost) const;
  bool measures_only(size_t sample) const { return held_out_ && sample % 4 == 3; }

  FitOptions options_;
  float size_;
  bool held_out_ = false;
  std::vector<uint32_t> candidates_;
  std::vector<float> losses_;  // by candidate and sample
};

// The linear form of a split at a place.
inline float split_side(const std::array<int8_t, kPlaces + 1>& weights,
                        const std::array<float, kPlaces>& place) {
  float side = float(weights[kPlaces]);
  for (int k = 0; k < kPlaces; ++k) side += float(weights[size_t(k)]) * place[size_t(k)];
  return side;
}

}  // namespace lsp
