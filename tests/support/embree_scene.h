// Embree over the same triangles: the independent ground truth, and the peer to beat.
#pragma once

#include <embree3/rtcore.h>

#include <memory>
#include <span>
#include <vector>

#include "lsp/lsp_instances.h"
#include "soup.h"

namespace lsp::bench {

enum class EmbreeMode { kRobust, kFast };

// Which of Embree's entry points answers: one ray a call, packets of 8 or 16, or streams of 1024.
enum class EmbreeCall { kSingle, kPacket8, kPacket16, kStream };

// An Embree scene whose primitive numbers are import numbers. Of a soup with gaps it has a copy, which a
// filter asks of every hit. Tracing is thread-safe.
class EmbreeScene {
 public:
  // `threads` bounds the build's threads only; 0: all. Throws Failure(kInternal) with Embree's own words.
  explicit EmbreeScene(const Soup& soup, EmbreeMode mode = EmbreeMode::kRobust, unsigned threads = 0);

  // Of instances of `assets`, as Embree has them: a scene of its own for each asset, and one over them.
  // Primitive numbers are those of one mesh of all of them: those of instance i begin at first[i].
  EmbreeScene(std::span<const Soup> assets, std::span<const lsp_instance> instances,
              std::span<const uint32_t> first, EmbreeMode mode = EmbreeMode::kRobust, unsigned threads = 0);

  // Closest hits of rays[i] into hits[i] (t, primitive, u, v; the normal is left zero), in this thread, with
  // denormals flushed to zero during the call as Embree asks for. Through instances one ray a call.
  void closest(std::span<const LspRay> rays, std::span<LspHit> hits,
               EmbreeCall call = EmbreeCall::kSingle) const;

  // Whether rays[i] hits anything: hits[i].primitive is 0 or LSP_NONE, t is 0 or infinity.
  void any(std::span<const LspRay> rays, std::span<LspHit> hits, EmbreeCall call = EmbreeCall::kSingle) const;

  // The distance from `point` to the nearest triangle, or `at_most` where none is nearer. Where triangles are
  // there in part they count as whole.
  float distance(const glm::vec3& point, float at_most) const;

  double build_seconds() const { return build_seconds_; }
  uint64_t bytes() const { return bytes_; }  // what Embree allocated, the copied triangles included
  static const char* version();              // "3.13.5"

 private:
  struct ReleaseDevice {
    void operator()(RTCDevice device) const { rtcReleaseDevice(device); }
  };
  struct ReleaseScene {
    void operator()(RTCScene scene) const { rtcReleaseScene(scene); }
  };
  void open(unsigned threads);
  std::unique_ptr<std::remove_pointer_t<RTCScene>, ReleaseScene> new_scene(EmbreeMode mode) const;
  const glm::vec3* add_triangles(RTCScene scene, const Soup& soup);
  void commit();
  LspHit to_hit(const RTCRayHit& query) const;

  std::unique_ptr<int64_t> allocated_;  // outlives the device, whose monitor adds to it
  std::unique_ptr<std::remove_pointer_t<RTCDevice>, ReleaseDevice> device_;
  std::unique_ptr<std::remove_pointer_t<RTCScene>, ReleaseScene> scene_;
  std::unique_ptr<Soup> gaps_;          // none: all is solid
  const glm::vec3* corners_ = nullptr;  // three a triangle, Embree's own copy
  std::vector<uint32_t> primitives_;    // Embree's number to import number
  struct Instance {
    uint32_t asset, first;
  };
  std::vector<Instance> instances_;  // none: there is one mesh
  std::vector<std::unique_ptr<std::remove_pointer_t<RTCScene>, ReleaseScene>> asset_scenes_;
  std::vector<std::vector<uint32_t>> asset_primitives_;
  double build_seconds_ = 0;
  uint64_t bytes_ = 0;
};

}  // namespace lsp::bench
