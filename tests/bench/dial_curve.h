// The dial of cells as a curve of speed against error: from tables alone to nearly exact.
#pragma once

#include "context.h"

namespace lsp::bench {

// What the dial's points were found to do, of all scenes so far.
struct DialCurves {
  std::vector<Json> rows;  // of the table, exact first, then each point
  // Times the exact trace of the same file: of rays from what a camera sees, and from all surfaces.
  std::vector<Sample> camera, surface;
  // By scene: seconds of the device for the camera's exact rays.
  std::map<std::string, double> vulkan_exact;
};

// Traces the scene's cells at every point of the dial, on rays from what a camera sees and on area-weighted
// ones, against exact rays of the same file and Embree's fastest mode. Nothing of a file without cells.
void measure_dial(Context& context, SceneUnderTest& scene, DialCurves& curves);

Table dial_table(const DialCurves& curves);

}  // namespace lsp::bench
