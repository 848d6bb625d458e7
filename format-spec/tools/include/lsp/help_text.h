// --help as the programs print it: what most people need first, the rest in groups, in lines of 80 columns,
// and an option's values and default in place of CLI11's types and checks.
#pragma once

#include <algorithm>
#include <CLI/CLI.hpp>
#include <memory>
#include <sstream>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace lsp {

struct HelpGroup {
  std::string title;
  std::vector<std::string>
      options;  // long names, or a positional's; "--output FILE" says what to call the value
};

class HelpText : public CLI::Formatter {
 public:
  explicit HelpText(std::vector<HelpGroup> groups = {}, std::string example = "")
      : groups_(std::move(groups)), example_(std::move(example)) {}

  std::string make_help(const CLI::App* app, std::string name, CLI::AppFormatMode) const override {
    const std::string program = app->get_name().empty() ? name : app->get_name();
    std::string text;
    std::istringstream lines(app->get_description());
    for (std::string line; std::getline(lines, line);) text += wrapped(line, 0, 0);
    text += "\nUsage: " + program;
    for (const CLI::Option* option : app->get_options())
      if (option->get_positional()) text += " " + make_option_usage(option);
    for (const CLI::Option* option : app->get_options())
      if (!option->get_positional() && option->get_required()) {
        const std::string all = names(option);
        text += " " + all.substr(0, all.find(',')) + values(option);
      }
    text += " [OPTIONS]\n";
    if (!example_.empty()) text += "Example: " + example_ + "\n";

    std::vector<const CLI::Option*> left = app->get_options({});
    const auto take = [&](const std::vector<std::string>& wanted) {
      std::vector<const CLI::Option*> taken;
      for (const std::string& option_name : wanted)
        for (const CLI::Option*& option : left)
          if (option != nullptr && option->check_name(option_name))
            taken.push_back(std::exchange(option, nullptr));
      left.erase(std::remove(left.begin(), left.end(), nullptr), left.end());
      return taken;
    };
    const auto print = [&](const std::string& title, const std::vector<const CLI::Option*>& options) {
      if (!options.empty()) text += "\n" + title + ":\n";
      for (const CLI::Option* option : options) text += make_option(option, option->get_positional());
    };
    const std::vector<const CLI::Option*> general = take({"--help", "--version", "--quiet", "--json"});
    for (const HelpGroup& group : groups_) print(group.title, take(group.options));
    print(groups_.empty() ? "Options" : "More options", left);
    print("All programs", general);
    return text;
  }

  std::string make_option(const CLI::Option* option, bool) const override {
    std::string text = "  " + names(option) + values(option);
    if (text.size() + 2 > kColumn) text += "\n";
    return text + wrapped(description(option), text.back() == '\n' ? 0 : text.size(), kColumn);
  }

 private:
  static constexpr size_t kColumn = 26, kWidth = 80;

  // The words of a line in lines of kWidth, each from `column` on; `at` is where the first one stands so far.
  static std::string wrapped(const std::string& line, size_t at, size_t column) {
    std::string text;
    std::istringstream words(line);
    for (std::string word; words >> word; at += word.size()) {
      if (at > column && at + 1 + word.size() > kWidth) {
        text += "\n";
        at = 0;
      }
      const size_t spaces = at < column ? column - at : at > column ? 1 : 0;
      text += std::string(spaces, ' ') + word;
      at += spaces;
    }
    return text + "\n";
  }

  static std::string names(const CLI::Option* option) {
    if (option->get_positional()) return option->get_name(true, false);
    std::string text;
    for (const std::string& name : option->get_snames()) text += (text.empty() ? "-" : ", -") + name;
    for (const std::string& name : option->get_lnames()) text += (text.empty() ? "--" : ", --") + name;
    return text;
  }

  // What between `open` and `close` the checks of a value say, empty where they do not.
  static std::string between(const std::string& checks, std::string_view open, std::string_view close) {
    const size_t at = checks.find(open);
    if (at == std::string::npos) return "";
    const size_t from = at + open.size();
    return checks.substr(from, checks.find(close, from) - from);
  }

  // The words to choose from, or what kind of value.
  static std::string values(const CLI::Option* option) {
    if (option->get_positional())
      return option->get_expected_max() >= CLI::detail::expected_max_vector_size ? "..." : "";
    if (option->get_type_size() == 0) return "";
    if (!option->get_option_text().empty()) return " " + option->get_option_text();
    const std::string checks = option->get_type_name();
    const std::string type = checks.substr(0, checks.find(':'));
    std::string choice = between(checks, "{", "}");
    if (checks.find(" in [") != std::string::npos) choice.clear();
    std::string text;
    for (const std::string& word : CLI::detail::split(choice, ','))
      text += (text.empty() ? "" : "|") + word.substr(0, word.find("->"));
    if (text.empty())
      text = checks.find("SIZE [") != std::string::npos ? "SIZE"
             : type == "UINT" || type == "INT"          ? "N"
             : type == "FLOAT"                          ? "X"
                                                        : type;
    if (option->get_delimiter() != '\0') text += std::string("[") + option->get_delimiter() + text + "...]";
    return " " + text;
  }

  static std::string description(const CLI::Option* option) {
    std::string text = option->get_description();
    std::string range = between(option->get_type_name(), " in [", "]");
    if (const size_t dash = range.find(" - "); dash != std::string::npos) {
      // A bound that is there for safety alone says nothing.
      const bool bounded = std::stod(range.substr(dash + 3)) < 65536;
      range = bounded ? range.substr(0, dash) + " to " + range.substr(dash + 3) : "";
    }
    std::string standard = option->get_default_str();
    if (standard.starts_with("[") && standard.ends_with("]"))
      standard = standard.substr(1, standard.size() - 2);
    if (option->get_required() || text.find("default") != std::string::npos) standard.clear();
    std::string more = range;
    if (!standard.empty()) more += (more.empty() ? "default " : "; default ") + standard;
    if (more.empty()) return text;
    if (text.ends_with(")")) return text.substr(0, text.size() - 1) + "; " + more + ")";
    return text + " (" + more + ")";
  }

  std::vector<HelpGroup> groups_;
  std::string example_;
};

// --threads, 0 in all programs: all cores.
template <class Number>
void add_threads(CLI::App& app, Number& threads, const std::string& what) {
  app.add_option("--threads", threads, what + ", 0: all cores")->check(CLI::Range(0, 1024));
}

// After the options have been added. What no group names comes after them all.
inline void arrange_help(CLI::App& app, const std::string& example, std::vector<HelpGroup> groups) {
  for (HelpGroup& group : groups)
    for (std::string& name : group.options) {
      const size_t space = std::min(name.find(' '), name.size());
      CLI::Option* option = app.get_option(name.substr(0, space));  // throws where there is none
      if (space < name.size()) option->option_text(name.substr(space + 1));
      name.resize(space);
    }
  app.formatter(std::make_shared<HelpText>(std::move(groups), example));
}

}  // namespace lsp
