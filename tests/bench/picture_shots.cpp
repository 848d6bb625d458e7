#include "picture_shots.h"

#include <algorithm>
#include <cstdio>
#include <fstream>

#include "process.h"

namespace lsp::bench {
namespace {

std::string camera_option(const Camera& camera) {
  char text[256];
  std::snprintf(text, sizeof text, "--camera=%.9g,%.9g,%.9g:%.9g,%.9g,%.9g:%.9g", camera.eye.x, camera.eye.y,
                camera.eye.z, camera.target.x, camera.target.y, camera.target.z, camera.fov_degrees);
  return text;
}

// Where the materials of a raw file lie, and how many there are.
std::pair<uint64_t, uint32_t> materials_of(const std::filesystem::path& path) {
  const OpenFile file(path);
  const lsp_scene& scene = file.scene();
  if (!scene.materials) return {0, 0};
  const auto first = static_cast<uint64_t>(reinterpret_cast<const char*>(scene.materials) -
                                           static_cast<const char*>(scene.bytes));
  return {first, scene.header->material_count};
}

}  // namespace

Rendered render(const Context& context, const std::filesystem::path& file, const Shot& shot) {
  const auto path = context.cache / "picture.pfm";
  std::vector<std::string> command = {
      program_path("lsp-render").string(),
      file.string(),
      "-o",
      path.string(),
      "--effect",
      shot.effect,
      "--samples",
      std::to_string(shot.samples),
      "--size",
      std::to_string(shot.camera.width) + "x" + std::to_string(shot.camera.height),
      "--threads",
      std::to_string(context.threads),
      camera_option(shot.camera),
      "--quiet",
      "--json"};
  if (shot.radius > 0) command.insert(command.end(), {"--radius", std::to_string(shot.radius)});
  command.insert(command.end(), shot.mode.begin(), shot.mode.end());
  const ProcessResult result = run_process(command);
  if (result.exit_code != 0) {
    throw Failure(static_cast<Exit>(result.exit_code), file.string(),
                  "lsp-render failed: " + result.errors.substr(0, result.errors.find('\n')));
  }
  const Json json = Json::parse(result.output, nullptr, false);
  if (json.is_discarded()) throw Failure(Exit::kInternal, file.string(), "lsp-render --json wrote no JSON");
  return {read_pfm(path.string()), json.value("indirect_seconds", 0.0)};
}

float exposure_for(const std::string& effect, const Image& image) {
  if (effect == "ao") return 1;
  std::vector<float> values;  // of what light comes to
  for (const glm::vec3& pixel : image.pixels) {
    const float value = std::max({pixel.r, pixel.g, pixel.b});
    if (value > 0) values.push_back(value);
  }
  if (values.empty()) return 0;
  const auto at = values.begin() + static_cast<ptrdiff_t>(values.size() * 95 / 100);
  std::nth_element(values.begin(), at, values.end());
  return 0.9f / *at;
}

Polished::Polished(const std::filesystem::path& file, const std::filesystem::path& folder) : file_(file) {
  const auto [first, count] = materials_of(file);
  if (count == 0) return;
  copy_ = folder / (file.stem().string() + "-polished.lsp");
  std::filesystem::copy_file(file, copy_, std::filesystem::copy_options::overwrite_existing);
  std::fstream out(copy_, std::ios::binary | std::ios::in | std::ios::out);
  for (uint32_t i = 0; i < count; ++i) {
    const auto at = static_cast<std::streamoff>(first + i * sizeof(LspMaterial));
    LspMaterial material;
    out.seekg(at).read(reinterpret_cast<char*>(&material), sizeof material);
    material.roughness = kRoughness;
    material.metallic = 1;
    out.seekp(at).write(reinterpret_cast<const char*>(&material), sizeof material);
  }
  out.close();
  if (!out) throw Failure(Exit::kFile, copy_.string(), "cannot be written, make room");
}

Polished::~Polished() {
  std::error_code ignored;
  if (!copy_.empty()) std::filesystem::remove(copy_, ignored);
}

}  // namespace lsp::bench
