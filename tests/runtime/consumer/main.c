/* Opens nothing on purpose: that everything compiles as C, links and answers is what is tested. */
#include <stdio.h>

#include "lsp/lsp.h"
#include "lsp/lsp_vulkan.h"

int main(void) {
  lsp_error error;
  lsp_mapping mapping;
  if (lsp_map_file("/nonexistent.lsp", &mapping, &error) != LSP_ERROR_FILE) return 1;
  lsp_scene scene;
  if (lsp_open("not a file", 10, &scene, &error) == LSP_OK) return 2;
  uint64_t size = 0;
  if (lsp_unpacked_size("not a file", 10, &size, &error) == LSP_OK) return 3;
  const lsp_vulkan_plan plan = {.base_structure = LSP_BASE_BVH};
  size_t words = 0;
  if (lsp_vulkan_trace_spirv(&plan, 0, &words)[0] != 0x07230203u || words < 1000) return 4;
  puts("consumer ok");
  return 0;
}
