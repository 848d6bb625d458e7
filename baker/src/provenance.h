// What a file, and what is built from it, knows of where it comes from.
#pragma once

#include <array>
#include <nlohmann/json_fwd.hpp>

#include "arguments.h"
#include "error.h"

namespace lsp {

// The section META. Nothing in it depends on the machine, the time, the threads or the folder.
nlohmann::ordered_json provenance(const Arguments& a, const Baked& baked, const Mesh& mesh,
                                  const std::vector<std::string>& material_names,
                                  const std::array<uint64_t, 2>& source, const MeasuredError& error);

// A rule for Make and Ninja: the output depends on every file that was read, `sources` as Mesh has them.
void write_depfile(const Arguments& a, const std::vector<std::vector<std::filesystem::path>>& sources);

}  // namespace lsp
