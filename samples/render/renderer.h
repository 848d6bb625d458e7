// Renders a picture in waves: all rays of one kind of one sample of many pixels at a time, so that the same
// code feeds a CPU's threads and a GPU. A wave is at most 131,072 pixels, so that however large the picture
// no work on a device lasts long (systems end what lasts seconds) and memory beside the picture stays the
// same.
//
//   a wave (pixels of one sample):
//     primary rays, exact --> surfaces --+--> shadow rays to sky, sun, emitters, exact      (direct)
//                                        +--> one diffuse ray, by mode --+--> light rays    (diffuse)
//                                        +--> one glossy ray, by mode  --+    by mode       (glossy)
//                                        +--> one short any-hit ray, by mode                (ao)
//
// "Errors as noise": a share p of what starts by mode is followed a second time, exactly, with the same
// random numbers, and its light becomes approximate + (exact - approximate) / p. Its mean is the exact light.
#pragma once

#include <functional>

#include "camera.h"
#include "picture.h"
#include "ray_tracer.h"

namespace lsp::sample {

enum class Effect { kDirect, kAmbientOcclusion, kDiffuse, kGlossy, kAll };

struct RenderOptions {
  Effect effect = Effect::kAll;
  lsp_trace_options indirect{};  // what indirect rays are traced with
  lsp_trace_options light{};     // those to lights from where indirect rays land
  float verify = 0.0f;           // share of indirect paths that are traced exactly, too, and correct the mean
  int width = 1280;
  int height = 720;
  uint32_t samples = 16;
  uint32_t first_sample = 0;  // the sequence's first point: pictures of several runs can be averaged
  int bounces = 1;            // of indirect light
  float ao_distance = 0.1f;   // reach of ambient occlusion, in diagonals of the scene
  bool denoise = false;       // see denoise.h
  int threads = 0;            // for shading, 0: all
};

// What was traced. "indirect": every ray that the mode governs.
struct RenderReport {
  double seconds = 0;
  uint64_t primary_rays = 0;
  double primary_seconds = 0;
  uint64_t shadow_rays = 0;  // of direct light
  double shadow_seconds = 0;
  uint64_t indirect_rays = 0;
  double indirect_seconds = 0;
  uint64_t paths = 0;           // that start by mode: diffuse, glossy or of ambient occlusion
  uint64_t verified_paths = 0;  // of them those that were traced exactly, too
  double mean_luminance = 0;
  // Of the luminance of pixels that show the scene the geometric mean, and what nine tenths of them stay
  // below; 0 where none does.
  double surface_luminance = 0;
  double bright_luminance = 0;
};

// Linear radiance (for kAmbientOcclusion: the share of the hemisphere that is open). The picture depends on
// the scene and the options alone, not on threads. kDiffuse and kGlossy show only light that has met another
// surface, or, for glossy, is mirrored: light that comes straight from sky, sun and emitters belongs to
// kDirect; kAll is their sum. `progress` is called with a number in [0, 1] and may be empty.
Picture render(const RenderScene& scene, const Sky& sky, const Camera& camera, const RenderOptions& options,
               RayTracer& tracer, RenderReport& report, const std::function<void(double)>& progress);

}  // namespace lsp::sample
