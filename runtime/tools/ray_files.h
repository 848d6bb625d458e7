// Files of rays and of hits: 32 bytes each, little-endian, no header.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "lsp/interface.h"

namespace lsp {

// Throws Failure: kFile where the file cannot be read, kInvalid where its size is not a multiple of 32.
std::vector<LspRay> read_rays(const std::string& path);

// An OutputFile: `path` has all hits or is as it was before. Throws Failure(kFile).
void write_hits(const std::string& path, std::span<const LspHit> hits);

}  // namespace lsp
