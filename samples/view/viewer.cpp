#include "viewer.h"

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>
#include <tuple>

namespace lsp::sample {
namespace {

constexpr float kPi = 3.14159265358979324f;
constexpr double kSliceSeconds =
    0.03;  // far from where drivers give a device up, and short enough to hear keys
constexpr double kMovingSeconds = 0.1;  // of a picture while the camera moves
constexpr uint32_t kLargestScale = 8;
constexpr float kHeatWhite = 128.0f;

auto fields(const lsp_trace_options& o) { return std::tie(o.flags, o.lod, o.quality, o.max_loss); }
// Not the exposure: samples are what they are.
auto fields(const ViewState& s) { return std::tie(s.camera, s.effect, s.split, s.ao_distance); }

void set_camera(ViewFrame& frame, const Camera& camera) {
  const glm::vec3 forward = glm::normalize(camera.target - camera.eye);
  // Straight up or down there is no other way up than towards the viewer.
  const bool level = std::abs(glm::dot(forward, camera.up)) <= 0.999f;
  const glm::vec3 world_up = level ? camera.up : axes(camera.up)[2];
  const glm::vec3 right = glm::normalize(glm::cross(forward, world_up));
  frame.eye = from_glm(camera.eye);
  frame.forward = from_glm(forward);
  frame.right = from_glm(right);
  frame.up = from_glm(glm::cross(right, forward));
  frame.half_height = std::tan(camera.fov_degrees * kPi / 360.0f);
}

void set_light(ViewFrame& frame, const Sky& sky) {
  frame.sun_direction = from_glm(sky.sun_direction);
  frame.sun_radius = sky.sun_radius_rad;
  frame.sun_irradiance = from_glm(sky.sun_irradiance);
  frame.sky_brightness = sky.brightness;
  frame.z_up = sky.up.z > 0 ? 1 : 0;
  frame.lamp_position = from_glm(sky.lamp_position);
  frame.lamp_radius = sky.lamp_radius;
  frame.lamp_intensity = from_glm(sky.lamp_intensity);
}

uint32_t divided(uint32_t size, uint32_t scale) { return (size + scale - 1) / scale; }

}  // namespace

bool ViewState::same_samples(const ViewState& other) const {
  return fields(*this) == fields(other) && fields(approximate) == fields(other.approximate);
}

Viewer::Viewer(Gpu& gpu, GLFWwindow* window, const RenderScene& scene, const Sky& sky)
    : gpu_(gpu),
      window_(window),
      scene_(scene),
      sky_(sky),
      device_scene_(gpu, scene),
      tracer_(gpu, device_scene_),
      swapchain_(gpu) {}

VkExtent2D Viewer::window_size() const {
  int width = 0, height = 0;
  glfwGetFramebufferSize(window_, &width, &height);
  return {static_cast<uint32_t>(width), static_cast<uint32_t>(height)};
}

// False: the window has no pixels at the moment.
bool Viewer::fit_window() {
  const VkExtent2D size = window_size();
  fitted_ = size;
  swapchain_.resize(size.width, size.height);
  extent_ = swapchain_.extent();
  report_.samples = 0;
  if (extent_.width == 0 || extent_.height == 0) return false;
  const uint32_t pixels = extent_.width * extent_.height;
  tracer_.reserve(std::min(pixels, tracer_.largest_picture()), pixels);
  return true;
}

// The least scale whose picture the device can hold and, while the camera moves, trace in time.
uint32_t Viewer::scale_for(bool moving) const {
  uint32_t scale = 1;
  for (; scale < kLargestScale; scale *= 2) {
    const uint64_t pixels = uint64_t{divided(extent_.width, scale)} * divided(extent_.height, scale);
    const bool in_time = !moving || static_cast<double>(pixels) * seconds_per_pixel_ < kMovingSeconds;
    if (pixels <= tracer_.largest_picture() && in_time) break;
  }
  return scale;
}

void Viewer::restart(const ViewState& state, uint32_t scale) {
  state_ = state;
  report_ = {};
  report_.scale = scale;
  frame_ = {};
  set_camera(frame_, state.camera);
  set_light(frame_, sky_);
  frame_.width = divided(extent_.width, scale);
  frame_.height = divided(extent_.height, scale);
  frame_.emitters = device_scene_.emitter_count();
  frame_.effect = state.effect;
  device_scene_.set_dial(state.approximate);
  frame_.dial = device_scene_.kind(state.approximate).dial;
  frame_.instance_count = device_scene_.instance_count();
  frame_.lod = state.approximate.lod;
  frame_.ao_reach = state.ao_distance * scene_.diagonal();
  frame_.scale = scale;
  frame_.window_width = extent_.width;
  frame_.window_height = extent_.height;
  frame_.split = static_cast<uint32_t>(
      std::lround(std::clamp(state.split, 0.0f, 1.0f) * static_cast<float>(extent_.width)));
  frame_.heat_white = kHeatWhite;
  frame_.blue_first = swapchain_.blue_first() ? 1 : 0;
}

bool Viewer::trace_sample(const std::function<bool()>& interrupted) {
  const auto start = std::chrono::steady_clock::now();
  frame_.sample_number = report_.samples;
  const uint32_t most = std::max(VIEW_SLICE_PIXELS / frame_.width, 1u);
  for (uint32_t first = 0; first < frame_.height;) {
    const double wanted = seconds_per_pixel_ > 0 ? kSliceSeconds / (seconds_per_pixel_ * frame_.width) : 16.0;
    const uint32_t rows =
        std::min({static_cast<uint32_t>(std::clamp(wanted, 4.0, 65536.0)), most, frame_.height - first});
    const SliceReport slice =
        tracer_.trace(frame_, first, rows, divided(frame_.split, frame_.scale), state_.approximate);
    first += rows;
    for (const ViewStatistics& counts : slice.counts) report_.incomplete += counts.incomplete;
    if (!slice.compiled) {
      seconds_per_pixel_ = slice.all_seconds / (static_cast<double>(rows) * frame_.width);
      for (const uint32_t part : {VIEW_EXACT, VIEW_APPROXIMATE}) {
        report_.seconds[part] += slice.seconds[part];
        report_.rays[part] += slice.counts[part].rays;
        report_.steps[part] += slice.counts[part].steps;
      }
    }
    if (first < frame_.height && interrupted && interrupted()) return false;
  }
  ++report_.samples;
  report_.frame_seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return true;
}

bool Viewer::frame(const ViewState& state, bool moving, const std::function<bool()>& interrupted) {
  const VkExtent2D size = window_size();
  const bool fits = extent_.width != 0 && size.width == fitted_.width && size.height == fitted_.height;
  if (!fits && !fit_window()) return false;
  const uint32_t scale = scale_for(moving);
  // A camera that has come to rest ends the large pixels of its movement.
  if (report_.samples == 0 || !state.same_samples(state_) || (!moving && scale != report_.scale))
    restart(state, scale);
  if (!trace_sample(interrupted)) {
    report_.samples = 0;  // rows have samples that others lack
    return false;
  }
  frame_.exposure = std::exp2(state.exposure);
  tracer_.show(frame_);
  if (swapchain_.show(tracer_.shown(), VK_NULL_HANDLE)) return true;
  extent_ = {};  // the window's images are out of date
  return false;
}

Viewer::Screenshot Viewer::screenshot() {
  if (extent_.width == 0) return {};
  const VkDeviceSize bytes = VkDeviceSize{extent_.width} * extent_.height * 4;
  const GpuBuffer copy(gpu_, bytes, VK_BUFFER_USAGE_TRANSFER_DST_BIT, Memory::kHost);
  swapchain_.show(tracer_.shown(), copy.handle());
  Screenshot shot;
  shot.width = static_cast<int>(extent_.width);
  shot.height = static_cast<int>(extent_.height);
  shot.rgba.resize(bytes);
  std::memcpy(shot.rgba.data(), copy.mapped(), bytes);
  for (size_t i = 0; i < bytes; i += 4) {
    if (swapchain_.blue_first()) std::swap(shot.rgba[i], shot.rgba[i + 2]);
    shot.rgba[i + 3] = 255;
  }
  return shot;
}

}  // namespace lsp::sample
