#include "answer_fit.h"

#include <algorithm>
#include <cmath>
#include <limits>

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
constexpr int kRow = 8;  // kTerms and a right-hand side, padded: a row is one vector

using Matrix = std::array<std::array<double, kRow>, kTerms>;

// Gauss-Jordan with partial pivoting; false where the matrix is singular.
bool solve(Matrix& m, std::array<double, kTerms>& x) {
  for (size_t i = 0; i < kTerms; ++i) {
    size_t pivot = i;
    for (size_t k = i + 1; k < kTerms; ++k)
      if (std::fabs(m[k][i]) > std::fabs(m[pivot][i])) pivot = k;
    if (std::fabs(m[pivot][i]) < 1e-12) return false;
    std::swap(m[i], m[pivot]);
    for (size_t k = i + 1; k < kTerms; ++k) {
      const double f = m[k][i] / m[i][i];
      for (size_t q = i; q <= kTerms; ++q) m[k][q] -= f * m[i][q];
    }
  }
  for (size_t i = kTerms; i-- > 0;) {
    double sum = m[i][kTerms];
    for (size_t k = i + 1; k < kTerms; ++k) sum -= m[i][k] * x[k];
    x[i] = sum / m[i][i];
  }
  return true;
}

std::array<int8_t, kTerms> quantise(const std::array<double, kTerms>& weights) {
  double largest = 0;
  for (double w : weights) largest = std::max(largest, std::fabs(w));
  std::array<int8_t, kTerms> out{};
  if (!(largest > 0)) return out;
  for (size_t k = 0; k < kTerms; ++k) out[k] = int8_t(std::lround(weights[k] / largest * kSplitWeight));
  return out;
}

// What each sample loses where the answer is `plane`.
LSP_CLONES void plane_losses(const ShaftSamples& s, const Plane& plane, float t_least, float depth_weight,
                             float per_size, float* losses) {
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
    const float length = std::sqrt(wx[i] * wx[i] + wy[i] * wy[i] + wz[i] * wz[i]);
    const float off = std::fabs(clamped - truth[i]) * length * depth_scale;
    const float depth = depth_weight * (off < 1.0f ? off : 1.0f);
    const float loss = says ? depth : 0.0f;
    losses[i] = says != hits ? 1.0f : loss;
  }
}

// The linear form of a split at each place.
LSP_CLONES void split_sides(const ShaftSamples& s, const std::array<float, kTerms>& weights, float* sides) {
  const size_t count = s.count;
  for (size_t i = 0; i < count; ++i) sides[i] = weights[kPlaces];
  for (size_t k = 0; k < kPlaces; ++k) {
    const float* place = s.place[k];
    if (!place) continue;
    const float weight = weights[k];
    for (size_t i = 0; i < count; ++i) sides[i] += weight * place[i];
  }
}

// Adds weight * terms^T (terms, sign) to the normal equations.
inline void add_equation(Matrix& m, const std::array<double, kRow>& terms, double weight) {
  for (size_t a = 0; a < kTerms; ++a) {
    const double scale = weight * terms[a];
    for (size_t b = 0; b < kRow; ++b) m[a][b] += scale * terms[b];
  }
}

// The normal equations of which of two answers is the better one, weighted by how much; after the first pass
// what lies beyond the margin, by the forms `w` so far, is weighted less.
LSP_CLONES void normal_equations(const ShaftSamples& s, const float* first, const float* second,
                                 size_t held_out, const std::array<double, kTerms>& w, bool again,
                                 Matrix& m) {
  const size_t count = s.count;
  for (size_t i = 0; i < count; ++i) {
    const float gain = second[i] - first[i];  // positive: the first answer is the better one
    if (i % kHeldOut == held_out || std::fabs(gain) < 1e-3f) continue;
    const double sign = gain > 0 ? 1 : -1;
    std::array<double, kRow> terms{};
    double value = w[kPlaces];
    for (size_t k = 0; k < kPlaces; ++k) {
      terms[k] = s.place[k] ? s.place[k][i] : 0.0;
      value += w[k] * terms[k];
    }
    terms[kPlaces] = 1;
    terms[kTerms] = sign;
    const double margin = sign * value;
    double weight = std::fabs(gain);
    if (again) weight *= margin < 1 ? 1 / (1 + 3 * std::max(0.0, margin)) : 0.1;
    add_equation(m, terms, weight);
  }
}

}  // namespace

float unlike(const Plane& a, const Plane& b) {
  const glm::vec3 off = glm::abs(a.color - b.color);
  const float turned = 1 - std::fabs(glm::dot(a.normal, b.normal));
  return std::min(1.0f, std::max({off.x, off.y, off.z}) + turned);
}

// In lanes of four, the last of which is of the samples that only measure.
AnswerFit::Sums AnswerFit::sums(const float* losses) const {
  float lanes[kHeldOut] = {};
  size_t i = 0;
  for (; i + kHeldOut <= count_; i += kHeldOut)
    for (size_t k = 0; k < kHeldOut; ++k) lanes[k] += losses[i + k];
  for (; i < count_; ++i) lanes[i % kHeldOut] += losses[i];
  const float three = lanes[0] + lanes[1] + lanes[2];
  return held_out_ ? Sums{three, lanes[3]} : Sums{three + lanes[3], 0};
}

void AnswerFit::chosen(const std::array<int8_t, kTerms>& weights, const float* first, const float* second) {
  std::array<float, kTerms> w;
  for (size_t k = 0; k < kTerms; ++k) w[k] = float(weights[k]);
  split_sides(*samples_, w, chosen_.data());
  for (size_t i = 0; i < count_; ++i) chosen_[i] = chosen_[i] > 0 ? first[i] : second[i];
}

// Least squares, again with what lies beyond the margin weighted less. Returns what the best form loses.
float AnswerFit::fit_split(const float* first, const float* second, Answer& answer) {
  std::array<double, kTerms> w{};
  float cost = std::numeric_limits<float>::infinity();
  for (int pass = 0; pass < 3 && cost > 0; ++pass) {
    Matrix m{};
    normal_equations(*samples_, first, second, held_out_ ? kHeldOut - 1 : kHeldOut, w, pass > 0, m);
    for (size_t a = 0; a < kTerms; ++a) m[a][a] += 1e-2 * double(count_) / 16;
    if (!solve(m, w)) break;
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

// Nothing, and the planes that the samples that choose meet.
void AnswerFit::add_candidates(std::span<const Plane> planes, bool near) {
  const ShaftSamples& s = *samples_;
  candidates_.assign(1, kNoPlane);
  for (size_t i = 0; i < count_ && candidates_.size() <= kCandidates; ++i)
    if (!(held_out_ && i % kHeldOut == kHeldOut - 1) &&
        std::find(candidates_.begin(), candidates_.end(), s.plane[i]) == candidates_.end())
      candidates_.push_back(s.plane[i]);
  losses_.resize(candidates_.size() * count_);
  for (size_t i = 0; i < count_; ++i) losses_[i] = s.plane[i] != kNoPlane ? 1.0f : 0.0f;
  for (size_t c = 1; c < candidates_.size(); ++c)
    plane_losses(s, planes[candidates_[c]], near ? 0.0f : -LSP_CELL_SLACK, options_.depth_weight, 1 / size_,
                 &losses_[c * count_]);
  if (options_.look_weight > 0) add_looks(planes);
}

// To a candidate's losses, where it is met in place of another plane.
void AnswerFit::add_looks(std::span<const Plane> planes) {
  const uint32_t* plane = samples_->plane;
  met_.clear();
  kinds_.resize(count_);
  for (size_t i = 0; i < count_; ++i) {
    size_t k = i > 0 && plane[i] == plane[i - 1] ? kinds_[i - 1] : 0;
    while (k < met_.size() && met_[k] != plane[i]) ++k;
    if (k == met_.size()) met_.push_back(plane[i]);
    kinds_[i] = uint32_t(k);
  }
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
    float* losses = &losses_[c * count_];
    for (size_t i = 0; i < count_; ++i) losses[i] = std::min(1.0f, losses[i] + unlike_[kinds_[i]]);
  }
}

Answer AnswerFit::choose(std::span<const Plane> planes, const ShaftSamples& samples, bool near) {
  Answer answer;
  samples_ = &samples;
  count_ = samples.count;
  if (std::all_of(samples.plane, samples.plane + count_, [](uint32_t p) { return p == kNoPlane; }))
    return answer;
  held_out_ = count_ >= 24;
  chosen_.resize(count_);
  add_candidates(planes, near);
  const auto losses = [&](size_t candidate) { return &losses_[candidate * count_]; };
  const size_t held = held_out_ ? count_ / kHeldOut : 0, training = count_ - held;
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
      const float *first = losses(best), *other = losses(c);
      for (size_t i = 0; i < count_; ++i) chosen_[i] = std::min(first[i], other[i]);
      if (const float sum = sums(chosen_.data()).training; sum < second_sum) {
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
  answer.loss = best_sums.training / float(training);
  if (held_out_) answer.loss = 0.5f * answer.loss + 0.5f * best_sums.held / float(held);
  return answer;
}

}  // namespace lsp
