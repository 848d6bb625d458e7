#include "embree_scene.h"

#include <atomic>
#include <chrono>
#include <cstring>
#include <string>
#if defined(__SSE__)
#include <pmmintrin.h>
#include <xmmintrin.h>
#endif

#include "lsp/program.h"

namespace lsp::bench {
namespace {

// Embree's manual asks for both modes; without them incoherent rays meet denormals and slow down.
class FlushDenormals {
 public:
#if defined(__SSE__)
  FlushDenormals() : saved_(_mm_getcsr()) {
    _MM_SET_FLUSH_ZERO_MODE(_MM_FLUSH_ZERO_ON);
    _MM_SET_DENORMALS_ZERO_MODE(_MM_DENORMALS_ZERO_ON);
  }
  ~FlushDenormals() { _mm_setcsr(saved_); }

 private:
  unsigned saved_;
#endif
};

bool add_allocated(void* user, ssize_t bytes, bool) {
  std::atomic_ref(*static_cast<int64_t*>(user)).fetch_add(bytes);
  return true;
}

[[noreturn]] void fail(RTCDevice device) {
  throw Failure(Exit::kInternal, "",
                "Embree refuses: error " + std::to_string(static_cast<int>(rtcGetDeviceError(device))));
}

// Written as three 16-byte pieces, as the ray arrives: component-wise stores cost Embree a tenth of its
// speed to stalled store forwarding, and the comparison has to be fair.
struct alignas(16) Four {
  float x[4];
};
struct alignas(16) FourWords {
  uint32_t x[4];
};

void fill(RTCRay& out, const LspRay& ray) {
  Four piece;
  std::memcpy(&piece, &ray.origin, 16);
  std::memcpy(&out.org_x, &piece, 16);
  std::memcpy(&piece, &ray.direction, 16);
  const float tmax = piece.x[3];
  piece.x[3] = 0;  // Embree's time
  std::memcpy(&out.dir_x, &piece, 16);
  FourWords rest{{0, 0xFFFFFFFFu, 0, 0}};  // tfar, mask, id, flags
  std::memcpy(&rest.x[0], &tmax, 4);
  std::memcpy(&out.tfar, &rest, 16);
}

template <typename Packet>
void fill_lane(Packet& out, size_t lane, const LspRay& ray) {
  out.org_x[lane] = ray.origin.x;
  out.org_y[lane] = ray.origin.y;
  out.org_z[lane] = ray.origin.z;
  out.tnear[lane] = ray.tmin;
  out.dir_x[lane] = ray.direction.x;
  out.dir_y[lane] = ray.direction.y;
  out.dir_z[lane] = ray.direction.z;
  out.time[lane] = 0;
  out.tfar[lane] = ray.tmax;
  out.mask[lane] = 0xFFFFFFFFu;
  out.id[lane] = 0;
  out.flags[lane] = 0;
}

LspHit occlusion(float tfar) {
  const bool hit = tfar == -INFINITY;  // how Embree says "occluded"
  LspHit out{};
  out.t = hit ? 0.0f : INFINITY;
  out.primitive = hit ? 0 : LSP_NONE;
  return out;
}

template <typename Packet, size_t kWidth, typename Call>
void any_packets(std::span<const LspRay> rays, std::span<LspHit> hits, Call call) {
  for (size_t i = 0; i < rays.size(); i += kWidth) {
    Packet packet;
    alignas(64) int valid[kWidth];
    const size_t count = std::min(kWidth, rays.size() - i);
    for (size_t k = 0; k < kWidth; ++k) {
      valid[k] = k < count ? -1 : 0;
      fill_lane(packet, k, rays[i + (k < count ? k : 0)]);
    }
    call(valid, &packet);
    for (size_t k = 0; k < count; ++k) hits[i + k] = occlusion(packet.tfar[k]);
  }
}

template <typename Packet, size_t kWidth, typename Call>
void closest_packets(std::span<const LspRay> rays, std::span<LspHit> hits,
                     const std::vector<uint32_t>& primitives, Call call) {
  for (size_t i = 0; i < rays.size(); i += kWidth) {
    Packet packet;
    alignas(64) int valid[kWidth];
    const size_t count = std::min(kWidth, rays.size() - i);
    for (size_t k = 0; k < kWidth; ++k) {
      valid[k] = k < count ? -1 : 0;
      fill_lane(packet.ray, k, rays[i + (k < count ? k : 0)]);
      packet.hit.geomID[k] = RTC_INVALID_GEOMETRY_ID;
      packet.hit.instID[0][k] = RTC_INVALID_GEOMETRY_ID;
    }
    call(valid, &packet);
    for (size_t k = 0; k < count; ++k) {
      LspHit hit{INFINITY, LSP_NONE, 0, 0, {0, 0, 0}, 0};
      if (packet.hit.geomID[k] != RTC_INVALID_GEOMETRY_ID) {
        hit.t = packet.ray.tfar[k];
        hit.primitive = primitives[packet.hit.primID[k]];
        hit.u = packet.hit.u[k];
        hit.v = packet.hit.v[k];
      }
      hits[i + k] = hit;
    }
  }
}

constexpr size_t kStreamRays = 1024;

// A hit is none where the ray passes the triangle.
void drop_passed(const RTCFilterFunctionNArguments* args) {
  const Soup& soup = *static_cast<const Soup*>(args->geometryUserPtr);
  for (unsigned i = 0; i < args->N; ++i) {
    if (args->valid[i] != -1) continue;
    LspRay ray{};
    ray.origin = {RTCRayN_org_x(args->ray, args->N, i), RTCRayN_org_y(args->ray, args->N, i),
                  RTCRayN_org_z(args->ray, args->N, i)};
    ray.direction = {RTCRayN_dir_x(args->ray, args->N, i), RTCRayN_dir_y(args->ray, args->N, i),
                     RTCRayN_dir_z(args->ray, args->N, i)};
    if (passes(soup, RTCHitN_primID(args->hit, args->N, i), ray)) args->valid[i] = 0;
  }
}

// The point of the triangle a, b, c that is nearest to p, by the region of the triangle that p lies over
// (Ericson, Real-Time Collision Detection, 5.1.5).
glm::vec3 nearest_on(const glm::vec3& p, const glm::vec3& a, const glm::vec3& b, const glm::vec3& c) {
  const glm::vec3 ab = b - a, ac = c - a, ap = p - a;
  const float d1 = glm::dot(ab, ap), d2 = glm::dot(ac, ap);
  if (d1 <= 0 && d2 <= 0) return a;
  const glm::vec3 bp = p - b;
  const float d3 = glm::dot(ab, bp), d4 = glm::dot(ac, bp);
  if (d3 >= 0 && d4 <= d3) return b;
  const glm::vec3 cp = p - c;
  const float d5 = glm::dot(ab, cp), d6 = glm::dot(ac, cp);
  if (d6 >= 0 && d5 <= d6) return c;
  const float vc = d1 * d4 - d3 * d2, vb = d5 * d2 - d1 * d6, va = d3 * d6 - d5 * d4;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return a + d1 / (d1 - d3) * ab;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return a + d2 / (d2 - d6) * ac;
  if (va <= 0 && d4 >= d3 && d5 >= d6) return b + (d4 - d3) / ((d4 - d3) + (d5 - d6)) * (c - b);
  const float sum = va + vb + vc;
  return a + vb / sum * ab + vc / sum * ac;
}

bool come_nearer(RTCPointQueryFunctionArguments* args) {
  const auto* corners = static_cast<const glm::vec3*>(args->userPtr) + size_t{3} * args->primID;
  const glm::vec3 point(args->query->x, args->query->y, args->query->z);
  const float distance = glm::distance(point, nearest_on(point, corners[0], corners[1], corners[2]));
  if (!(distance < args->query->radius)) return false;
  args->query->radius = distance;
  return true;
}

}  // namespace

const char* EmbreeScene::version() { return RTC_VERSION_STRING; }

void EmbreeScene::open(unsigned threads) {
  const std::string config = threads ? "threads=" + std::to_string(threads) : "";
  device_.reset(rtcNewDevice(config.c_str()));
  if (!device_) fail(nullptr);
  rtcSetDeviceMemoryMonitorFunction(device_.get(), add_allocated, allocated_.get());
}

std::unique_ptr<std::remove_pointer_t<RTCScene>, EmbreeScene::ReleaseScene> EmbreeScene::new_scene(
    EmbreeMode mode) const {
  RTCScene scene = rtcNewScene(device_.get());
  rtcSetSceneFlags(scene, mode == EmbreeMode::kRobust ? RTC_SCENE_FLAG_ROBUST : RTC_SCENE_FLAG_NONE);
  rtcSetSceneBuildQuality(scene, RTC_BUILD_QUALITY_HIGH);
  return std::unique_ptr<std::remove_pointer_t<RTCScene>, ReleaseScene>(scene);
}

// Answers Embree's own copy of the corners.
const glm::vec3* EmbreeScene::add_triangles(RTCScene scene, const Soup& soup) {
  RTCGeometry geometry = rtcNewGeometry(device_.get(), RTC_GEOMETRY_TYPE_TRIANGLE);
  glm::vec3* vertices = nullptr;
  if (soup.size() > 0) {
    vertices = static_cast<glm::vec3*>(
        rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 12, 3 * soup.size()));
    auto* indices = static_cast<uint32_t*>(
        rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 12, soup.size()));
    if (!vertices || !indices) fail(device_.get());
    for (size_t i = 0; i < soup.size(); ++i) {
      for (size_t k = 0; k < 3; ++k) vertices[3 * i + k] = soup.corners[i][k];
    }
    for (uint32_t i = 0; i < 3 * soup.size(); ++i) indices[i] = i;
  }
  if (!soup.gaps.empty()) {
    gaps_ = std::make_unique<Soup>(soup);
    rtcSetGeometryUserData(geometry, gaps_.get());
    rtcSetGeometryIntersectFilterFunction(geometry, drop_passed);
    rtcSetGeometryOccludedFilterFunction(geometry, drop_passed);
  }
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(scene, geometry);
  rtcReleaseGeometry(geometry);
  return vertices;
}

void EmbreeScene::commit() {
  const auto start = std::chrono::steady_clock::now();
  for (const auto& asset : asset_scenes_) rtcCommitScene(asset.get());
  rtcCommitScene(scene_.get());
  build_seconds_ = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  if (rtcGetDeviceError(device_.get()) != RTC_ERROR_NONE) fail(device_.get());
  bytes_ = static_cast<uint64_t>(*allocated_);
}

EmbreeScene::EmbreeScene(const Soup& soup, EmbreeMode mode, unsigned threads)
    : allocated_(std::make_unique<int64_t>(0)), primitives_(soup.primitives) {
  open(threads);
  scene_ = new_scene(mode);
  corners_ = add_triangles(scene_.get(), soup);
  commit();
}

EmbreeScene::EmbreeScene(std::span<const Soup> assets, std::span<const lsp_instance> instances,
                         std::span<const uint32_t> first, EmbreeMode mode, unsigned threads)
    : allocated_(std::make_unique<int64_t>(0)) {
  open(threads);
  for (const Soup& soup : assets) {
    // Rays are in the asset's space there: the filter would hash others than ours.
    if (!soup.gaps.empty())
      throw Failure(Exit::kUnsupported, "", "triangles that are there in part have no instances here");
    asset_scenes_.push_back(new_scene(mode));
    add_triangles(asset_scenes_.back().get(), soup);
    asset_primitives_.push_back(soup.primitives);
  }
  scene_ = new_scene(mode);
  for (size_t i = 0; i < instances.size(); ++i) {
    const lsp_instance& instance = instances[i];
    instances_.push_back({instance.asset, first[i]});
    RTCGeometry geometry = rtcNewGeometry(device_.get(), RTC_GEOMETRY_TYPE_INSTANCE);
    rtcSetGeometryInstancedScene(geometry, asset_scenes_[instance.asset].get());
    rtcSetGeometryTransform(geometry, 0, RTC_FORMAT_FLOAT3X4_ROW_MAJOR, instance.transform);
    rtcCommitGeometry(geometry);
    rtcAttachGeometryByID(scene_.get(), geometry, static_cast<unsigned>(i));
    rtcReleaseGeometry(geometry);
  }
  commit();
}

LspHit EmbreeScene::to_hit(const RTCRayHit& query) const {
  if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) return {INFINITY, LSP_NONE, 0, 0, {0, 0, 0}, 0};
  uint32_t primitive = 0;
  if (instances_.empty()) {
    primitive = primitives_[query.hit.primID];
  } else {
    const Instance& instance = instances_[query.hit.instID[0]];
    primitive = instance.first + asset_primitives_[instance.asset][query.hit.primID];
  }
  return {query.ray.tfar, primitive, query.hit.u, query.hit.v, {0, 0, 0}, 0};
}

float EmbreeScene::distance(const glm::vec3& point, float at_most) const {
  const FlushDenormals flush;
  RTCPointQueryContext context;
  rtcInitPointQueryContext(&context);
  RTCPointQuery query{point.x, point.y, point.z, 0, at_most};
  rtcPointQuery(scene_.get(), &query, &context, come_nearer, const_cast<glm::vec3*>(corners_));
  return query.radius;
}

void EmbreeScene::closest(std::span<const LspRay> rays, std::span<LspHit> hits, EmbreeCall call) const {
  const FlushDenormals flush;
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  RTCScene scene = scene_.get();
  if (call == EmbreeCall::kPacket8) {
    closest_packets<RTCRayHit8, 8>(rays, hits, primitives_, [&](const int* valid, RTCRayHit8* packet) {
      rtcIntersect8(valid, scene, &context, packet);
    });
  } else if (call == EmbreeCall::kPacket16) {
    closest_packets<RTCRayHit16, 16>(rays, hits, primitives_, [&](const int* valid, RTCRayHit16* packet) {
      rtcIntersect16(valid, scene, &context, packet);
    });
  } else if (call == EmbreeCall::kStream) {
    auto queries = std::make_unique<RTCRayHit[]>(kStreamRays);
    for (size_t i = 0; i < rays.size(); i += kStreamRays) {
      const size_t count = std::min(kStreamRays, rays.size() - i);
      for (size_t k = 0; k < count; ++k) {
        fill(queries[k].ray, rays[i + k]);
        queries[k].hit.geomID = RTC_INVALID_GEOMETRY_ID;
        queries[k].hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
      }
      rtcIntersect1M(scene, &context, queries.get(), static_cast<unsigned>(count), sizeof(RTCRayHit));
      for (size_t k = 0; k < count; ++k) hits[i + k] = to_hit(queries[k]);
    }
  } else {
    RTCRayHit query;
    for (size_t i = 0; i < rays.size(); ++i) {
      fill(query.ray, rays[i]);
      query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
      query.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
      rtcIntersect1(scene, &context, &query);
      hits[i] = to_hit(query);
    }
  }
}

void EmbreeScene::any(std::span<const LspRay> rays, std::span<LspHit> hits, EmbreeCall call) const {
  const FlushDenormals flush;
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  RTCScene scene = scene_.get();
  if (call == EmbreeCall::kPacket8) {
    any_packets<RTCRay8, 8>(
        rays, hits, [&](const int* valid, RTCRay8* packet) { rtcOccluded8(valid, scene, &context, packet); });
  } else if (call == EmbreeCall::kPacket16) {
    any_packets<RTCRay16, 16>(rays, hits, [&](const int* valid, RTCRay16* packet) {
      rtcOccluded16(valid, scene, &context, packet);
    });
  } else if (call == EmbreeCall::kStream) {
    auto queries = std::make_unique<RTCRay[]>(kStreamRays);
    for (size_t i = 0; i < rays.size(); i += kStreamRays) {
      const size_t count = std::min(kStreamRays, rays.size() - i);
      for (size_t k = 0; k < count; ++k) fill(queries[k], rays[i + k]);
      rtcOccluded1M(scene, &context, queries.get(), static_cast<unsigned>(count), sizeof(RTCRay));
      for (size_t k = 0; k < count; ++k) hits[i + k] = occlusion(queries[k].tfar);
    }
  } else {
    RTCRay query;
    for (size_t i = 0; i < rays.size(); ++i) {
      fill(query, rays[i]);
      rtcOccluded1(scene, &context, &query);
      hits[i] = occlusion(query.tfar);
    }
  }
}

}  // namespace lsp::bench
