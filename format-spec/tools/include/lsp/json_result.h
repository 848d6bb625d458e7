// The one object that a program prints for --json.
#pragma once

#include <cstdio>
#include <nlohmann/json.hpp>

namespace lsp {

// What the program has to say, null until it is known. A process has one standard output, and so one of
// these; run_program prints it when all is done, with the program's name and version, `exit` and, where that
// is not 0, `error`.
inline nlohmann::ordered_json& json_result() {
  static nlohmann::ordered_json result;
  return result;
}

// To standard output. JSON is UTF-8 and the names of files need not be: U+FFFD stands for what is none.
inline void print_json(const nlohmann::ordered_json& json) {
  std::puts(json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace).c_str());
}

}  // namespace lsp
