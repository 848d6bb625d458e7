// Pictures that lsp-render makes for the benchmark: a bake, a camera, an effect, a way to trace.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "context.h"
#include "image.h"

namespace lsp::bench {

struct Shot {
  std::string effect = "ao";      // of lsp-render
  double radius = 0;              // of ambient occlusion, in diagonals of the scene; 0: lsp-render's own
  Camera camera;                  // its size is the picture's
  unsigned samples = 16;          // a pixel
  std::vector<std::string> mode;  // lsp-render's options that say how indirect rays are traced; none: exact
};

struct Rendered {
  Image image;         // linear light
  double seconds = 0;  // in indirect rays
};

// Throws Failure with lsp-render's own words and exit code.
Rendered render(const Context& context, const std::filesystem::path& file, const Shot& shot);

// What a picture of that effect is multiplied by to be shown and judged: 1 for ambient occlusion; for light
// so that the 95th percentile is near white, because pictures of dark scenes must show something too. 0 for a
// picture that is black.
float exposure_for(const std::string& effect, const Image& image);

// A copy of a bake whose surfaces all are polished metal, for pictures of reflections: most meshes come
// without any surface that reflects. The bake itself where it has no materials.
class Polished {
 public:
  static constexpr float kRoughness = 0.3f;

  Polished(const std::filesystem::path& file, const std::filesystem::path& folder);
  ~Polished();
  Polished(const Polished&) = delete;
  Polished& operator=(const Polished&) = delete;

  const std::filesystem::path& path() const { return copy_.empty() ? file_ : copy_; }

 private:
  std::filesystem::path file_, copy_;
};

}  // namespace lsp::bench
