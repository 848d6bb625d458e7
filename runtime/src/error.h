// How the library reports what is wrong: one call that fills an lsp_error and returns its status.
#pragma once

#include "lsp/lsp.h"

namespace lsp {

// Fills *error (unless it is null) with `status`, the byte `offset` in the file and a printf-style message,
// and returns `status`. Allocates nothing; a message that is too long is cut.
[[gnu::format(printf, 4, 5)]] lsp_status fail(lsp_error* error, lsp_status status, uint64_t offset,
                                              const char* format, ...) noexcept;

// Clears *error (unless it is null) and returns LSP_OK.
lsp_status succeed(lsp_error* error) noexcept;

}  // namespace lsp
