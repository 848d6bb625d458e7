// Figures of a bake, as programs print them and files state them.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "error.h"
#include "writer.h"

namespace lsp {

// A hash of 128 bits in hexadecimal digits.
std::string hex128(uint64_t lo, uint64_t hi);

// "1.23 MB", "1.23 kB"
std::string size_text(uint64_t bytes);

// The most memory this process has held; 0 where the system does not tell.
uint64_t peak_memory_bytes();

// Null where nothing could be measured.
nlohmann::ordered_json to_json(const MeasuredError& error);

nlohmann::ordered_json to_json(const std::vector<WrittenSection>& sections);

// Null where nothing was measured.
nlohmann::ordered_json to_json(const Qualities& qualities);

// For people, on standard output: nothing where nothing was measured.
void print_error(const MeasuredError& error);
void print_qualities(const Qualities& qualities);
void print_sections(const std::vector<WrittenSection>& sections);

}  // namespace lsp
