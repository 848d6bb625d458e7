#include "renderer.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <limits>

#include "film.h"
#include "glossy.h"
#include "sampler.h"

namespace lsp::sample {
namespace {

constexpr float kPi = 3.14159265358979324f;
constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr size_t kWavePixels = size_t{1} << 17;

// Brighter single samples are cut: they would stay as white dots. The bound is far over anything that a
// picture shows.
constexpr float kLargestSample = 20.0f;

// The light rays of a point.
enum LightSlot : size_t { kSkyLight, kSun, kEmitter, kLamp, kLightSlots };

// Pairs of random numbers a sample draws, by purpose. Bounce b adds b times kDimensionsPerBounce.
enum Dimension : uint32_t {
  kPixelPoint,
  kGlossyDirection,
  kOcclusionDirection,
  kDirectFirst,  // three: see make_light_rays
  kDiffuseDirection = kDirectFirst + 4,
  kPathLightFirst,  // three of the diffuse path, then three of the glossy one
  kDimensionsPerBounce = 12,
  // Far from every bounce's: whether a path is verified says nothing about where it goes.
  kVerifyDiffuse = 0x40000,
  kVerifyGlossy,
  kVerifyOcclusion,
};

struct Surface {
  uint32_t item = 0;  // in the wave
  SurfacePoint point;
  glm::vec3 to_eye;
};

// A path that looks for indirect light.
struct Path {
  uint32_t item;
  bool glossy;  // its first ray left along a reflection
  glm::vec3 throughput;
  float weight = 1.0f;  // of all that it brings; see Verification
};

// A ray that brings `radiance` to its item unless something is in its way.
struct LightRay {
  uint32_t item;
  Component component;
  glm::vec3 radiance;
  float weight = 1.0f;
};

// Approximate light A and exact light E of a path that is verified with probability p count as
// A + (E - A) / p = (1 - 1 / p) A + (1 / p) E, of one that is not as A: on average p E + (1 - p) A + p A - A
// = E.
struct Verification {
  float share;
  float approximate() const { return 1.0f - 1.0f / share; }
  float exact() const { return 1.0f / share; }
};

class Renderer {
 public:
  Renderer(const RenderScene& scene, const Sky& sky, const Camera& camera, const RenderOptions& options,
           RayTracer& tracer, RenderReport& report)
      : scene_(scene),
        sky_(sky),
        camera_(camera),
        options_(options),
        tracer_(tracer),
        report_(report),
        arena_(options.threads > 0 ? options.threads : tbb::task_arena::automatic),
        film_(options.width, options.height) {
    order_pixels();
  }

  Picture render(const std::function<void(double)>& progress) {
    const auto start = std::chrono::steady_clock::now();
    const size_t waves = (order_.size() + kWavePixels - 1) / kWavePixels;
    const double total = static_cast<double>(waves) * options_.samples;
    double done = 0;
    for (size_t wave = 0; wave < waves; ++wave) {
      first_ = wave * kWavePixels;
      count_ = std::min(kWavePixels, order_.size() - first_);
      for (uint32_t sample = 0; sample < options_.samples; ++sample) {
        sample_ = options_.first_sample + sample;
        for (auto& component : now_) component.assign(count_, glm::vec3(0.0f));
        render_sample();
        for_each(count_, [&](size_t i) {
          for (const Component c : {kSharp, kSmooth, kMirrored}) film_.add(order_[first_ + i], c, now_[c][i]);
        });
        done += 1;
        if (progress) progress(done / total);
      }
    }
    film_.average(options_.samples);
    const float pixel_angle_rad =
        2.0f * std::tan(camera_.fov_degrees * kPi / 360.0f) / static_cast<float>(options_.height);
    if (options_.denoise) arena_.execute([&] { film_.denoise(pixel_angle_rad); });
    Picture picture = film_.picture();
    film_.measure(picture, report_);
    report_.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    return picture;
  }

 private:
  // Pixels in blocks of 8 x 8: neighbours in a batch see the same parts of the scene.
  void order_pixels() {
    for (int by = 0; by < options_.height; by += 8) {
      for (int bx = 0; bx < options_.width; bx += 8) {
        for (int y = by; y < std::min(by + 8, options_.height); ++y) {
          for (int x = bx; x < std::min(bx + 8, options_.width); ++x) {
            order_.push_back(static_cast<uint32_t>(y * options_.width + x));
          }
        }
      }
    }
  }

  template <typename Body>
  void for_each(size_t count, const Body& body) {
    arena_.execute([&] {
      tbb::parallel_for(tbb::blocked_range<size_t>(0, count, 1024), [&](const auto& range) {
        for (size_t i = range.begin(); i < range.end(); ++i) body(i);
      });
    });
  }

  glm::vec2 random(size_t item, uint32_t dimension) const {
    const uint32_t seed = hash_combine(hash_mix(order_[first_ + item] + 0x68BC21EBu), dimension);
    return sobol_point(sample_, seed);
  }

  // Called by one thread at a time, in the order of the batch: the sums do not depend on threads. What is cut
  // is the light, before it is weighted: a cut correction would not have the right mean.
  void add(uint32_t item, Component component, glm::vec3 radiance, float weight = 1.0f) {
    const float largest = std::max({radiance.x, radiance.y, radiance.z});
    if (!(largest > 0) || !std::isfinite(largest)) return;
    now_[component][item] +=
        weight * (largest > kLargestSample ? radiance * (kLargestSample / largest) : radiance);
  }

  // Whether what starts at `item` is verified: by a hash, not by a point of the sequence, whose points are
  // spread over a pixel's samples in step with those that say where the path goes.
  bool verifies(uint32_t item, Dimension dimension) const {
    if (!(options_.verify > 0)) return false;
    const uint32_t seed = hash_combine(hash_combine(order_[first_ + item], sample_), dimension);
    return static_cast<float>(hash_mix(seed) >> 8) * 0x1p-24f < options_.verify;
  }

  bool wants(Effect effect) const { return options_.effect == effect || options_.effect == Effect::kAll; }

  void render_sample() {
    rays_.resize(count_);
    hits_.resize(count_);
    for_each(count_, [&](size_t i) {
      const uint32_t pixel = order_[first_ + i];
      const auto width = static_cast<uint32_t>(options_.width);
      const glm::vec2 corner(static_cast<float>(pixel % width), static_cast<float>(pixel / width));
      rays_[i] = camera_.ray(corner + random(i, kPixelPoint), options_.width, options_.height);
    });
    report_.primary_rays += count_;
    report_.primary_seconds += tracer_.trace({0, 0.0f}, rays_, hits_);

    surfaces_.clear();
    for (uint32_t i = 0; i < count_; ++i) {
      if (std::isfinite(hits_[i].t)) {
        surfaces_.push_back({i, {}, {}});
        film_.add_surface(order_[first_ + i]);
      } else if (options_.effect == Effect::kAmbientOcclusion) {
        add(i, kSharp, glm::vec3(1.0f));
      } else if (wants(Effect::kDirect)) {
        add(i, kSharp, sky_.radiance(to_glm(rays_[i].direction)));
      }
    }
    for_each(surfaces_.size(), [&](size_t i) {
      Surface& s = surfaces_[i];
      s.point = scene_.surface(rays_[s.item], hits_[s.item]);
      s.to_eye = -to_glm(rays_[s.item].direction);
      if (options_.denoise) keep_guides(s, hits_[s.item].t);
    });
    if (options_.effect == Effect::kAmbientOcclusion) return render_occlusion();
    if (wants(Effect::kDirect)) render_direct();
    if (options_.effect != Effect::kDirect) render_indirect();
  }

  // Primary rays have unit length, so that t is the distance. A pixel has one surface a sample.
  void keep_guides(const Surface& s, float distance) {
    const bool occlusion = options_.effect == Effect::kAmbientOcclusion;
    film_.add_guides(order_[first_ + s.item], s.point,
                     occlusion ? glm::vec3(1.0f) : s.point.base_color * (1.0f - s.point.metallic), distance);
  }

  void render_occlusion() {
    rays_.resize(surfaces_.size());
    light_.resize(surfaces_.size());
    const float reach = options_.ao_distance * scene_.diagonal();
    for_each(surfaces_.size(), [&](size_t i) {
      const Surface& s = surfaces_[i];
      const glm::vec3 direction =
          cosine_direction(s.point.shading_normal, random(s.item, kOcclusionDirection));
      rays_[i] = ray_from(s.point, above(s.point, direction), reach);
      light_[i] = {s.item, kSmooth, glm::vec3(1.0f)};
    });
    std::vector<LspRay> verified_rays;
    std::vector<LightRay> verified_light;
    const Verification verification{options_.verify};
    for (size_t i = 0; i < light_.size(); ++i) {
      if (!verifies(light_[i].item, kVerifyOcclusion)) continue;
      verified_rays.push_back(rays_[i]);
      verified_light.push_back(light_[i]);
      verified_light.back().weight = verification.exact();
      light_[i].weight = verification.approximate();
    }
    report_.paths += light_.size();
    report_.verified_paths += verified_light.size();
    trace_light(options_.indirect, true);
    rays_ = std::move(verified_rays);
    light_ = std::move(verified_light);
    trace_light({}, true);
  }

  // Light from sky, sun and emitters at the surfaces the eye sees.
  void render_direct() {
    begin_light(surfaces_.size());
    for_each(surfaces_.size(), [&](size_t i) {
      const Surface& s = surfaces_[i];
      make_light_rays(i, s.item, s.point, s.point.base_color * (1.0f - s.point.metallic), kDirectFirst,
                      kSmooth, kSharp);
    });
    end_light();
    trace_light({}, false);
    for (const Surface& s : surfaces_) add(s.item, kSharp, s.point.emission);
  }

  void render_indirect() {
    paths_.clear();
    path_rays_.clear();
    for (const Surface& s : surfaces_) {
      if (wants(Effect::kDiffuse) && s.point.metallic < 1.0f)
        paths_.push_back({s.item, false, glm::vec3(0.0f)});
    }
    const size_t diffuse = paths_.size();
    for (const Surface& s : surfaces_) {
      if (wants(Effect::kGlossy) && s.point.roughness < kRoughestGlossy)
        paths_.push_back({s.item, true, glm::vec3(0.0f)});
    }
    // Where an item's surface is.
    surface_of_item_.assign(count_, 0);
    for (uint32_t i = 0; i < surfaces_.size(); ++i) surface_of_item_[surfaces_[i].item] = i;
    path_rays_.resize(paths_.size());
    for_each(paths_.size(), [&](size_t i) {
      const Surface& s = surfaces_[surface_of_item_[paths_[i].item]];
      path_rays_[i] = i < diffuse ? start_diffuse(s, paths_[i]) : start_glossy(s, paths_[i]);
    });
    report_.paths += paths_.size();
    choose_verified();
    follow_paths(options_.indirect, options_.light);
    paths_.swap(verified_);
    path_rays_.swap(verified_rays_);
    report_.verified_paths += paths_.size();
    follow_paths({}, {});
  }

  // Copies the paths to verify with their first rays, and weights both.
  void choose_verified() {
    verified_.clear();
    verified_rays_.clear();
    const Verification verification{options_.verify};
    for (size_t i = 0; i < paths_.size(); ++i) {
      Path& path = paths_[i];
      if (!verifies(path.item, path.glossy ? kVerifyGlossy : kVerifyDiffuse)) continue;
      verified_.push_back(path);
      verified_.back().weight = verification.exact();
      verified_rays_.push_back(path_rays_[i]);
      path.weight = verification.approximate();
    }
  }

  void follow_paths(const lsp_trace_options& options, const lsp_trace_options& light) {
    for (int bounce = 0; bounce < options_.bounces && !paths_.empty(); ++bounce)
      follow_bounce(options, light, bounce);
  }

  LspRay start_diffuse(const Surface& s, Path& path) const {
    path.throughput = s.point.base_color * (1.0f - s.point.metallic);
    const glm::vec3 direction = cosine_direction(s.point.shading_normal, random(s.item, kDiffuseDirection));
    return ray_from(s.point, above(s.point, direction), kInfinity);
  }

  LspRay start_glossy(const Surface& s, Path& path) const {
    const GlossyDirection glossy = glossy_direction(s.point, s.to_eye, random(s.item, kGlossyDirection));
    path.throughput = glossy.weight;
    return ray_from(s.point, above(s.point, glossy.direction), kInfinity);
  }

  void follow_bounce(const lsp_trace_options& options, const lsp_trace_options& light, int bounce) {
    path_hits_.resize(path_rays_.size());
    report_.indirect_rays += path_rays_.size();
    report_.indirect_seconds += tracer_.trace(options, path_rays_, path_hits_);

    // Paths that met a surface go on; the others end in the sky.
    points_.resize(paths_.size());
    for_each(paths_.size(), [&](size_t i) {
      if (std::isfinite(path_hits_[i].t)) points_[i] = scene_.surface(path_rays_[i], path_hits_[i]);
    });
    size_t kept = 0;
    for (size_t i = 0; i < paths_.size(); ++i) {
      const Path path = paths_[i];
      const bool mirrored = path.glossy && bounce == 0;
      if (!std::isfinite(path_hits_[i].t)) {
        if (mirrored)
          add(path.item, kMirrored, path.throughput * sky_.radiance(to_glm(path_rays_[i].direction)),
              path.weight);
        continue;
      }
      // What a diffuse surface gets straight from an emitter is direct light already.
      if (mirrored) add(path.item, kMirrored, path.throughput * points_[i].emission, path.weight);
      paths_[kept] = path;
      points_[kept] = points_[i];
      ++kept;
    }
    paths_.resize(kept);
    points_.resize(kept);

    // Further surfaces are seen as diffuse, metals too: their mirror image of a mirror image would need
    // another ray.
    const uint32_t first = static_cast<uint32_t>(bounce) * kDimensionsPerBounce + kPathLightFirst;
    begin_light(kept);
    for_each(kept, [&](size_t i) {
      Path& path = paths_[i];
      path.throughput *= points_[i].base_color;
      const Component component = path.glossy ? kMirrored : kSmooth;
      make_light_rays(i, path.item, points_[i], path.throughput, first + (path.glossy ? 3u : 0u), component,
                      component, path.weight);
    });
    end_light();
    trace_light(light, true);

    if (bounce + 1 == options_.bounces) return;
    path_rays_.resize(kept);
    for_each(kept, [&](size_t i) {
      const uint32_t dimension = static_cast<uint32_t>(bounce + 1) * 2u * kDimensionsPerBounce +
                                 kDiffuseDirection + (paths_[i].glossy ? 0x10000u : 0u);
      const glm::vec3 direction =
          cosine_direction(points_[i].shading_normal, random(paths_[i].item, dimension));
      path_rays_[i] = ray_from(points_[i], above(points_[i], direction), kInfinity);
    });
  }

  // ---- light rays: a few slots a point, then packed together
  // ------------------------------------------

  void begin_light(size_t points) {
    slots_.resize(kLightSlots * points);
    slot_rays_.resize(kLightSlots * points);
  }

  void end_light() {
    rays_.clear();
    light_.clear();
    for (size_t i = 0; i < slots_.size(); ++i) {
      if (slots_[i].radiance == glm::vec3(0.0f)) continue;
      rays_.push_back(slot_rays_[i]);
      light_.push_back(slots_[i]);
    }
  }

  // Fills the slots of point `index`: a ray to the sky, one to the sun, to an emitter, to the lamp; a slot
  // whose light is black makes no ray. `weight`: what the point passes on of arriving light, albedo included;
  // `path_weight`: how much what arrives counts.
  void make_light_rays(size_t index, uint32_t item, const SurfacePoint& p, glm::vec3 weight,
                       uint32_t dimension, Component component, Component sun_component,
                       float path_weight = 1.0f) {
    LightRay* slot = &slots_[kLightSlots * index];
    LspRay* ray = &slot_rays_[kLightSlots * index];
    for (size_t i = 0; i < kLightSlots; ++i) {
      const bool small = i == kSun || i == kLamp;
      slot[i] = {item, small ? sun_component : component, glm::vec3(0.0f), path_weight};
    }

    const glm::vec3 toward_sky = above(p, cosine_direction(p.shading_normal, random(item, dimension)));
    slot[kSkyLight].radiance = weight * sky_.radiance(toward_sky);
    ray[kSkyLight] = ray_from(p, toward_sky, kInfinity);

    glm::vec3 t;
    glm::vec3 b;
    make_frame(sky_.sun_direction, t, b);
    const glm::vec2 disc = random(item, dimension + 1);
    const float r = std::sqrt(disc.x) * sky_.sun_radius_rad;
    const glm::vec3 toward_sun = glm::normalize(sky_.sun_direction + r * std::cos(2.0f * kPi * disc.y) * t +
                                                r * std::sin(2.0f * kPi * disc.y) * b);
    const float sun_cosine = glm::dot(toward_sun, p.shading_normal);
    if (sun_cosine > 0 && glm::dot(toward_sun, p.geometric_normal) > 0) {
      slot[kSun].radiance = weight * sky_.sun_irradiance * (sun_cosine / kPi);
      ray[kSun] = ray_from(p, toward_sun, kInfinity);
    }

    if (sky_.lamp_intensity != glm::vec3(0.0f))
      make_lamp_ray(slot[kLamp], ray[kLamp], p, weight, dimension + 2);
    if (scene_.has_emitters()) make_emitter_ray(slot[kEmitter], ray[kEmitter], p, weight, dimension + 2);
  }

  // A ray to a point in the lamp's ball.
  void make_lamp_ray(LightRay& slot, LspRay& ray, const SurfacePoint& p, glm::vec3 weight,
                     uint32_t dimension) const {
    const glm::vec2 u = random(slot.item, dimension + 0x30000u);
    const float z = 1.0f - 2.0f * u.x;
    const float r = std::sqrt(std::max(1.0f - z * z, 0.0f));
    const glm::vec3 on_ball(r * std::cos(2.0f * kPi * u.y), z, r * std::sin(2.0f * kPi * u.y));
    const glm::vec3 origin = lifted(p);
    const glm::vec3 way = sky_.lamp_position + sky_.lamp_radius * on_ball - origin;
    const float distance2 = glm::dot(way, way);
    if (!(distance2 > 0)) return;
    const float cosine = glm::dot(way, p.shading_normal) / std::sqrt(distance2);
    if (cosine <= 0 || glm::dot(way, p.geometric_normal) <= 0) return;
    slot.radiance = weight * sky_.lamp_intensity * (cosine / (distance2 * kPi));
    ray = {from_glm(origin), 0.0f, from_glm(way), 1.0f};
  }

  // A ray to one of a few candidate points on emitters, chosen by the light it would bring if nothing were in
  // the way (resampled importance sampling, Talbot et al. 2005): of many lamps most are far.
  void make_emitter_ray(LightRay& slot, LspRay& ray, const SurfacePoint& p, glm::vec3 weight,
                        uint32_t dimension) const {
    constexpr uint32_t kCandidates = 8;
    const glm::vec3 origin = lifted(p);
    float total = 0.0f;
    glm::vec3 chosen_way(0.0f);
    glm::vec3 chosen_light(0.0f);
    float chosen_value = 0.0f;
    float pick = random(slot.item, dimension).x;
    uint32_t state = hash_combine(hash_combine(order_[first_ + slot.item], sample_), dimension);
    const auto next = [&state] {
      state = hash_mix(state + 0x9E3779B9u);
      return static_cast<float>(state >> 8) * (1.0f / 16777216.0f);
    };
    for (uint32_t i = 0; i < kCandidates; ++i) {
      const float chance = next();
      const float x = next();
      const EmitterPoint emitter = scene_.sample_emitter(chance, {x, next()});
      const glm::vec3 way = emitter.position - origin;
      const float distance2 = glm::dot(way, way);
      if (!(distance2 > 0) || !(emitter.pdf > 0)) continue;
      const glm::vec3 direction = way / std::sqrt(distance2);
      const float here = glm::dot(direction, p.shading_normal);
      const float there = std::abs(glm::dot(direction, emitter.normal));
      if (here <= 0 || glm::dot(direction, p.geometric_normal) <= 0) continue;
      const glm::vec3 light = emitter.radiance * (here * there / (distance2 * kPi));
      const float value = std::max({light.x, light.y, light.z});
      const float share = value / emitter.pdf;
      if (!(share > 0) || !std::isfinite(share)) continue;
      total += share;
      // One random number serves all choices: what is left of it after a choice is uniform again.
      const float keep = share / total;
      if (pick < keep) {
        pick /= keep;
        chosen_way = way;
        chosen_light = light;
        chosen_value = value;
      } else {
        pick = (pick - keep) / (1.0f - keep);
      }
    }
    if (!(chosen_value > 0)) return;
    slot.radiance = weight * chosen_light * (total / (static_cast<float>(kCandidates) * chosen_value));
    // Ends just short of the emitter; t counts in lengths of the way.
    ray = {from_glm(origin), 0.0f, from_glm(chosen_way), 0.999f};
  }

  void trace_light(lsp_trace_options options, bool indirect) {
    if (rays_.empty()) return;
    hits_.resize(rays_.size());
    options.flags |= LSP_TRACE_OCCLUSION;
    const double seconds = tracer_.trace(options, rays_, hits_);
    (indirect ? report_.indirect_rays : report_.shadow_rays) += rays_.size();
    (indirect ? report_.indirect_seconds : report_.shadow_seconds) += seconds;
    for (size_t i = 0; i < light_.size(); ++i) {
      if (!std::isfinite(hits_[i].t))
        add(light_[i].item, light_[i].component, light_[i].radiance, light_[i].weight);
    }
  }

  const RenderScene& scene_;
  const Sky& sky_;
  const Camera& camera_;
  const RenderOptions& options_;
  RayTracer& tracer_;
  RenderReport& report_;
  tbb::task_arena arena_;
  Film film_;
  std::vector<uint32_t> order_;

  // The wave's state, kept from sample to sample for its memory.
  size_t first_ = 0;
  size_t count_ = 0;
  uint32_t sample_ = 0;
  std::array<std::vector<glm::vec3>, kComponents> now_;  // the sample's radiance by item
  std::vector<LspRay> rays_;
  std::vector<LspHit> hits_;
  std::vector<Surface> surfaces_;
  std::vector<uint32_t> surface_of_item_;
  std::vector<Path> paths_;
  std::vector<LspRay> path_rays_;
  std::vector<Path> verified_;
  std::vector<LspRay> verified_rays_;
  std::vector<LspHit> path_hits_;
  std::vector<SurfacePoint> points_;
  std::vector<LightRay> slots_;
  std::vector<LspRay> slot_rays_;
  std::vector<LightRay> light_;
};

}  // namespace

Picture render(const RenderScene& scene, const Sky& sky, const Camera& camera, const RenderOptions& options,
               RayTracer& tracer, RenderReport& report, const std::function<void(double)>& progress) {
  return Renderer(scene, sky, camera, options, tracer, report).render(progress);
}

}  // namespace lsp::sample
