#include "import/uri.h"

#include <algorithm>

#include "import/find_file.h"
#include "lsp/program.h"

namespace lsp {
namespace {

std::string decode_percent(std::string_view text) {
  const auto digit = [](char c) {
    return c >= '0' && c <= '9'   ? c - '0'
           : c >= 'a' && c <= 'f' ? c - 'a' + 10
           : c >= 'A' && c <= 'F' ? c - 'A' + 10
                                  : -1;
  };
  std::string out;
  for (size_t i = 0; i < text.size(); ++i) {
    if (text[i] == '%' && i + 2 < text.size() && digit(text[i + 1]) >= 0 && digit(text[i + 2]) >= 0) {
      out += char(digit(text[i + 1]) * 16 + digit(text[i + 2]));
      i += 2;
    } else {
      out += text[i];
    }
  }
  return out;
}

// "file:" and the machine, which is this one, off a path.
std::string without_scheme(const std::string& name) {
  constexpr std::string_view kScheme = "file:", kMachine = "localhost/";
  std::string_view path = name;
  if (!equals_ignoring_case(path.substr(0, kScheme.size()), kScheme)) return name;
  path.remove_prefix(kScheme.size());
  if (!path.starts_with("//")) return std::string(path);
  path.remove_prefix(2);
  if (equals_ignoring_case(path.substr(0, kMachine.size()), kMachine))
    path.remove_prefix(kMachine.size() - 1);
  return std::string(path);
}

}  // namespace

std::string decode_data_uri(const std::string& file, std::string_view uri) {
  const auto fail = [&](const char* what) {
    return Failure(Exit::kInvalid, file, std::string("has a data URI ") + what + ", export it again");
  };
  const size_t comma = uri.find(',');
  if (comma == uri.npos) throw fail("without a comma before its data");
  const std::string body = decode_percent(uri.substr(comma + 1));
  if (comma < 7 || !equals_ignoring_case(uri.substr(comma - 7, 7), ";base64")) return body;  // RFC 2397
  std::string out;
  out.reserve((uri.size() - comma) / 4 * 3);
  uint32_t bits = 0;
  int held = 0;
  for (const char c : body) {
    if (is_blank(c) || is_line_end(c)) continue;
    int value = -1;
    if (c >= 'A' && c <= 'Z') value = c - 'A';
    if (c >= 'a' && c <= 'z') value = c - 'a' + 26;
    if (c >= '0' && c <= '9') value = c - '0' + 52;
    if (c == '+' || c == '-') value = 62;
    if (c == '/' || c == '_') value = 63;
    if (c == '=') break;
    if (value < 0) throw fail("that is not base64 and says so");
    bits = bits << 6 | uint32_t(value);
    held += 6;
    if (held >= 8) out += char(bits >> (held -= 8));
  }
  return out;
}

std::filesystem::path resolve_uri(const std::filesystem::path& document, std::string_view uri,
                                  std::string& remark) {
  const std::string decoded = decode_percent(uri);
  if (decoded.find('\0') != decoded.npos) {
    throw Failure(Exit::kInvalid, document.string(),
                  "names a file with a zero byte in its name, export it again");
  }
  if (decoded.starts_with("http://") || decoded.starts_with("https://")) {
    throw Failure(
        Exit::kFile, document.string(),
        "names a file on the network, which is not asked: put it beside the document and name it there");
  }
  std::string slashes = decoded;
  std::replace(slashes.begin(), slashes.end(), '\\', '/');
  const std::string local = without_scheme(decoded);
  // A query or fragment is for servers, but both characters stand in names, too.
  const std::string bare = decode_percent(uri.substr(0, uri.find_first_of("?#")));
  const std::filesystem::path folder = document.parent_path();
  remark.clear();
  for (const std::string& name : {local, std::string(uri), slashes, bare}) {
    std::error_code error;
    if (!std::filesystem::is_regular_file(folder / name, error)) continue;
    if (name != local) remark = "the URI " + std::string(uri) + " is no valid one, it is read as a path";
    return folder / name;
  }
  bool guessed = false;
  const std::filesystem::path found = find_file(folder, local, guessed);
  if (found.empty()) return folder / local;
  remark = "the file " + local + " is not there, " + found.filename().string() + " is read in its place";
  return found;
}

}  // namespace lsp
