// The pictures of run time against error.
#pragma once

#include "dial_curve.h"

namespace lsp::bench {

// Of the points of the dial of cells, and of Line Spaces, of which `best` marks the frontier of each scene.
std::vector<Plot> pareto_plots(const Context& context, const DialCurves& dial,
                               const std::vector<Sample>& line_spaces, const std::vector<bool>& best);

}  // namespace lsp::bench
