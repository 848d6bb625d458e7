// Exposure that follows the camera, as an eye does: measured beside the frames, reached little by little.
#pragma once

#include <functional>
#include <future>

#include "viewer.h"

namespace lsp::sample {

class ExposureMeter {
 public:
  // In stops, of a state's camera and effect; called from a thread of its own, one call at a time.
  using Measure = std::function<float(const ViewState&)>;

  // The exposure of `state` is taken to be right: it is measured anew once the camera or the effect is
  // another.
  ExposureMeter(const ViewState& state, Measure measure);
  // Waits for a measurement that is under way.
  ~ExposureMeter();
  ExposureMeter(const ExposureMeter&) = delete;
  ExposureMeter& operator=(const ExposureMeter&) = delete;

  // Moves state.exposure towards that of the camera, as far as the eye comes in `seconds`; what has been
  // added to it since the last call (by keys) stays added. Does not wait.
  void follow(ViewState& state, float seconds);

 private:
  Measure measure_;
  std::future<float> pending_;
  ViewState measured_;  // or under way
  float wanted_;        // stops, without what keys have added
  float reached_;
  float shown_;  // as follow left it in the state
  float added_ = 0.0f;
};

}  // namespace lsp::sample
