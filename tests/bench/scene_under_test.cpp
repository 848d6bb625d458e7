#include "scene_under_test.h"

#include <algorithm>
#include <cmath>

#include "bake_cache.h"
#include "lsp/in_chunks.hpp"
#include "lsp/program.h"
#include "process.h"

namespace lsp::bench {
namespace {

// Truth for `set`, on all threads.
void find_truth(const EmbreeScene& embree, RaySet& set) {
  set.truth.resize(set.rays.size());
  const std::span<const LspRay> rays = set.rays;
  const std::span<LspHit> truth = set.truth;
  run_in_chunks(rays.size(), machine_threads(), [&](size_t first, size_t count) {
    if (set.any) {
      embree.any(rays.subspan(first, count), truth.subspan(first, count));
    } else {
      embree.closest(rays.subspan(first, count), truth.subspan(first, count));
    }
  });
}

std::string first_line(const std::string& text) { return text.substr(0, text.find('\n')); }

// What the bench adds to every set of rays from the camera's view, in diagonals of the scene.
constexpr double kOcclusionReach = 0.1;

}  // namespace

Bake line_space_bake(unsigned resolution, unsigned depth) {
  const std::string n = std::to_string(resolution), d = std::to_string(depth);
  return {"N" + n + "-D" + d, {"--resolution", n, "--depth", d}};
}

Bake ntree_bake(unsigned branching, unsigned depth, unsigned levels) {
  const std::string n = std::to_string(branching), d = std::to_string(depth), l = std::to_string(levels);
  Bake bake{"NT" + n + "-N" + n + "-D" + d, {"--base", "ntree", "--resolution", n, "--depth", d}};
  if (levels != 3) {
    bake.name += "-L" + l;
    bake.options.insert(bake.options.end(), {"--levels", l});
  }
  return bake;
}

SceneUnderTest::SceneUnderTest(const std::filesystem::path& input, const std::filesystem::path& cache,
                               const Bake& first, const std::string& name)
    : name_(name.empty() ? input.stem().string() : name),
      input_(input),
      cache_(cache),
      base_(first),
      is_file_(input.extension() == ".lsp") {
  if (!base().available) throw Failure(base().exit, input.string(), base().reason);
  const OpenFile file(base().path);
  if (!file.has_exact_tree()) {
    throw Failure(Exit::kUnsupported, input.string(),
                  "has no exact tree, so there is no truth to measure by");
  }
  soup_ = soup_of(file.scene());
  reference_ = std::make_unique<EmbreeScene>(soup_);
  camera_ = choose_camera(
      soup_, [&](auto rays, auto hits) { reference_->closest(rays, hits); }, 512, 512);
}

const Baked& SceneUnderTest::base() { return bake(base_); }

const Baked& SceneUnderTest::bake(const Bake& how) {
  const auto known = bakes_.find(how.name);
  if (known != bakes_.end()) return known->second;
  Baked baked;
  if (is_file_) {
    baked.path = input_;
    baked.available = how.name == base_.name;
    baked.reason = "the scene was given as .lsp";
    baked.file_bytes = std::filesystem::file_size(input_);
    return bakes_[how.name] = baked;
  }
  std::filesystem::create_directories(cache_);
  baked.path = cache_ / (name_ + "-" + how.name + ".lsp");
  const std::filesystem::path program = program_path("lsp-bake");
  const std::string key = bake_key(program, input_, how.options);
  if (const Json record = find_bake(baked.path, key); !record.is_null()) {
    baked.from_earlier_run = true;
    baked.seconds = record.value("seconds", 0.0);
    baked.peak_bytes = record.value("peak_bytes", uint64_t{0});
    baked.file_bytes = record.value("file_bytes", uint64_t{0});
    return bakes_[how.name] = baked;
  }
  std::vector<std::string> command = {program.string(), input_.string(), "-o", baked.path.string(),
                                      "--quiet"};
  command.insert(command.end(), how.options.begin(), how.options.end());
  const ProcessResult result = run_process(command);
  if (result.exit_code != 0) {
    baked.available = false;
    baked.exit = static_cast<Exit>(result.exit_code);
    baked.reason = result.errors.empty() ? "lsp-bake ended with exit code " + std::to_string(result.exit_code)
                                         : first_line(result.errors);
    return bakes_[how.name] = baked;
  }
  baked.seconds = result.seconds;
  baked.peak_bytes = result.peak_bytes;
  baked.file_bytes = std::filesystem::file_size(baked.path);
  remember_bake(baked.path, key, {{"seconds", baked.seconds}, {"peak_bytes", baked.peak_bytes}});
  return bakes_[how.name] = baked;
}

const RaySet& SceneUnderTest::surface(size_t count) {
  RaySet& set = surface_[count];
  if (set.rays.empty()) {
    set.name = "surface";
    set.description = "area-weighted surface points, cosine directions, shuffled";
    set.rays = surface_rays(soup_, count, 1);
    find_truth(*reference_, set);
  }
  return set;
}

std::vector<SurfacePoint> SceneUnderTest::seen(size_t count, Random& random) const {
  Camera camera = camera_;
  camera.width = camera.height = static_cast<uint32_t>(std::sqrt(static_cast<double>(count))) + 1;
  const std::vector<LspRay> rays = camera_rays(camera, random);
  std::vector<LspHit> hits(rays.size());
  reference_->closest(rays, hits);
  std::vector<SurfacePoint> points = visible_points(soup_, rays, hits);
  if (points.empty()) throw Failure(Exit::kInvalid, input_.string(), "the camera sees nothing of the scene");
  return points;
}

void SceneUnderTest::finish(RaySet& set, bool shuffled, Random& random) const {
  if (shuffled) shuffle(set.rays, random);
  set.name += shuffled ? ", shuffled" : ", ordered";
  find_truth(*reference_, set);
}

RaySet SceneUnderTest::diffuse(size_t count, bool shuffled) const {
  Random random(2);
  RaySet set{"diffuse", "cosine rays from what the camera sees", false, {}, {}};
  // Four a pixel, as a renderer would; fewer pixels hit than asked for, so more rays of each.
  const std::vector<SurfacePoint> points = seen(count / 4, random);
  set.rays = cosine_rays(soup_, points, std::max<size_t>(1, count / points.size()), random);
  finish(set, shuffled, random);
  return set;
}

RaySet SceneUnderTest::occlusion(size_t count, bool shuffled) const {
  Random random(3);
  RaySet set{"ambient occlusion", "cosine rays of a tenth of the diagonal's length, any hit", true, {}, {}};
  const std::vector<SurfacePoint> points = seen(count / 4, random);
  set.rays = cosine_rays(soup_, points, std::max<size_t>(1, count / points.size()), random,
                         kOcclusionReach * soup_.diagonal);
  finish(set, shuffled, random);
  return set;
}

RaySet SceneUnderTest::shadows(size_t count, bool shuffled) const {
  Random random(4);
  RaySet set{"shadow", "from what the camera sees to a light high up in the middle, any hit", true, {}, {}};
  const std::vector<SurfacePoint> points = seen(count / 4, random);
  const glm::dvec3 light = 0.5 * (soup_.lo + soup_.hi) + glm::dvec3(0, 0.45 * (soup_.hi.y - soup_.lo.y), 0);
  set.rays = shadow_rays(soup_, points, std::max<size_t>(1, count / points.size()), light,
                         0.02 * soup_.diagonal, random);
  if (set.rays.empty()) set.rays = cosine_rays(soup_, points, 1, random);
  finish(set, shuffled, random);
  return set;
}

}  // namespace lsp::bench
