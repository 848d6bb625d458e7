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

// Rays of a shaft and what they truly meet, each an array by ray. `t` counts in shares of the way through the
// cell. Those of the shaft the other way round are the same lines, `reversed`: then only t, plane and the
// order of the places are the reversed ray's.
struct ShaftSamples {
  size_t count = 0;
  std::array<const float*, kPlaces> place{};    // in [-1, 1] each; null: always 0
  std::array<const float*, 3> origin{}, way{};  // from the cell's centre; way: to where it leaves the cell
  const float* t = nullptr;                     // of what it meets
  const uint32_t* plane = nullptr;              // of what it meets, kNoPlane: nothing in the cell
  bool reversed = false;
};

struct Plane {
  glm::vec3 normal;    // unit length
  float distance;      // from the cell's centre along the normal
  glm::vec3 color{0};  // base colour and emission of what lies in it
};

// From 0, the same, to 1: how wrong the light is that comes back from one in place of the other, the place
// being the same. Which side is the front does not matter.
float unlike(const Plane& a, const Plane& b);

// An answer: nothing (kNoPlane), a plane, or a split between two of these.
struct Answer {
  bool split = false;
  uint32_t a = kNoPlane, b = kNoPlane;        // of a split: where the form is positive, and where not
  std::array<int8_t, kPlaces + 1> weights{};  // of the places and 1, up to kSplitWeight in size
  float loss = 0;  // share of the rays answered wrongly, by FitOptions, in part of rays that chose nothing
};

struct FitOptions {
  bool splits = true;
  // Against a wrong answer:
  float depth_weight = 0.25f;  // of a depth error of a quarter of a cell's edge and more
  float look_weight = 1.0f;    // of a surface that looks entirely different; 0: looks do not matter
};

constexpr int kSplitWeight = 31;

// Samples in double, for a split between two answers, each an array by sample; padded.
struct SplitSamples {
  std::array<std::vector<double>, kPlaces + 1> terms;  // places and 1
  bool has_fifth = false;                              // place; else it is 0
  std::vector<double> gain;  // how much better the better answer is, 0: does not count
  std::vector<double> sign;  // 1: the first answer is the better one, -1: the second
  std::vector<double> weight;
};

// Chooses for samples, every fourth of which (of 24 and more) only measures. `near` where rays begin in the
// cell: then nothing behind the origin counts.
class AnswerFit {
 public:
  AnswerFit(const FitOptions& options, float cell_size) : options_(options), size_(cell_size) {}

  Answer choose(std::span<const Plane> planes, const ShaftSamples& samples, bool near);

 private:
  // Of the samples that choose, and of those that only measure.
  struct Sums {
    float training = 0, held = 0;
  };
  template <typename F>
  Sums sum_up(F&& loss) const;
  Sums sums(const float* losses) const;
  Sums sums_of_better(const float* first, const float* second) const;
  float loss_of(const Sums& sums) const;
  void sort_samples(size_t planes);
  void lose_by_plane(const Plane& plane, bool near, float* losses) const;
  bool choose_only(std::span<const Plane> planes, bool near, Answer& answer);
  void add_candidates(std::span<const Plane> planes, bool near);
  void add_looks(std::span<const Plane> planes);
  void gather(const float* first, const float* second);
  float fit_split(const float* first, const float* second, Answer& answer);
  // Into chosen_: what each sample loses by a split.
  void chosen(const std::array<int8_t, kPlaces + 1>& weights, const float* first, const float* second);

  FitOptions options_;
  float size_;
  const ShaftSamples* samples_ = nullptr;
  size_t count_ = 0;
  bool held_out_ = false;
  std::vector<uint32_t> candidates_;
  std::vector<float> losses_;      // by candidate and sample
  std::vector<uint32_t> met_;      // the planes that the samples meet, each once
  std::vector<char> tried_;        // by index in met_: it is a candidate, or needs not be
  std::vector<uint32_t> kind_of_;  // by plane: its index in met_
  std::vector<uint32_t> kinds_;    // by sample: its plane's index in met_
  std::vector<float> unlike_;      // by candidate's and met plane
  std::vector<float> chosen_;      // of a split that is tried, by sample
  std::vector<float> lengths_;     // of the ways of the samples
  SplitSamples split_;             // of a split that is fitted
};

}  // namespace lsp
