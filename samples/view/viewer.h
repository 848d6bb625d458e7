// What the window shows: samples of a state are added up for as long as it stays the same.
#pragma once

#include <functional>

#include "camera.h"
#include "path_tracer.h"
#include "swapchain.h"

namespace lsp::sample {

struct ViewState {
  Camera camera;
  uint32_t effect = VIEW_LIGHT;
  float split = 0.5f;               // of the window's width: left of it exact
  lsp_trace_options approximate{};  // right of it
  float ao_distance = 0.1f;         // in diagonals of the scene
  float exposure = 0.0f;            // stops

  // Whether samples of the one can be added to those of the other: they may be shown differently.
  bool same_samples(const ViewState& other) const;
};

// Of all samples of a state; times, rays and steps but of slices for which shaders had to be compiled.
struct ViewReport {
  uint32_t samples = 0;
  uint32_t scale = 1;        // pixels of the window along an edge of one that was traced
  double seconds[2] = {};    // in the shaders of indirect light, by half (VIEW_EXACT, VIEW_APPROXIMATE)
  uint64_t rays[2] = {};     // of it
  uint64_t steps[2] = {};    // with VIEW_HEAT
  uint64_t incomplete = 0;   // rays that the device cut short: they bring no light
  double frame_seconds = 0;  // of the last sample, wall clock
  // 1e6 rays a second of a half; 0 where the device has no time stamps or the half no rays.
  double mrays(uint32_t part) const {
    return seconds[part] > 0 ? 1e-6 * static_cast<double>(rays[part]) / seconds[part] : 0;
  }
};

class Viewer {
 public:
  // All must outlive the viewer.
  Viewer(Gpu& gpu, GLFWwindow* window, const RenderScene& scene, const Sky& sky);

  // Traces a sample of every pixel and shows the mean of all since the state last changed. `moving`: with
  // fewer, larger pixels where the device is too slow for a smooth picture. Between slices `interrupted` is
  // asked; where it answers true the sample ends there, without being shown. False: nothing was shown.
  bool frame(const ViewState& state, bool moving, const std::function<bool()>& interrupted = {});

  const ViewReport& report() const { return report_; }

  // The window's picture, as bytes of red, green, blue and alpha, rows from the top; shows it once more.
  struct Screenshot {
    int width = 0;
    int height = 0;
    std::vector<uint8_t> rgba;
  };
  Screenshot screenshot();

 private:
  VkExtent2D window_size() const;
  bool fit_window();
  void restart(const ViewState& state, uint32_t scale);
  bool trace_sample(const std::function<bool()>& interrupted);
  uint32_t scale_for(bool moving) const;

  Gpu& gpu_;
  GLFWwindow* window_;
  const RenderScene& scene_;
  Sky sky_;
  DeviceScene device_scene_;
  PathTracer tracer_;
  Swapchain swapchain_;
  VkExtent2D extent_{};  // of what is shown; 0: there is nothing to show on
  VkExtent2D fitted_{};  // size of the window then
  ViewState state_;
  ViewFrame frame_{};
  ViewReport report_;
  double seconds_per_pixel_ = 0;  // of the last slice; 0: not known
};

}  // namespace lsp::sample
