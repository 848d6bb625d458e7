// How much brighter than its light a picture is shown, as --exposure says it.
#pragma once

#include <optional>
#include <string>

namespace lsp::sample {

// Stops; nothing: chosen by the picture, for `auto` and for an empty text where the camera is chosen, too,
// else 0. Throws lsp::Failure (kUsage).
std::optional<float> parse_exposure(const std::string& text, bool camera_given);

// Stops that bring surfaces which are too dark or too bright on average into the range that a display shows
// well; a picture within it is left alone, and where most is dark no more is given than the brightest tenth
// can take. Both as RenderReport has them.
float chosen_exposure(double surface_luminance, double bright_luminance);

}  // namespace lsp::sample
