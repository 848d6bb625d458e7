// Small mesh files for the tests, written to a folder that goes away with the test.
#pragma once

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "import/import.h"
#include "lsp/program.h"
#include "temporary_folder.h"

namespace lsp_test {

class MeshFiles : public ::testing::Test {
 protected:
  std::filesystem::path write(const std::string& name, const std::string& bytes) const {
    std::ofstream(folder_ / name, std::ios::binary) << bytes;
    return folder_ / name;
  }
  lsp::Mesh import(const std::string& name, const std::string& bytes,
                   const lsp::ImportOptions& options = {}) const {
    const std::filesystem::path path = write(name, bytes);
    return lsp::import_meshes({&path, 1}, options);
  }
  // The exit code and message with which a file is refused; kDone and "" where it is not.
  struct Refusal {
    lsp::Exit exit = lsp::Exit::kDone;
    std::string message;
  };
  Refusal refusal(const std::string& name, const std::string& bytes,
                  const lsp::ImportOptions& options = {}) const {
    try {
      import(name, bytes, options);
    } catch (const lsp::Failure& failure) {
      return {failure.exit(), failure.what()};
    }
    return {};
  }

  const lsp::test::TemporaryFolder temporary_;
  const std::filesystem::path folder_ = temporary_.path();
};

// A triangle's corner in world space.
inline glm::vec3 corner(const lsp::Mesh& mesh, size_t triangle, int i) {
  return mesh.positions[mesh.triangles[triangle][i]];
}

inline glm::vec3 face_normal(const lsp::Mesh& mesh, size_t t) {
  return glm::normalize(
      glm::cross(corner(mesh, t, 1) - corner(mesh, t, 0), corner(mesh, t, 2) - corner(mesh, t, 0)));
}

inline double area(const lsp::Mesh& mesh) {
  double sum = 0;
  for (size_t t = 0; t < mesh.triangles.size(); ++t) {
    sum += 0.5 * double(glm::length(glm::cross(corner(mesh, t, 1) - corner(mesh, t, 0),
                                               corner(mesh, t, 2) - corner(mesh, t, 0))));
  }
  return sum;
}

inline bool has_note(const lsp::Mesh& mesh, const std::string& part) {
  for (const std::string& note : mesh.notes) {
    if (note.find(part) != note.npos) return true;
  }
  return false;
}

template <typename T>
void append(std::string& bytes, const T& value) {
  bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
}

}  // namespace lsp_test
