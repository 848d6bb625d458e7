// What rays have hit, until it is answered in the caller's terms: for trace_wide_lanes.cpp and
// trace_cells_wide.cpp.
#if defined(LSP_WIDE_FOUND_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef LSP_WIDE_FOUND_INL_H
#undef LSP_WIDE_FOUND_INL_H
#else
#define LSP_WIDE_FOUND_INL_H
#endif

#include "wide_vectors-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lsp {
namespace HWY_NAMESPACE {

// A value a ray, of `count` rays, and as many more as make whole vectors.
struct FoundArrays {
  size_t count;
  const uint32_t *ray, *triangle, *flags;
  const float *t, *u, *v;
};

// What the rays were traced in, and where they and their answers are, from number 0 on.
struct Answered {
  const lsp_scene& scene;
  const LspRay* rays;
  LspHit* hits;
  uint32_t count;
  bool occlusion;  // only whether there is a hit matters
  bool cells;
};

// lsp_finish (lsp/traverse.h), in wide_finish.cpp.
void finish(const Answered& of, const FoundArrays& found);

namespace {

template <size_t kMost>
class Found {
 public:
  size_t size() const { return n_; }

  // Of valid ray `ray`, with weights u and v, or LSP_HIT_LINE_SPACE among the flags: then they are those of
  // the plane at t. Asks for what finish() reads.
  HWY_INLINE void add(const lsp_scene& scene, uint32_t ray, uint32_t triangle, float t, float u, float v,
                      uint32_t flags) {
    fetch(scene.triangles, triangle);
    if (scene.normals != nullptr) fetch(scene.normals, triangle);
    ray_[n_] = ray;
    triangle_[n_] = triangle;
    t_[n_] = t;
    u_[n_] = u;
    v_[n_] = v;
    flags_[n_++] = flags;
  }

  void answer(const Answered& of) {
    if (n_ != 0) finish(of, {n_, ray_, triangle_, flags_, t_, u_, v_});
    n_ = 0;
  }

 private:
  template <typename T>
  using Of = T[kMost + kLanes];

  size_t n_ = 0;
  Of<uint32_t> ray_, triangle_, flags_;
  Of<float> t_, u_, v_;
};

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace lsp
HWY_AFTER_NAMESPACE();

#endif
