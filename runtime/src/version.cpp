// What the library says of itself.
#include "lsp/lsp.h"

extern "C" uint32_t lsp_version(void) { return LSP_LIBRARY_VERSION; }

extern "C" const char* lsp_status_string(lsp_status status) {
  switch (status) {
    case LSP_OK:
      return "no error";
    case LSP_ERROR_FILE:
      return "the file cannot be read";
    case LSP_ERROR_INVALID:
      return "not valid";
    case LSP_ERROR_UNSUPPORTED:
      return "not supported";
    case LSP_ERROR_LIMIT:
      return "a limit was exceeded";
  }
  return "unknown status";
}
