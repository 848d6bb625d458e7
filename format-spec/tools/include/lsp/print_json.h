// The one object that a program prints for --json.
#pragma once

#include <cstdio>
#include <nlohmann/json.hpp>

namespace lsp {

// To standard output. JSON is UTF-8 and the names of files need not be: U+FFFD stands for what is none.
inline void print_json(const nlohmann::ordered_json& json) {
  std::puts(json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace).c_str());
}

}  // namespace lsp
