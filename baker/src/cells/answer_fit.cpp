#include "answer_fit.h"

#include <algorithm>
#include <cmath>

#include "lsp/layout.h"

namespace lsp {
namespace {

constexpr size_t kCandidates = 8;      // planes that are tried; more do not change the errors
constexpr float kGood = 0.02f;         // loss under which no split is tried
constexpr float kWorthTrying = 0.7f;   // a perfect choice between the two must mend this much
constexpr float kWorthKeeping = 0.8f;  // and the fitted one this much
constexpr float kDepthScale = 4.0f;    // in edges of a cell: a quarter of an edge off counts whole
constexpr int kTerms = kPlaces + 1;

using Matrix = std::array<std::array<double, kTerms + 1>, kTerms>;

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

}  // namespace

float AnswerFit::loss(std::span<const Plane> planes, const ShaftSample& s, uint32_t plane, bool near) const {
  const bool hits = s.plane != kNoPlane;
  if (plane == kNoPlane) return hits ? 1.0f : 0.0f;
  const Plane& p = planes[plane];
  float t = (p.distance - glm::dot(p.normal, s.origin)) / glm::dot(p.normal, s.way);
  const bool says = t > (near ? 0.0f : -LSP_CELL_SLACK) && t <= 1.0f + LSP_CELL_SLACK;
  if (says != hits) return 1.0f;
  if (!says) return 0.0f;
  t = std::min(std::max(t, 0.0f), 1.0f);
  const float off = std::fabs(t - s.t) * glm::length(s.way) / size_;
  return options_.depth_weight * std::min(1.0f, kDepthScale * off);
}

// Least squares of which of two answers is the better one, weighted by how much; then again with what lies
// beyond the margin weighted less.
bool AnswerFit::fit_split(std::span<const ShaftSample> samples, const float* first, const float* second,
                          Answer& answer, float& cost) const {
  std::array<double, kTerms> w{};
  cost = std::numeric_limits<float>::infinity();
  for (int pass = 0; pass < 3; ++pass) {
    Matrix m{};
    for (size_t i = 0; i < samples.size(); ++i) {
      const float gain = second[i] - first[i];  // positive: the first answer is the better one
      if (measures_only(i) || std::fabs(gain) < 1e-3f) continue;
      const double sign = gain > 0 ? 1 : -1;
      double f[kTerms];
      double value = w[kPlaces];
      for (size_t k = 0; k < kPlaces; ++k) {
        f[k] = samples[i].place[k];
        value += w[k] * f[k];
      }
      f[kPlaces] = 1;
      const double margin = sign * value;
      double weight = std::fabs(gain);
      if (pass > 0) weight *= margin < 1 ? 1 / (1 + 3 * std::max(0.0, margin)) : 0.1;
      for (size_t a = 0; a < kTerms; ++a) {
        for (size_t b = 0; b <= a; ++b) m[a][b] += weight * f[a] * f[b];
        m[a][kTerms] += weight * f[a] * sign;
      }
    }
    for (size_t a = 0; a < kTerms; ++a) {
      m[a][a] += 1e-2 * double(samples.size()) / 16;
      for (size_t b = a + 1; b < kTerms; ++b) m[a][b] = m[b][a];
    }
    if (!solve(m, w)) break;
    const auto tried = quantise(w);
    float sum = 0;
    for (size_t i = 0; i < samples.size(); ++i)
      if (!measures_only(i)) sum += split_side(tried, samples[i].place) > 0 ? first[i] : second[i];
    if (sum < cost) {
      cost = sum;
      answer.weights = tried;
    } else if (pass > 0) {
      break;
    }
  }
  return std::isfinite(cost);
}

Answer AnswerFit::choose(std::span<const Plane> planes, std::span<const ShaftSample> samples, bool near) {
  const size_t count = samples.size();
  held_out_ = count >= 24;
  Answer answer;
  candidates_.assign(1, kNoPlane);
  size_t training = 0;
  bool any = false;
  for (size_t i = 0; i < count; ++i) {
    any |= samples[i].plane != kNoPlane;
    if (measures_only(i)) continue;
    ++training;
    if (candidates_.size() <= kCandidates &&
        std::find(candidates_.begin(), candidates_.end(), samples[i].plane) == candidates_.end())
      candidates_.push_back(samples[i].plane);
  }
  if (!any) return answer;
  losses_.resize(candidates_.size() * count);
  size_t best = 0;
  float best_sum = std::numeric_limits<float>::infinity();
  for (size_t c = 0; c < candidates_.size(); ++c) {
    float sum = 0;
    for (size_t i = 0; i < count; ++i) {
      losses_[c * count + i] = loss(planes, samples[i], candidates_[c], near);
      if (!measures_only(i)) sum += losses_[c * count + i];
    }
    if (sum < best_sum) {
      best_sum = sum;
      best = c;
    }
  }
  const float* first = &losses_[best * count];
  const float* other = first;
  float trained = best_sum;
  answer.a = candidates_[best];
  if (options_.splits && best_sum > kGood * float(training)) {
    size_t second = best;
    float second_sum = best_sum, cost;
    for (size_t c = 0; c < candidates_.size(); ++c) {
      float sum = 0;
      for (size_t i = 0; i < count; ++i)
        if (!measures_only(i)) sum += std::min(first[i], losses_[c * count + i]);
      if (sum < second_sum) {
        second_sum = sum;
        second = c;
      }
    }
    const float* tried = &losses_[second * count];
    if (second_sum < kWorthTrying * best_sum && fit_split(samples, first, tried, answer, cost) &&
        cost < kWorthKeeping * best_sum) {
      answer.split = true;
      answer.b = candidates_[second];
      other = tried;
      trained = cost;
    }
  }
  float held = 0;
  for (size_t i = 0; i < count; ++i)
    if (measures_only(i))
      held += !answer.split || split_side(answer.weights, samples[i].place) > 0 ? first[i] : other[i];
  answer.loss = trained / float(training);
  if (held_out_) answer.loss = 0.5f * answer.loss + 0.5f * held / float(count - training);
  return answer;
}

}  // namespace lsp
