#include "cell_answers.h"

#include <bit>
#include <cmath>

#include "../clones.h"
#include "../vectors.h"
#include "cell_tables.h"

namespace lsp {
namespace {

constexpr float kSameDirection = 0.9999f;
constexpr float kSameDistance = 1e-3f;  // of a cell's edge
constexpr float kSameLook = 0.02f;

// Splits are numbered behind the planes, whose number is not known yet: from kSplits on for now.
constexpr uint32_t kSplits = 0x1000, kTooMany = UINT32_MAX;

constexpr size_t kLanes = 16;

// Those of kLanes normals, a bit each, that point the same way or the opposite one.
LSP_CLONES uint32_t same_directions(const float* x, const float* y, const float* z, const glm::vec3& normal) {
  uint32_t bits[kLanes];
  const float nx = normal.x, ny = normal.y, nz = normal.z;
  for (size_t i = 0; i < kLanes; ++i)
    bits[i] = std::fabs(x[i] * nx + y[i] * ny + z[i] * nz) > kSameDirection ? 1u << i : 0u;
  uint32_t all = 0;
  for (size_t i = 0; i < kLanes; ++i) all |= bits[i];
  return all;
}

}  // namespace

CellAnswers::CellAnswers(std::span<const LspTriangle> triangles, std::span<const glm::vec3> colors,
                         std::span<const uint32_t> records, const glm::vec3& centre, float cell_size)
    : triangles_(triangles),
      colors_(colors),
      records_(records),
      centre_(centre),
      size_(cell_size),
      plane_of_(records.size(), kNoPlane) {}

uint32_t CellAnswers::plane_of(uint32_t triangle) {
  uint32_t& found = plane_of_[triangle];
  if (found != kNoPlane) return found;
  const LspTriangle& t = triangles_[records_[triangle]];
  const glm::dvec3 a(vec(t.v0)), b(vec(t.v1)), c(vec(t.v2));
  const glm::dvec3 area = glm::cross(b - a, c - a);
  const double length = glm::length(area);
  const glm::dvec3 normal = length > 0 ? area / length : glm::dvec3(0, 0, 1);
  const Plane plane = {glm::vec3(normal), float(glm::dot(normal, a - glm::dvec3(centre_))),
                       colors_.empty() ? glm::vec3(0) : colors_[t.material]};
  for (size_t first = 0; first < planes_.size(); first += kLanes) {
    uint32_t rest =
        same_directions(&normals_[0][first], &normals_[1][first], &normals_[2][first], plane.normal);
    for (; rest != 0; rest &= rest - 1) {
      const auto k = uint32_t(first) + uint32_t(std::countr_zero(rest));
      const float same = glm::dot(planes_[k].normal, plane.normal);
      if (unlike(planes_[k], plane) < kSameLook &&
          std::fabs(planes_[k].distance - std::copysign(plane.distance, plane.distance * same)) <
              kSameDistance * size_ &&
          (triangles_[plane_records_[k]].flags ^ t.flags) >> LSP_TRIANGLE_GAPS_SHIFT == 0)
        return found = k;
    }
  }
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<float>& normals = normals_[size_t(axis)];
    if (planes_.size() == normals.size()) normals.resize(normals.size() + kLanes);
    normals[planes_.size()] = plane.normal[axis];
  }
  planes_.push_back(plane);
  plane_records_.push_back(records_[triangle]);
  return found = uint32_t(planes_.size() - 1);
}

uint16_t CellAnswers::encode(const Answer& answer) {
  const uint32_t number = number_of(answer);
  if (number == kTooMany) {
    overflow_ = true;
    return uint16_t(LSP_ANSWER_EMPTY | LSP_LOSS_UNKNOWN << LSP_LOSS_SHIFT);
  }
  return uint16_t(number | loss_class(answer.loss) << LSP_LOSS_SHIFT);
}

// What an answer is written as: a plane, a split, or LSP_ANSWER_EMPTY.
uint32_t CellAnswers::number_of(const Answer& answer) {
  const auto plane = [](uint32_t p) {
    return p == kNoPlane ? uint32_t(LSP_ANSWER_EMPTY) : p < kSplits ? p : kTooMany;
  };
  const uint32_t a = plane(answer.a), b = plane(answer.b);
  if (a == kTooMany || b == kTooMany) return kTooMany;
  if (!answer.split) return a;
  const auto bits = [&](size_t k) { return uint32_t(answer.weights[k]) & 0x3Fu; };
  LspSplit packed{(a & LSP_SPLIT_MASK) | (b & LSP_SPLIT_MASK) << 12 | bits(kPlaces) << 24, 0};
  for (size_t k = 0; k < kPlaces; ++k) packed.weights |= bits(k) << 6 * k;
  const auto [it, added] =
      split_numbers_.try_emplace(uint64_t(packed.weights) << 32 | packed.answers, uint32_t(splits_.size()));
  if (added) {
    if (splits_.size() >= LSP_ANSWER_LIMIT - kSplits) {
      split_numbers_.erase(it);
      return kTooMany;
    }
    splits_.push_back(packed);
  }
  return kSplits + it->second;
}

void CellAnswers::finish(std::vector<uint16_t>& far, std::vector<uint16_t>& origin) {
  std::vector<uint32_t> number(planes_.size(), kNoPlane);
  std::vector<Plane> planes;
  std::vector<uint32_t> records;
  const auto keep = [&](uint32_t plane) {
    if (number[plane] == kNoPlane) {
      number[plane] = uint32_t(planes.size());
      planes.push_back(planes_[plane]);
      records.push_back(plane_records_[plane]);
    }
    return number[plane];
  };
  for (auto* table : {&far, &origin})
    for (uint16_t& e : *table)
      if (const uint32_t answer = e & LSP_ANSWER_MASK; answer < kSplits)
        e = uint16_t((e & ~LSP_ANSWER_MASK) | keep(answer));
  const auto side = [&](uint32_t answer) { return answer == LSP_SPLIT_EMPTY ? answer : keep(answer); };
  for (LspSplit& s : splits_) {
    const uint32_t a = side(s.answers & LSP_SPLIT_MASK), b = side(s.answers >> 12 & LSP_SPLIT_MASK);
    s.answers = (s.answers & 0xFF000000u) | a | b << 12;
  }
  for (auto* table : {&far, &origin})
    for (uint16_t& e : *table) {
      const uint32_t answer = e & LSP_ANSWER_MASK;
      if (answer >= kSplits && answer < LSP_ANSWER_LIMIT)
        e = uint16_t((e & ~LSP_ANSWER_MASK) | (answer - kSplits + uint32_t(planes.size())));
    }
  planes_ = std::move(planes);
  plane_records_ = std::move(records);
}

}  // namespace lsp
