// What there is to a bake that is done, wherever it comes from.
#include <algorithm>

#include "bake.h"
#include "lsp/program.h"
#include "lsp/sections.h"

namespace lsp {

std::string with_commas(uint64_t n) {
  std::string reversed;
  do {
    if (reversed.size() % 4 == 3) reversed += ',';
    reversed += char('0' + n % 10);
    n /= 10;
  } while (n);
  return {reversed.rbegin(), reversed.rend()};
}

lsp_scene view(const Baked& baked) {
  const SectionArrays arrays{baked};
  lsp_scene scene{};
  scene.header = &baked.header;
#define LSP_ARRAY_SECTION(Name, TYPE, code, Element, flag, base, feature, owed, member, ...) \
  scene.member = arrays.member.size() == 0 ? nullptr : arrays.member.data();
#include "lsp/sections.def"
  return scene;
}

uint64_t exact_bytes(const Baked& baked) {
  return baked.triangles.size() * sizeof(LspTriangle) + baked.normals.size() * sizeof(LspCornerNormals) +
         baked.materials.size() * sizeof(LspMaterial) + baked.wide.nodes.size() * sizeof(LspWideNode);
}

uint64_t table_bytes(const Baked& baked) {
  const SectionArrays arrays{baked};
  uint64_t bytes = 0;
#define LSP_ARRAY_SECTION(Name, TYPE, code, Element, flag, base, feature, owed, member, ...) \
  if ((feature) == LSP_FEATURE_CELLS) bytes += uint64_t{arrays.member.size()} * sizeof(Element);
#include "lsp/sections.def"
  return bytes;
}

void set_counts(Baked& baked) {
  LspHeader& h = baked.header;
  format::set_counters(h, SectionArrays{baked});
  const bool partial = std::any_of(baked.triangles.begin(), baked.triangles.end(), has_gaps);
  h.required_features = (h.required_features & ~LSP_FEATURE_COVERAGE) | (partial ? LSP_FEATURE_COVERAGE : 0);
  if (!format::is_ntree(h)) return;
  const uint64_t steps = lsp_ntree_steps(&h);
  if (steps > LSP_NONE)
    throw Failure(Exit::kLimit, "",
                  "the NTree needs " + with_commas(steps) +
                      " steps of traversal, more than a file can state: lower --levels");
  h.max_steps = uint32_t(steps);
}

}  // namespace lsp
