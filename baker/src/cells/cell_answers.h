// The answers of one cell while its tables are filled: its planes, its splits, and how entries name them.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <unordered_map>
#include <vector>

#include "answer_fit.h"
#include "lsp/layout.h"

namespace lsp {

class CellAnswers {
 public:
  // `records` are the cell's triangles, in world space; planes are seen from the cell's centre.
  // `colors` are those of materials, see Plane; empty: looks do not matter.
  CellAnswers(std::span<const LspTriangle> triangles, std::span<const glm::vec3> colors,
              std::span<const uint32_t> records, const glm::vec3& centre, float cell_size);

  // The plane of a triangle, which counts within the cell; those of coplanar ones of about the same colour
  // and with the same gaps are one. Which rays pass a triangle with gaps the tracer decides: to tables all
  // are solid.
  uint32_t plane_of(uint32_t triangle);
  std::span<const Plane> planes() const { return planes_; }

  // The entry of an answer; one of unknown loss where the cell has no number left for it.
  uint16_t encode(const Answer& answer);
  bool overflow() const { return overflow_; }

  // Drops the planes that no entry names and gives splits their numbers, in the entries of both tables, too.
  void finish(std::vector<uint16_t>& far, std::vector<uint16_t>& origin);
  const std::vector<uint32_t>& plane_records() const { return plane_records_; }
  const std::vector<LspSplit>& splits() const { return splits_; }

 private:
  uint32_t number_of(const Answer& answer);

  std::span<const LspTriangle> triangles_;
  std::span<const glm::vec3> colors_;
  std::span<const uint32_t> records_;
  glm::vec3 centre_;
  float size_;
  std::vector<uint32_t> plane_of_;  // by triangle of the cell
  std::vector<Plane> planes_;
  std::array<std::vector<float>, 3> normals_;  // of these, by axis; padded
  std::vector<uint32_t> plane_records_;
  std::vector<LspSplit> splits_;
  std::unordered_map<uint64_t, uint32_t> split_numbers_;
  bool overflow_ = false;
};

}  // namespace lsp
