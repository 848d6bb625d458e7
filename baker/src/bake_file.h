// From a mesh in memory to one .lsp file, as the command line asks for it.
#pragma once

#include <array>
#include <memory>
#include <nlohmann/json.hpp>

#include "arguments.h"
#include "import/import.h"
#include "policy.h"
#include "writer.h"

namespace lsp {

struct FileBake {
  Chosen chosen;
  nlohmann::ordered_json meta;
  std::unique_ptr<OutputFile> file;  // whole, but for its name: commit() is the caller's
  Written written;
  double write_seconds = 0;
};

ImportOptions import_options(const Arguments& a);
WriteOptions write_options(const Arguments& a);

std::vector<std::string> names_of(const std::vector<Material>& materials);

// Bakes the mesh by the settings of `a`, which settle() has completed, for the file a.output. `source` is the
// hash of mesh.sources. `part`, unless null, is META's `mesh`. Makes materials of the mesh's colours.
// Throws Failure.
FileBake bake_file(Mesh& mesh, Arguments& a, const std::array<uint64_t, 2>& source,
                   const nlohmann::ordered_json& part, const Progress& progress);

// check_output() of all that is written, against files that are read.
void check_outputs(const Arguments& a, std::span<const std::filesystem::path> sources);

// --strict: what is not read, or not as it stands, is an error; prints them all. Nothing without notes.
void refuse_notes(const std::vector<std::string>& notes, const Arguments& a);

}  // namespace lsp
