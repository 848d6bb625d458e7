// Opens a raw file and a packed one. `yes`: the library can unpack.
#include <cmath>
#include <cstdio>
#include <cstring>
#include <vector>

#include "lsp/lsp.hpp"

int main(int argc, char** argv) {
  if (argc != 4) return 1;
  const lsp::SceneFile raw(argv[1]);
  if (raw.unpacked()) return 2;
  const lsp_instance place = {0, {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0}, 255, 0};
  if (lsp::Instances({&raw.scene()}, {&place, 1}).size() != 1) return 6;
  const std::vector<LspRay> rays(2, {raw.header().bounds_min, 0, {1, 1, 1}, INFINITY});
  std::vector<LspHit> hits(2);
  lsp::trace(raw.scene(), {LSP_TRACE_APPROXIMATE, 0.0f}, rays, hits);
  if (std::memcmp(&hits[0], &hits[1], sizeof hits[0]) != 0) return 7;
  hits.pop_back();
  try {
    lsp::trace(raw.scene(), {LSP_TRACE_APPROXIMATE, 0.0f}, rays, hits);
    return 8;
  } catch (const lsp::Error& error) {
    if (error.status() != LSP_ERROR_LIMIT) return 9;
  }
  const bool can_unpack = std::strcmp(argv[3], "yes") == 0;
  try {
    const lsp::SceneFile packed(argv[2]);
    if (!can_unpack || !packed.unpacked()) return 3;
  } catch (const lsp::Error& error) {
    if (can_unpack || error.status() != LSP_ERROR_UNSUPPORTED) return 4;
    if (std::strstr(error.what(), "LSP_PACKED") == nullptr) return 5;
  }
  std::puts("embedded ok");
}
