// Cutting text into lines, words and numbers, the same in every locale.
#pragma once

#include <charconv>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <string_view>

namespace lsp {

inline bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\v' || c == '\f' || c == '\0'; }
inline bool is_line_end(char c) { return c == '\n' || c == '\r'; }

inline std::string_view trim(std::string_view text) {
  while (!text.empty() && (is_blank(text.front()) || is_line_end(text.front()))) text.remove_prefix(1);
  while (!text.empty() && (is_blank(text.back()) || is_line_end(text.back()))) text.remove_suffix(1);
  return text;
}

// What stands between quotation marks, where a whole text does.
inline std::string_view unquoted(std::string_view text) {
  const bool quoted = text.size() >= 2 && text.front() == '"' && text.back() == '"';
  return quoted ? text.substr(1, text.size() - 2) : text;
}

// Takes the next line off `text`, without its end; a line ends at LF, CR LF or a bare CR. False at the end.
inline bool take_line(std::string_view& text, std::string_view& line) {
  if (text.empty()) return false;
  size_t end = 0;
  while (end < text.size() && !is_line_end(text[end])) ++end;
  line = text.substr(0, end);
  if (end < text.size()) ++end;
  if (end < text.size() && text[end - 1] == '\r' && text[end] == '\n') ++end;
  text.remove_prefix(end);
  return true;
}

// The same for a line that goes on where it ends in a backslash, as those of OBJ and its .mtl do; blanks
// behind that are a slip of exporters' wrapping. `joined` holds such a line. Comments, which may end in a
// backslash as folders' names do, never go on.
inline bool take_joined_line(std::string_view& text, std::string_view& line, std::string& joined) {
  const auto goes_on = [](std::string_view part) { return trim(part).ends_with('\\'); };
  if (!take_line(text, line)) return false;
  if (!goes_on(line) || trim(line).starts_with('#')) return true;
  joined.clear();
  do {
    joined.append(line.substr(0, line.rfind('\\')));
    joined += ' ';
  } while (take_line(text, line) && goes_on(line));
  if (!goes_on(line)) joined.append(line);
  line = joined;
  return true;
}

// Takes the next word off a line. False where none is left.
inline bool take_word(std::string_view& line, std::string_view& word) {
  size_t begin = 0;
  while (begin < line.size() && is_blank(line[begin])) ++begin;
  size_t end = begin;
  while (end < line.size() && !is_blank(line[end])) ++end;
  word = line.substr(begin, end - begin);
  line.remove_prefix(end);
  return !word.empty();
}

// A number as C writes it, with an optional plus sign. Anything else ("3.1+e2", "1.#IND") is NaN, which the
// mesh then counts as non-finite: a wrong number is worse than a refused triangle.
inline double number_of(std::string_view word) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  if (!word.empty() && word.front() == '+') word.remove_prefix(1);
  double value = 0;
  const auto result = std::from_chars(word.data(), word.data() + word.size(), value);
  if (result.ptr != word.data() + word.size() || word.empty()) return kNan;
  if (result.ec == std::errc::result_out_of_range) {
    const size_t exponent = word.find_first_of("eE"), digit = word.find_first_of("123456789");
    const bool tiny = exponent == word.npos ? word.find('.') < digit : word.substr(exponent + 1, 1) == "-";
    return tiny ? 0.0 : std::numeric_limits<double>::infinity();
  }
  return result.ec == std::errc() ? value : kNan;
}

// Reads numbers and keeps the first word that is none, nor says that there is none ("nan", "-1.#IND"):
// programs write the decimal point of their country.
class NumberReader {
 public:
  double read(std::string_view word) {
    const double value = number_of(word);
    if (std::isnan(value) && odd_.empty() && is_odd(word)) odd_ = word.substr(0, 32);
    return value;
  }
  // Empty where all were numbers.
  std::string note() const {
    return odd_.empty() ? odd_
                        : odd_ + " and the like stand where numbers belong, what they are part of is lost";
  }

 private:
  static bool is_odd(std::string_view word) {
    const bool is_signed = !word.empty() && (word.front() == '-' || word.front() == '+');
    const std::string_view start = word.substr(is_signed, 3);
    const bool is_nan = start == "nan" || start == "NaN" || start == "NAN";
    return !is_nan && word.find('#') == word.npos;
  }
  std::string odd_;
};

// A decimal integer. False where `word` is anything else.
inline bool integer_of(std::string_view word, int64_t& value) {
  if (!word.empty() && word.front() == '+') word.remove_prefix(1);
  const auto result = std::from_chars(word.data(), word.data() + word.size(), value);
  return result.ec == std::errc() && result.ptr == word.data() + word.size();
}

inline bool equals_ignoring_case(std::string_view a, std::string_view b) {
  if (a.size() != b.size()) return false;
  for (size_t i = 0; i < a.size(); ++i) {
    const auto lower = [](char c) { return c >= 'A' && c <= 'Z' ? char(c - 'A' + 'a') : c; };
    if (lower(a[i]) != lower(b[i])) return false;
  }
  return true;
}

}  // namespace lsp
