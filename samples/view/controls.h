// Keys and mouse: flies the camera, moves the line between the halves, turns the dial.
#pragma once

#include "viewer.h"

namespace lsp::sample {

// What --help and the README say of them.
extern const char* const kControlsHelp;

class Controls {
 public:
  // Listens to the window; `diagonal` of the scene sets the speed of flight. The window must outlive it.
  Controls(GLFWwindow* window, const Camera& camera, float diagonal);

  // Applies what has happened since the last call to the state. True while something moves.
  bool apply(ViewState& state);

 private:
  static void on_key(GLFWwindow* window, int key, int scan_code, int action, int mods);
  static void on_scroll(GLFWwindow* window, double x, double y);
  bool fly(ViewState& state, float seconds);
  bool drag(ViewState& state);
  void press(ViewState& state, int key);
  bool is_down(int key) const;

  GLFWwindow* window_;
  glm::vec3 direction() const;

  glm::mat3 axes_;  // of the world: right, up, towards the viewer
  float yaw_rad_ = 0.0f;
  float pitch_rad_ = 0.0f;
  float speed_;  // units a second
  double last_seconds_;
  double mouse_[2] = {};
  enum class Drag { kNone, kLook, kLine } drag_ = Drag::kNone;
  std::vector<int> pressed_;  // keys since the last call
};

// Max loss one step looser or stricter than `percent`.
float next_max_loss(float percent, bool looser);

}  // namespace lsp::sample
