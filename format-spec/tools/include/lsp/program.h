// What all programs of the project share on the command line: exit codes and the form of an error.
#pragma once

#include <stdexcept>
#include <string>

#include "lsp/version.h"

namespace lsp {

// The programs' own version; the format's is in layout.h.
inline constexpr const char* kProgramVersion = LSP_LIBRARY_VERSION_STRING;

enum class Exit : int {
  kDone = 0,
  kUsage = 1,        // the command line is wrong
  kFile = 2,         // a file cannot be read or written
  kInvalid = 3,      // the input is invalid
  kInternal = 4,     // a fault of the program
  kUnsupported = 5,  // a version or feature this program does not support
  kLimit = 6,        // a limit asked for was exceeded
  kDiffer = 7,       // two things compared differ
};

// Ends a program with `exit`. The message says what is wrong with `file` and what to do about it; it is
// printed as "PROGRAM: FILE: MESSAGE". `file` may be empty where no file is at fault.
class Failure : public std::runtime_error {
 public:
  Failure(Exit exit, std::string file, const std::string& message)
      : std::runtime_error(message), exit_(exit), file_(std::move(file)) {}
  Exit exit() const { return exit_; }
  const std::string& file() const { return file_; }

 private:
  Exit exit_;
  std::string file_;
};

}  // namespace lsp
