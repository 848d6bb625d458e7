// What the C++ side of the library throws. Header-only.
#pragma once

#include <stdexcept>
#include <string>
#include <utility>

#include "lsp/lsp.h"

namespace lsp {

// An lsp_error of C++: what() is its message, which says what is wrong and what to do.
class Error : public std::runtime_error {
 public:
  // `file` is the one that is at fault, empty where none is.
  Error(lsp_status status, std::string file, const std::string& message)
      : std::runtime_error(message), status_(status), file_(std::move(file)) {}
  lsp_status status() const { return status_; }      // never LSP_OK
  const std::string& file() const { return file_; }  // as it was given

 private:
  lsp_status status_;
  std::string file_;
};

// Throws Error unless `status` is LSP_OK. `error` is what the function that answered it has filled.
inline void throw_unless_ok(lsp_status status, const lsp_error& error, const std::string& file = "") {
  if (status != LSP_OK) throw Error(status, file, error.message);
}

}  // namespace lsp
