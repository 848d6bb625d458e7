#include "answer_fit.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "../box4.h"
#include "../clones.h"
#include "lsp/layout.h"

namespace lsp {
namespace {

constexpr size_t kCandidates = 8;      // planes that are tried; more do not change the errors
constexpr float kGood = 0.02f;         // loss under which no split is tried
constexpr float kWorthTrying = 0.7f;   // a perfect choice between the two must mend this much
constexpr float kWorthKeeping = 0.8f;  // and the fitted one this much
constexpr float kDepthScale = 4.0f;    // in edges of a cell: a quarter of an edge off counts whole
constexpr size_t kHeldOut = 4;         // every fourth sample
constexpr int kTerms = kPlaces + 1;
constexpr size_t kLanes = 8;

using Form = std::array<double, kTerms>;

// Symmetric, of which the lower triangle counts, and a right-hand side.
struct Equations {
  std::array<std::array<double, kTerms>, kTerms> m{};
  Form right{};
};

// By L D L^T; the matrix is positive definite.
Form solve(Equations& e) {
  auto& m = e.m;
  Form& x = e.right;
  for (size_t i = 0; i < kTerms; ++i) {
    std::array<double, kTerms> scaled;
    for (size_t k = 0; k < i; ++k) {
      scaled[k] = m[i][k];
      for (size_t q = 0; q < k; ++q) scaled[k] -= scaled[q] * m[k][q];
    }
    for (size_t k = 0; k < i; ++k) {
      m[i][k] = scaled[k] * m[k][k];  // of the diagonal: 1 / D
      m[i][i] -= scaled[k] * m[i][k];
      x[i] -= m[i][k] * x[k];
    }
    m[i][i] = 1 / m[i][i];
  }
  for (size_t i = kTerms; i-- > 0;) {
    x[i] *= m[i][i];
    for (size_t k = i + 1; k < kTerms; ++k) x[i] -= m[k][i] * x[k];
  }
  return x;
}

std::array<int8_t, kTerms> quantise(const Form& weights) {
  double largest = 0;
  for (double w : weights) largest = std::max(largest, std::fabs(w));
  std::array<int8_t, kTerms> out{};
  if (!(largest > 0)) return out;
  for (size_t k = 0; k < kTerms; ++k) out[k] = int8_t(std::lround(weights[k] / largest * kSplitWeight));
  return out;
}

// Not std::min, see ShaftRaster.
constexpr float lesser(float a, float b) { return b < a ? b : a; }

LSP_CLONES void lengths_of(const ShaftSamples& s, float* lengths) {
  const float *x = s.way[0], *y = s.way[1], *z = s.way[2];
  const size_t count = s.count;
  for (size_t i = 0; i < count; ++i) lengths[i] = std::sqrt(x[i] * x[i] + y[i] * y[i] + z[i] * z[i]);
}

// What each sample loses where the answer is `plane`.
LSP_CLONES void plane_losses(const ShaftSamples& s, const float* lengths, const Plane& plane, float t_least,
                             float depth_weight, float per_size, float* losses) {
  const glm::vec3 n = plane.normal;
  const float distance = plane.distance, depth_scale = kDepthScale * per_size;
  const float *ox = s.origin[0], *oy = s.origin[1], *oz = s.origin[2];
  const float *wx = s.way[0], *wy = s.way[1], *wz = s.way[2];
  const float* truth = s.t;
  const uint32_t* met = s.plane;
  const float turn = s.reversed ? 1.0f : 0.0f, sign = s.reversed ? -1.0f : 1.0f;
  const size_t count = s.count;
  for (size_t i = 0; i < count; ++i) {
    const float along = n.x * wx[i] + n.y * wy[i] + n.z * wz[i];
    const float t = turn + sign * ((distance - (n.x * ox[i] + n.y * oy[i] + n.z * oz[i])) / along);
    const bool says = (t > t_least) & (t <= 1.0f + LSP_CELL_SLACK);
    const bool hits = met[i] != kNoPlane;
    const float low = t < 0.0f ? 0.0f : t, clamped = low > 1.0f ? 1.0f : low;
    const float off = std::fabs(clamped - truth[i]) * lengths[i] * depth_scale;
    const float depth = depth_weight * (off < 1.0f ? off : 1.0f);
    const float loss = says ? depth : 0.0f;
    losses[i] = says != hits ? 1.0f : loss;
  }
}

// Adds to a candidate's losses what the kind of thing that each sample meets costs.
LSP_CLONES void add_unlike(const float* by_kind, const uint32_t* kinds, size_t count, float* losses) {
  for (size_t i = 0; i < count; ++i) losses[i] = lesser(1.0f, losses[i] + by_kind[kinds[i]]);
}

// What each sample loses where a linear form of its place chooses between two answers.
LSP_CLONES void split_losses(const ShaftSamples& s, const std::array<float, kTerms>& w, const float* first,
                             const float* second, float* losses) {
  static_assert(kPlaces == 5);
  const float *p0 = s.place[0], *p1 = s.place[1], *p2 = s.place[2], *p3 = s.place[3];
  const float *p4 = s.place[4] ? s.place[4] : p0, w4 = s.place[4] ? w[4] : 0.0f;
  const size_t count = s.count;
  for (size_t i = 0; i < count; ++i) {
    const float side = w[5] + w[0] * p0[i] + w[1] * p1[i] + w[2] * p2[i] + w[3] * p3[i] + w4 * p4[i];
    losses[i] = side > 0 ? first[i] : second[i];
  }
}

// What chooses of the samples, by which of two answers is the better one and how much. Behind the last one
// nothing counts.
LSP_CLONES void find_gains(const float* first, const float* second, size_t count, bool held_out,
                           SplitSamples& s) {
  const uint32_t held = held_out ? kHeldOut - 1 : kHeldOut;
  double *gains = s.gain.data(), *signs = s.sign.data();
  for (size_t i = 0; i < count; ++i) {
    const float gain = second[i] - first[i];  // positive: the first answer is the better one
    const float size = std::fabs(gain);
    const bool counts = (uint32_t(i) % kHeldOut != held) & (size >= 1e-3f);
    gains[i] = double(counts ? size : 0.0f);
    signs[i] = gain > 0 ? 1.0 : -1.0;
  }
}

LSP_CLONES void widen(const float* from, size_t count, double* to) {
  for (size_t i = 0; i < count; ++i) to[i] = double(from[i]);
}

// What lies beyond the margin, by the forms `w` so far, is weighted less.
LSP_CLONES void weigh(const Form& w, SplitSamples& s) {
  static_assert(kPlaces == 5);
  const double *t0 = s.terms[0].data(), *t1 = s.terms[1].data(), *t2 = s.terms[2].data(),
               *t3 = s.terms[3].data(), *t4 = s.terms[4].data(), *gains = s.gain.data(),
               *signs = s.sign.data();
  double* weights = s.weight.data();
  const double w0 = w[0], w1 = w[1], w2 = w[2], w3 = w[3], w4 = w[4], w5 = w[5];
  const size_t count = s.weight.size();
  for (size_t i = 0; i < count; ++i) {
    const double value = w5 + w0 * t0[i] + w1 * t1[i] + w2 * t2[i] + w3 * t3[i] + w4 * t4[i];
    const double margin = signs[i] * value, beyond = margin > 0.0 ? margin : 0.0;
    const double less = 1 / (1 + 3 * beyond);
    weights[i] = gains[i] * (margin < 1.0 ? less : 0.1);
  }
}

using Lane = double __attribute__((vector_size(kLanes * sizeof(double))));
[[gnu::always_inline]] inline void load(const std::vector<double>& numbers, size_t first, Lane& lane) {
  std::memcpy(&lane, &numbers[first], sizeof lane);
}
[[gnu::always_inline]] inline double sum(const Lane& lane) {
  double four[4], two[2];
  for (size_t i = 0; i < 4; ++i) four[i] = lane[i] + lane[i + 4];
  for (size_t i = 0; i < 2; ++i) two[i] = four[i] + four[i + 2];
  return two[0] + two[1];
}

// The normal equations. Sums are of kLanes lanes whatever the machine's vectors hold, so that they are the
// same everywhere. Unrolled, they stay in registers. The last term is 1, and the last place is 0 in a far
// table: no sum is taken where it is known.
LSP_CLONES void normal_equations(const SplitSamples& s, const std::vector<double>& weights, Equations& e) {
  constexpr size_t kOne = kTerms - 1, kFifth = kTerms - 2;
  Lane sums[kTerms][kTerms] = {}, right[kTerms] = {};
  const size_t count = s.weight.size();
  const bool fifth = s.has_fifth;
  for (size_t first = 0; first < count; first += kLanes) {
    Lane terms[kOne], weight, sign;
    load(weights, first, weight);
    load(s.sign, first, sign);
#pragma GCC unroll 8
    for (size_t a = 0; a < kOne; ++a) {
      if (a == kFifth && !fifth) continue;
      load(s.terms[a], first, terms[a]);
      const Lane scaled = weight * terms[a];
#pragma GCC unroll 8
      for (size_t b = 0; b <= a; ++b) sums[a][b] += scaled * terms[b];
      sums[kOne][a] += scaled;
      right[a] += scaled * sign;
    }
    sums[kOne][kOne] += weight;
    right[kOne] += weight * sign;
  }
#pragma GCC unroll 8
  for (size_t a = 0; a < kTerms; ++a) {
#pragma GCC unroll 8
    for (size_t b = 0; b <= a; ++b) e.m[a][b] = sum(sums[a][b]);
    e.right[a] = sum(right[a]);
  }
}

Float4 four_at(const float* numbers) {
  Float4 four;
  std::memcpy(&four, numbers, sizeof four);
  return four;
}

}  // namespace

float unlike(const Plane& a, const Plane& b) {
  const glm::vec3 off = glm::abs(a.color - b.color);
  const float turned = 1 - std::fabs(glm::dot(a.normal, b.normal));
  return std::min(1.0f, std::max({off.x, off.y, off.z}) + turned);
}

// Of what samples lose by `loss`, a function of the first of four. In lanes of four, the last of which is of
// the samples that only measure; behind the last sample arrays hold kHeldOut - 1 more, which do not count.
template <typename F>
AnswerFit::Sums AnswerFit::sum_up(F&& loss) const {
  Float4 lanes{};
  size_t i = 0;
  for (; i + kHeldOut <= count_; i += kHeldOut) lanes += loss(i);
  if (i < count_) {
    const Int4 counts = Int4{0, 1, 2, 3} < int32_t(count_ - i);
    lanes += counts ? loss(i) : Float4{};
  }
  const float three = lanes[0] + lanes[1] + lanes[2];
  return held_out_ ? Sums{three, lanes[3]} : Sums{three + lanes[3], 0};
}

AnswerFit::Sums AnswerFit::sums(const float* losses) const {
  return sum_up([&](size_t i) { return four_at(losses + i); });
}

// Where the better of two answers is given.
AnswerFit::Sums AnswerFit::sums_of_better(const float* first, const float* second) const {
  return sum_up([&](size_t i) { return lsp::lesser(four_at(first + i), four_at(second + i)); });
}

void AnswerFit::chosen(const std::array<int8_t, kTerms>& weights, const float* first, const float* second) {
  std::array<float, kTerms> w;
  for (size_t k = 0; k < kTerms; ++k) w[k] = float(weights[k]);
  split_losses(*samples_, w, first, second, chosen_.data());
}

void AnswerFit::gather(const float* first, const float* second) {
  const size_t padded = (count_ + kLanes - 1) / kLanes * kLanes;
  split_.has_fifth = samples_->place[kPlaces - 1] != nullptr;
  for (auto& terms : split_.terms) terms.assign(padded, 0);
  for (auto* numbers : {&split_.gain, &split_.sign, &split_.weight}) numbers->assign(padded, 0);
  find_gains(first, second, count_, held_out_, split_);
  for (size_t k = 0; k < kPlaces; ++k)
    if (samples_->place[k]) widen(samples_->place[k], count_, split_.terms[k].data());
  split_.terms[kPlaces].assign(padded, 1);
}

// Least squares, again with what lies beyond the margin weighted less. Returns what the best form loses.
float AnswerFit::fit_split(const float* first, const float* second, Answer& answer) {
  gather(first, second);
  Form w{};
  float cost = std::numeric_limits<float>::infinity();
  for (int pass = 0; pass < 3 && cost > 0; ++pass) {
    Equations equations;
    if (pass > 0) weigh(w, split_);
    normal_equations(split_, pass > 0 ? split_.weight : split_.gain, equations);
    for (size_t a = 0; a < kTerms; ++a) equations.m[a][a] += 1e-2 * double(count_) / 16;
    w = solve(equations);
    const auto tried = quantise(w);
    chosen(tried, first, second);
    const float sum = sums(chosen_.data()).training;
    if (sum < cost) {
      cost = sum;
      answer.weights = tried;
    } else if (pass > 0) {
      break;
    }
  }
  return cost;
}

// Into met_ and kinds_: the planes that the samples meet; into candidates_: nothing, and those that the
// samples that choose meet.
void AnswerFit::sort_samples(size_t planes) {
  met_.clear();
  tried_.clear();
  candidates_.assign(1, kNoPlane);
  kinds_.resize(count_);
  kind_of_.resize(planes + 1);  // kNoPlane last; of planes that were not met, anything
  for (size_t i = 0; i < count_; ++i) {
    const uint32_t plane = samples_->plane[i];
    uint32_t& kind = kind_of_[std::min<size_t>(plane, planes)];
    if (kind >= met_.size() || met_[kind] != plane) {
      kind = uint32_t(met_.size());
      met_.push_back(plane);
      tried_.push_back(plane == kNoPlane);
    }
    kinds_[i] = kind;
    if (tried_[kind] || (held_out_ && i % kHeldOut == kHeldOut - 1)) continue;
    tried_[kind] = true;
    if (candidates_.size() <= kCandidates) candidates_.push_back(plane);
  }
}

void AnswerFit::lose_by_plane(const Plane& plane, bool near, float* losses) const {
  plane_losses(*samples_, lengths_.data(), plane, near ? 0.0f : -LSP_CELL_SLACK, options_.depth_weight,
               1 / size_, losses);
}

// What each sample loses by each candidate.
void AnswerFit::add_candidates(std::span<const Plane> planes, bool near) {
  const ShaftSamples& s = *samples_;
  losses_.resize(candidates_.size() * count_ + kHeldOut);
  for (size_t i = 0; i < count_; ++i) losses_[i] = s.plane[i] != kNoPlane ? 1.0f : 0.0f;
  for (size_t c = 1; c < candidates_.size(); ++c)
    lose_by_plane(planes[candidates_[c]], near, &losses_[c * count_]);
  if (options_.look_weight > 0) add_looks(planes);
}

// To a candidate's losses, where it is met in place of another plane.
void AnswerFit::add_looks(std::span<const Plane> planes) {
  unlike_.resize(met_.size());
  for (size_t c = 1; c < candidates_.size(); ++c) {
    float most = 0;
    for (size_t k = 0; k < met_.size(); ++k) {
      unlike_[k] = met_[k] == kNoPlane || met_[k] == candidates_[c]
                       ? 0
                       : options_.look_weight * unlike(planes[candidates_[c]], planes[met_[k]]);
      most = std::max(most, unlike_[k]);
    }
    if (most == 0) continue;
    add_unlike(unlike_.data(), kinds_.data(), count_, &losses_[c * count_]);
  }
}

float AnswerFit::loss_of(const Sums& sums) const {
  const size_t held = held_out_ ? count_ / kHeldOut : 0, training = count_ - held;
  const float loss = sums.training / float(training);
  return held_out_ ? 0.5f * loss + 0.5f * sums.held / float(held) : loss;
}

// Where all samples meet one plane: that, unless none of them would meet it by its equation. Nothing is left
// for a split to mend.
bool AnswerFit::choose_only(std::span<const Plane> planes, bool near, Answer& answer) {
  losses_.resize(count_ + kHeldOut);
  lose_by_plane(planes[met_[0]], near, losses_.data());
  const Sums lost = sums(losses_.data());
  const size_t training = count_ - (held_out_ ? count_ / kHeldOut : 0);
  if (!(lost.training < float(training))) return false;
  answer.a = met_[0];
  answer.loss = loss_of(lost);
  return true;
}

Answer AnswerFit::choose(std::span<const Plane> planes, const ShaftSamples& samples, bool near) {
  Answer answer;
  samples_ = &samples;
  count_ = samples.count;
  if (std::all_of(samples.plane, samples.plane + count_, [](uint32_t p) { return p == kNoPlane; }))
    return answer;
  held_out_ = count_ >= 24;
  sort_samples(planes.size());
  lengths_.resize(count_);
  lengths_of(samples, lengths_.data());
  if (met_.size() == 1 && choose_only(planes, near, answer)) return answer;
  chosen_.resize(count_ + kHeldOut);
  add_candidates(planes, near);
  const auto losses = [&](size_t candidate) { return &losses_[candidate * count_]; };
  const size_t training = count_ - (held_out_ ? count_ / kHeldOut : 0);
  size_t best = 0;
  Sums best_sums{std::numeric_limits<float>::infinity(), 0};
  for (size_t c = 0; c < candidates_.size(); ++c)
    if (const Sums s = sums(losses(c)); s.training < best_sums.training) {
      best_sums = s;
      best = c;
    }
  answer.a = candidates_[best];
  if (options_.splits && best_sums.training > kGood * float(training)) {
    size_t second = best;
    float second_sum = best_sums.training;
    for (size_t c = 0; c < candidates_.size(); ++c) {
      if (const float sum = sums_of_better(losses(best), losses(c)).training; sum < second_sum) {
        second_sum = sum;
        second = c;
      }
    }
    if (second_sum < kWorthTrying * best_sums.training &&
        fit_split(losses(best), losses(second), answer) < kWorthKeeping * best_sums.training) {
      answer.split = true;
      answer.b = candidates_[second];
      chosen(answer.weights, losses(best), losses(second));
      best_sums = sums(chosen_.data());
    }
  }
  answer.loss = loss_of(best_sums);
  return answer;
}

}  // namespace lsp
