// A scene that the benchmark measures: its input, its bakes, its truth and its rays.
#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "embree_scene.h"
#include "lsp/program.h"
#include "open_file.h"
#include "rays.h"
#include "report.h"

namespace lsp::bench {

// How a file is baked: lsp-bake's options, and a short name for tables and file names.
struct Bake {
  std::string name;                  // "N4-D9"
  std::vector<std::string> options;  // {"--resolution", "4", "--depth", "9"}
};

Bake line_space_bake(unsigned resolution, unsigned depth);

// An NTree of `branching` cells an edge and `levels` levels of nodes, Line Spaces of that resolution at
// `depth`.
Bake ntree_bake(unsigned branching, unsigned depth, unsigned levels = 3);

// What a bake cost. `available` is false where lsp-bake could not or would not.
struct Baked {
  bool available = true;
  bool from_earlier_run = false;  // found in the cache: seconds and memory are that run's
  std::string reason;             // why it is not available, lsp-bake's own words
  Exit exit = Exit::kDone;        // lsp-bake's exit code
  std::filesystem::path path;
  double seconds = 0;
  uint64_t peak_bytes = 0;
  uint64_t file_bytes = 0;
};

// Rays of one kind with their truth by Embree in robust mode.
struct RaySet {
  std::string name;
  std::string description;
  bool any = false;  // occlusion: hit or miss is all that is asked
  std::vector<LspRay> rays;
  std::vector<LspHit> truth;
};

class SceneUnderTest {
 public:
  // `input` is a mesh file, or an .lsp file, which is then measured as it is. Bakes go to `cache`. `first` is
  // baked at once to know the triangles; the default is the paper's N = 6, D = 9. `name` is what tables and
  // bakes are called by: empty, the input's stem. Throws Failure.
  SceneUnderTest(const std::filesystem::path& input, const std::filesystem::path& cache,
                 const Bake& first = line_space_bake(6, 9), const std::string& name = "");

  const std::string& name() const { return name_; }
  const std::filesystem::path& input() const { return input_; }
  bool is_file() const { return is_file_; }  // given as .lsp: there is one bake only
  const Soup& soup() const { return soup_; }
  const EmbreeScene& reference() const { return *reference_; }
  const Camera& camera() const { return camera_; }

  // Bakes once and remembers, beyond this run too (bake_cache.h); of a scene given as .lsp only base()
  // exists, others are not available.
  const Baked& bake(const Bake& how);
  const Baked& base();  // what was baked first, or the file given
  const std::map<std::string, Baked>& bakes() const { return bakes_; }  // so far, by name

  // The accuracy rays: area-weighted, cosine, shuffled. Made once per count.
  const RaySet& surface(size_t count);

  // What a renderer traces, about `count` rays: diffuse rays from what the camera sees; occlusion rays of
  // limited length; shadow rays. In the order of pixels, or shuffled.
  RaySet diffuse(size_t count, bool shuffled) const;
  RaySet occlusion(size_t count, bool shuffled) const;
  RaySet shadows(size_t count, bool shuffled) const;

 private:
  std::vector<SurfacePoint> seen(size_t count, Random& random) const;
  void finish(RaySet& set, bool shuffled, Random& random) const;

  std::string name_;
  std::filesystem::path input_, cache_;
  Bake base_;
  bool is_file_ = false;
  std::map<std::string, Baked> bakes_;
  Soup soup_;
  std::unique_ptr<EmbreeScene> reference_;
  Camera camera_;
  std::map<size_t, RaySet> surface_;
};

}  // namespace lsp::bench
