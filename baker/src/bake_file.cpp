#include "bake_file.h"

#include <cstdio>

#include "color_materials.h"
#include "lsp/output_file.h"
#include "lsp/program.h"
#include "provenance.h"
#include "timer.h"

namespace lsp {

using Json = nlohmann::ordered_json;

std::vector<std::string> names_of(const std::vector<Material>& materials) {
  std::vector<std::string> names;
  for (const Material& material : materials) names.push_back(material.name);
  return names;
}

WriteOptions write_options(const Arguments& a) { return {a.align, a.compress == "zstd", 12, a.memory_limit}; }

ImportOptions import_options(const Arguments& a) {
  ImportOptions options;
  options.memory_limit = a.memory_limit;
  options.crease_angle_degrees = a.crease_angle;
  options.time = a.time;
  options.animation = a.animation;
  return options;
}

FileBake bake_file(Mesh& mesh, Arguments& a, const std::array<uint64_t, 2>& source, const Json& part,
                   const Progress& progress) {
  const std::vector<std::string> material_names = names_of(mesh.materials);
  make_color_materials(mesh);
  const WriteOptions options = write_options(a);
  const auto meta_of = [&](const Chosen& c) {
    Json meta = provenance(a, c.baked, mesh, material_names, source, c.error);
    if (!part.is_null()) meta["mesh"] = part;
    return meta;
  };
  FileBake out;
  out.chosen = bake_as_asked(mesh, a, progress,
                             [&](Chosen& c) { return lsp_bytes(c.baked, meta_of(c).dump(), options); });
  out.chosen.baked.header.source_hash_lo = source[0];
  out.chosen.baked.header.source_hash_hi = source[1];

  Timer timer;
  progress("write", 0);
  out.meta = meta_of(out.chosen);
  out.file = std::make_unique<OutputFile>(a.output);
  out.written = write_lsp(*out.file, out.chosen.baked, out.meta.dump(), options);
  out.write_seconds = timer();
  return out;
}

void check_outputs(const Arguments& a, std::span<const std::filesystem::path> sources) {
  check_output(a.output, sources);
  if (a.depfile.empty()) return;
  check_output(a.depfile, sources);
  std::error_code error;
  if (a.depfile.lexically_normal() == a.output.lexically_normal() ||
      std::filesystem::equivalent(a.depfile, a.output, error))
    throw Failure(Exit::kUsage, a.depfile.string(), "is the name of the output, too; give --depfile another");
}

void refuse_notes(const std::vector<std::string>& notes, const Arguments& a) {
  if (notes.empty()) return;
  for (const std::string& note : notes) std::fprintf(stderr, "lsp-bake: note: %s\n", note.c_str());
  std::string inputs;
  for (const auto& input : a.inputs) inputs += (inputs.empty() ? "" : ", ") + input.string();
  throw Failure(Exit::kInvalid, inputs,
                "led to " + std::to_string(notes.size()) + (notes.size() == 1 ? " note" : " notes") +
                    ", which --strict refuses: mend the input or leave out --strict");
}

}  // namespace lsp
