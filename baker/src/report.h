// What lsp-bake prints of a bake.
#pragma once

#include <nlohmann/json_fwd.hpp>

#include "arguments.h"
#include "error.h"
#include "writer.h"

namespace lsp {

struct BakeReport {
  const Arguments& arguments;
  const Mesh& mesh;
  const Baked& baked;
  const MeasuredError& error;
  const Written& written;
  double import_seconds, write_seconds;
};

// `meta` is the file's provenance.
nlohmann::ordered_json report_json(const BakeReport& done, const nlohmann::ordered_json& meta);

// For people, on standard output.
void print_report(const BakeReport& done);

}  // namespace lsp
