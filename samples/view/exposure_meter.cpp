#include "exposure_meter.h"

#include <chrono>
#include <cmath>

namespace lsp::sample {
namespace {

constexpr float kAdaptSeconds = 0.4f;  // in which two thirds of the way are gone
constexpr float kReached = 0.01f;      // stops that nobody sees

}  // namespace

ExposureMeter::ExposureMeter(const ViewState& state, Measure measure)
    : measure_(std::move(measure)),
      measured_(state),
      wanted_(state.exposure),
      reached_(state.exposure),
      shown_(state.exposure) {}

ExposureMeter::~ExposureMeter() {
  if (pending_.valid()) pending_.wait();
}

void ExposureMeter::follow(ViewState& state, float seconds) {
  added_ += state.exposure - shown_;
  if (pending_.valid() && pending_.wait_for(std::chrono::seconds(0)) == std::future_status::ready)
    wanted_ = pending_.get();
  const bool other = !(state.camera == measured_.camera) || state.effect != measured_.effect;
  if (!pending_.valid() && other) {
    measured_ = state;
    pending_ = std::async(std::launch::async, measure_, state);
  }
  reached_ = std::abs(wanted_ - reached_) < kReached
                 ? wanted_
                 : wanted_ + (reached_ - wanted_) * std::exp(-seconds / kAdaptSeconds);
  state.exposure = shown_ = reached_ + added_;
}

}  // namespace lsp::sample
