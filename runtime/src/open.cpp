#include <cstring>

#include "container.h"
#include "error.h"

namespace {

template <class T>
const T* array(const void* bytes, const LspSection* section) {
  if (section == nullptr || section->element_count == 0) return nullptr;
  return reinterpret_cast<const T*>(static_cast<const unsigned char*>(bytes) + section->offset);
}

}  // namespace

extern "C" void lsp_scene_origin(const lsp_scene* scene, double origin[3]) {
  const LspHeader& h = *scene->header;
  const uint64_t bits[] = {h.origin_x, h.origin_y, h.origin_z};
  memcpy(origin, bits, sizeof bits);
}

extern "C" lsp_status lsp_open(const void* bytes, uint64_t size, lsp_scene* scene, lsp_error* error) {
  *scene = {};
  lsp::Container container;
  const lsp_status status = lsp::read_container(bytes, size, &container, error);
  if (status != LSP_OK) return status;
  for (const LspSection* section : container.known) {
    if (section != nullptr && section->codec != LSP_CODEC_NONE) {
      return lsp::fail(error, LSP_ERROR_UNSUPPORTED, section->offset,
                       "section %s is compressed; unpack the file first (lsp_unpack)",
                       lsp::SectionName(section->type).text);
    }
  }
  scene->bytes = bytes;
  scene->size = size;
  scene->header = container.header;
  scene->sections = container.sections;
#define LSP_ARRAY_SECTION(Name, TYPE, code, Element, flag, base, feature, owed, member, ...) \
  scene->member = array<Element>(bytes, container.known[static_cast<int>(lsp::format::Kind::k##Name)]);
#include "lsp/sections.def"
  return lsp::succeed(error);
}
