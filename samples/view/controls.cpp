#include "controls.h"

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>

#include <algorithm>
#include <cmath>

namespace lsp::sample {
namespace {

constexpr float kHalfPi = 1.57079632679489662f;
constexpr float kRadPerPixel = 0.004f;
constexpr float kLosses[] = {0.0f, 0.1f, 0.2f, 0.5f, 1.0f, 2.0f, 5.0f, 10.0f, 20.0f, 50.0f, 100.0f};

}  // namespace

const char* const kControlsHelp =
    "Keys: W A S D fly, Q and E down and up, Shift faster, the wheel changes the speed; drag to look around. "
    "Right and Left, or dragging it, move the line. 1 2 3: quality fast, balanced, accurate; - and +: a "
    "smaller or larger max loss; [ and ]: lod. Tab: the next effect, H: heat. , and .: exposure. Escape "
    "ends.";

float next_max_loss(float percent, bool looser) {
  if (looser) {
    const auto* next = std::upper_bound(std::begin(kLosses), std::end(kLosses), percent);
    return next == std::end(kLosses) ? 100.0f : *next;
  }
  const auto* next = std::lower_bound(std::begin(kLosses), std::end(kLosses), percent);
  return next == std::begin(kLosses) ? 0.0f : *(next - 1);
}

Controls::Controls(GLFWwindow* window, const Camera& camera, float diagonal)
    : window_(window), axes_(axes(camera.up)), speed_(0.1f * diagonal), last_seconds_(glfwGetTime()) {
  const glm::vec3 forward = glm::transpose(axes_) * glm::normalize(camera.target - camera.eye);
  yaw_rad_ = std::atan2(forward.x, -forward.z);
  pitch_rad_ = std::asin(std::clamp(forward.y, -1.0f, 1.0f));
  glfwSetWindowUserPointer(window, this);
  glfwSetKeyCallback(window, on_key);
  glfwSetScrollCallback(window, on_scroll);
}

void Controls::on_key(GLFWwindow* window, int key, int, int action, int) {
  if (action != GLFW_RELEASE)
    static_cast<Controls*>(glfwGetWindowUserPointer(window))->pressed_.push_back(key);
}

void Controls::on_scroll(GLFWwindow* window, double, double y) {
  static_cast<Controls*>(glfwGetWindowUserPointer(window))->speed_ *=
      std::exp2(0.25f * static_cast<float>(y));
}

glm::vec3 Controls::direction() const {
  return axes_ * glm::vec3(std::cos(pitch_rad_) * std::sin(yaw_rad_), std::sin(pitch_rad_),
                           -std::cos(pitch_rad_) * std::cos(yaw_rad_));
}

bool Controls::is_down(int key) const { return glfwGetKey(window_, key) == GLFW_PRESS; }

bool Controls::fly(ViewState& state, float seconds) {
  const glm::vec3 forward = direction();
  const glm::vec3 right = axes_ * glm::vec3(std::cos(yaw_rad_), 0.0f, std::sin(yaw_rad_));
  glm::vec3 way(0.0f);
  if (is_down(GLFW_KEY_W)) way += forward;
  if (is_down(GLFW_KEY_S)) way -= forward;
  if (is_down(GLFW_KEY_D)) way += right;
  if (is_down(GLFW_KEY_A)) way -= right;
  if (is_down(GLFW_KEY_E)) way += axes_[1];
  if (is_down(GLFW_KEY_Q)) way -= axes_[1];
  const bool fast = is_down(GLFW_KEY_LEFT_SHIFT) || is_down(GLFW_KEY_RIGHT_SHIFT);
  const glm::vec3 step = way * (speed_ * seconds * (fast ? 4.0f : 1.0f));
  state.camera.eye += step;
  state.camera.target += step;

  const float aside = (is_down(GLFW_KEY_RIGHT) ? 1.0f : 0.0f) - (is_down(GLFW_KEY_LEFT) ? 1.0f : 0.0f);
  if (aside != 0) state.split = std::clamp(state.split + 0.3f * aside * seconds, 0.0f, 1.0f);
  return way != glm::vec3(0.0f) || aside != 0;
}

bool Controls::drag(ViewState& state) {
  double x = 0, y = 0;
  int width = 1, height = 1;
  glfwGetCursorPos(window_, &x, &y);
  glfwGetWindowSize(window_, &width, &height);
  const bool down = glfwGetMouseButton(window_, GLFW_MOUSE_BUTTON_LEFT) == GLFW_PRESS;
  const double line = static_cast<double>(state.split) * width;
  if (down && drag_ == Drag::kNone) drag_ = std::abs(x - line) < 8 ? Drag::kLine : Drag::kLook;
  if (!down) drag_ = Drag::kNone;
  const float right = static_cast<float>(x - mouse_[0]);
  const float below = static_cast<float>(y - mouse_[1]);
  mouse_[0] = x;
  mouse_[1] = y;
  if (drag_ == Drag::kLine) state.split = std::clamp(static_cast<float>(x / std::max(width, 1)), 0.0f, 1.0f);
  if (drag_ == Drag::kLook && (right != 0 || below != 0)) {
    yaw_rad_ += kRadPerPixel * right;
    pitch_rad_ = std::clamp(pitch_rad_ - kRadPerPixel * below, 0.01f - kHalfPi, kHalfPi - 0.01f);
    const float distance = glm::length(state.camera.target - state.camera.eye);
    state.camera.target = state.camera.eye + distance * direction();
  }
  return drag_ != Drag::kNone;
}

void Controls::press(ViewState& state, int key) {
  lsp_trace_options& options = state.approximate;
  const auto set_quality = [&](uint32_t quality) {
    options.flags &= ~LSP_TRACE_MAX_LOSS;
    options.quality = quality;
  };
  const auto turn = [&](bool looser) {
    const bool set = (options.flags & LSP_TRACE_MAX_LOSS) != 0;
    options.max_loss = next_max_loss(set ? options.max_loss : 5.0f, looser);
    options.flags |= LSP_TRACE_MAX_LOSS;
  };
  if (key == GLFW_KEY_1) set_quality(LSP_QUALITY_FAST);
  if (key == GLFW_KEY_2) set_quality(LSP_QUALITY_BALANCED);
  if (key == GLFW_KEY_3) set_quality(LSP_QUALITY_ACCURATE);
  if (key == GLFW_KEY_MINUS || key == GLFW_KEY_KP_SUBTRACT) turn(false);
  if (key == GLFW_KEY_EQUAL || key == GLFW_KEY_KP_ADD) turn(true);
  if (key == GLFW_KEY_LEFT_BRACKET) options.lod = options.lod > 0.011f ? 0.5f * options.lod : 0.0f;
  if (key == GLFW_KEY_RIGHT_BRACKET) options.lod = options.lod > 0 ? 2.0f * options.lod : 0.01f;
  if (key == GLFW_KEY_TAB) state.effect = (state.effect + 1) % (VIEW_HEAT + 1);
  if (key == GLFW_KEY_H) state.effect = state.effect == VIEW_HEAT ? VIEW_LIGHT : VIEW_HEAT;
  if (key == GLFW_KEY_COMMA) state.exposure -= 0.25f;
  if (key == GLFW_KEY_PERIOD) state.exposure += 0.25f;
  if (key == GLFW_KEY_ESCAPE) glfwSetWindowShouldClose(window_, GLFW_TRUE);
}

bool Controls::apply(ViewState& state) {
  const double now = glfwGetTime();
  const float seconds = static_cast<float>(std::min(now - last_seconds_, 0.5));
  last_seconds_ = now;
  for (const int key : pressed_) press(state, key);
  pressed_.clear();
  const bool flies = fly(state, seconds);
  return drag(state) || flies;
}

}  // namespace lsp::sample
