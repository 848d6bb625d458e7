// Cutting a polygon in the plane into triangles, ear by ear.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "import/corner_tree.h"

namespace lsp {

enum class EarCut {
  kRight,    // the triangles fill the outline
  kCrossed,  // the outline crosses itself, no cut fills it; this one is as good as another
  kGaveUp,   // the work allowed was used up, what was left is a fan
};

// Ear clipping (Meisters 1975) for outlines that may touch themselves: bridges to holes, repeated corners,
// corners on edges. A corner that is found not to be an ear waits for the corner that is in its way, so that
// none is tried in vain; those that may be in the way lie in a tree. Some n log n for what people draw.
class EarClipper {
 public:
  // Appends corners.size() - 2 triangles of corner numbers to `out`. The outline is counter-clockwise. `work`
  // is what is left of the number of steps allowed: nodes and corners of the tree that are looked at.
  EarCut cut(std::span<const glm::dvec2> corners, std::vector<glm::uvec3>& out, uint64_t& work);

 private:
  void start();
  bool is_convex(uint32_t v) const;
  bool is_spike(uint32_t v) const;
  bool goes_into(uint32_t p, const glm::dvec2& from, const glm::dvec2& right, const glm::dvec2& left) const;
  bool blocks(uint32_t ear, uint32_t p, bool& touching) const;
  uint32_t find_blocker(uint32_t ear, bool& touching);
  void clip(uint32_t v);
  void neighbour_changed(uint32_t v);
  void release(uint32_t blocker, bool touching_only);
  uint32_t least_bad(uint32_t from);
  void enqueue(uint32_t v);

  std::span<const glm::dvec2> at_;
  std::vector<glm::uvec3>* out_ = nullptr;
  uint64_t* work_ = nullptr;
  size_t left_ = 0;  // corners of the outline that are left
  std::vector<uint32_t> next_, prev_;
  std::vector<uint8_t> alive_, queued_, touching_;
  std::vector<uint32_t> queue_;
  size_t head_ = 0;
  // Who waits for a corner: lists of entries in `waiting_`. An entry counts while waits_for_ says so too.
  struct Waiting {
    uint32_t corner, next;
  };
  std::vector<Waiting> waiting_;
  std::vector<uint32_t> first_waiting_, waits_for_;
  CornerTree obstacles_;  // the corners that are not convex
};

}  // namespace lsp
