// What is wrong with a command line, in plain words: CLI11 says it by the names of its types and checks.
#pragma once

#include <CLI/CLI.hpp>
#include <regex>
#include <string>
#include <string_view>

#include "lsp/program.h"

namespace lsp {

// 100 for 100.000000.
inline std::string without_zeros(const std::string& number) {
  return std::regex_replace(number, std::regex(R"(\.0+$)"), "");
}

// The message of `e`, which begins with an option's name where it is about one.
inline std::string in_plain_words(const CLI::App& app, const CLI::ParseError& e) {
  const std::string text = e.what();
  std::smatch m;
  const auto is = [&](const char* pattern) { return std::regex_match(text, m, std::regex(pattern)); };
  const auto kind = [&](const std::string& name) {
    const CLI::Option* option = app.get_option_no_throw(name);
    return option != nullptr && option->get_type_name().starts_with("UINT") ? "no whole number" : "no number";
  };
  if (is(R"((\S+): \(.* not in \{0\}\) OR \(Value (.*) not in range (\S+) to (\S+)\))"))
    return m.str(1) + ": " + m.str(2) + " is neither 0 nor a whole number from " + m.str(3) + " to " +
           m.str(4);
  if (is(R"((\S+): Value (.*) not in range (\S+) to (\S+))"))
    return m.str(1) + ": " + m.str(2) + " is " + kind(m[1]) + " from " + without_zeros(m[3]) + " to " +
           without_zeros(m[4]);
  if (is(R"(Could not convert: (\S+) = (.*))")) return m.str(1) + ": " + m.str(2) + " is " + kind(m[1]);
  if (is(R"((\S+): Value (.*) could not be converted to UINT)"))
    return m.str(1) + ": " + m.str(2) + " is no whole number, take a smaller unit";
  if (is(R"((\S+): (.*) unit not recognized\. Allowed values: .*)"))
    return m.str(1) + ": " + m.str(2) + " is no unit of a size, give bytes or as 20MB or 2GiB";
  if (is(R"((\S+): (\S+) multiplied by (\S+) factor would cause number overflow.*)"))
    return m.str(1) + ": " + m.str(2) + " " + m.str(3) + " is too large";
  if (is(R"((\S+): At Most 1 required but received .*)")) return m.str(1) + " is given more than once";
  if (is(R"((\S+): .*1 required .* missing)")) return m.str(1) + " needs a value";
  // Of a number that has to be one of a few, CLI11 says no more than what was given.
  if (is(R"((-\S+): (\S+))")) return m.str(1) + ": " + m.str(2) + " is none of its values";
  return text;
}

// Throws Failure where a word is empty: a variable of a script that is not set, most often, which CLI11 takes
// for 0 or for an option that was left out.
inline void refuse_empty_words(const CLI::App& app, int argc, char** argv) {
  for (int i = 1; i < argc; ++i) {
    const std::string_view word = argv[i];
    const bool no_value = word.starts_with("--") && word.ends_with("=");
    if (!word.empty() && !no_value) continue;
    const std::string before = no_value ? std::string(word.substr(0, word.size() - 1)) : argv[i - 1];
    const CLI::Option* option = app.get_option_no_throw(before);
    if (option != nullptr && before.starts_with("-") && option->get_items_expected_max() > 0)
      throw Failure(Exit::kUsage, "", before + " has an empty value; give one, or leave the option out");
    throw Failure(Exit::kUsage, "", "a file's name is empty; give one, or leave it out");
  }
}

}  // namespace lsp
