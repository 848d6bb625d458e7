// One mesh file, any bytes: import must return a sound mesh or throw Failure, within a memory limit and in a
// moment. Built once a format; LSP_FUZZ_EXTENSION chooses it. Starting points are any small meshes:
//   import_fuzz_ply -rss_limit_mb=2048 -timeout=10 CORPUS SEEDS
#include <unistd.h>

#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <optional>
#include <string_view>

#include "import/instances.h"
#include "import/readers.h"
#include "lsp/program.h"

namespace {

void require(bool good, const char* what) {
  if (good) return;
  std::fprintf(stderr, "unsound mesh: %s\n", what);
  std::abort();
}

void check(const lsp::Mesh& mesh) {
  const size_t count = mesh.triangles.size();
  require(count > 0, "empty");
  require(count + mesh.rejected.total() == mesh.primitive_count, "triangles lost");
  require(
      mesh.primitives.size() == count && mesh.normals.size() == count && mesh.material_ids.size() == count,
      "arrays of different lengths");
  for (size_t t = 0; t < count; ++t) {
    require(mesh.material_ids[t] < mesh.materials.size(), "material out of range");
    for (int i = 0; i < 3; ++i) {
      require(mesh.triangles[t][i] < mesh.positions.size(), "index out of range");
      require(std::abs(glm::length(mesh.normals[t][i]) - 1.0f) < 1e-4f, "normal not of unit length");
    }
  }
  for (const glm::vec3& p : mesh.positions) {
    require(std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z), "position not finite");
  }
}

void check(const lsp::InstancedMeshes& scene) {
  for (const lsp::InstancedAsset& asset : scene.assets) check(asset.mesh);
  for (const lsp::MeshInstance& instance : scene.instances) {
    require(instance.asset < scene.assets.size(), "asset out of range");
    for (int k = 0; k < 16; ++k) {
      require(std::isfinite(instance.transform[k / 4][k % 4]), "transform not finite");
    }
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static const std::filesystem::path path =
      "/dev/shm/lsp_import_fuzz_" + std::to_string(getpid()) + LSP_FUZZ_EXTENSION;
  {
    std::ofstream file(path, std::ios::binary | std::ios::trunc);
    file.write(reinterpret_cast<const char*>(data), std::streamsize(size));
  }
  const bool animated = std::string_view(reinterpret_cast<const char*>(data), size).find("\"animations\"") !=
                        std::string_view::npos;
  for (const bool posed : {false, true}) {
    if (posed && !animated) break;
    try {
      const std::optional<double> time = posed ? std::optional(0.5) : std::nullopt;
      const lsp::ImportOptions options = {.memory_limit = 256 << 20, .time = time};
      if (lsp::is_gltf(path)) check(lsp::import_instances({&path, 1}, options));
      check(lsp::import_meshes({&path, 1}, options));
    } catch (const lsp::Failure& failure) {
      require(failure.exit() != lsp::Exit::kInternal && failure.what()[0] != '\0',
              "failure without a reason");
    }
  }
  return 0;
}
