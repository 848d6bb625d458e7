#include "error.h"

#include <cstdarg>
#include <cstdio>

namespace lsp {

lsp_status fail(lsp_error* error, lsp_status status, uint64_t offset, const char* format, ...) noexcept {
  if (error != nullptr) {
    error->status = status;
    error->offset = offset;
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(error->message, sizeof error->message, format, arguments);
    va_end(arguments);
  }
  return status;
}

lsp_status succeed(lsp_error* error) noexcept {
  if (error != nullptr) {
    error->status = LSP_OK;
    error->offset = 0;
    error->message[0] = '\0';
  }
  return LSP_OK;
}

}  // namespace lsp
