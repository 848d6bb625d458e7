// The library's errors as those of a program, with a program's exit codes. Not installed.
#pragma once

#include <string>
#include <utility>

#include "lsp/error.hpp"
#include "lsp/program.h"

namespace lsp {

inline Exit exit_of(lsp_status status) {
  switch (status) {
    case LSP_OK:
      return Exit::kDone;
    case LSP_ERROR_FILE:
      return Exit::kFile;
    case LSP_ERROR_INVALID:
      return Exit::kInvalid;
    case LSP_ERROR_UNSUPPORTED:
      return Exit::kUnsupported;
    case LSP_ERROR_LIMIT:
      return Exit::kLimit;
  }
  return Exit::kInternal;
}

// Throws Failure unless `status` is LSP_OK.
inline void check(lsp_status status, const lsp_error& error, const std::string& file = "") {
  if (status != LSP_OK) throw Failure(exit_of(status), file, error.message);
}

// Calls `body` and returns what it returns; an Error that it throws becomes a Failure.
template <class Body>
decltype(auto) with_failures(Body&& body) {
  try {
    return std::forward<Body>(body)();
  } catch (const Error& error) {
    throw Failure(exit_of(error.status()), error.file(), error.what());
  }
}

}  // namespace lsp
