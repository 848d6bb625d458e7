#include "shard.h"

#include <charconv>

#include "lsp/program.h"
#include "part.h"

namespace lsp {

Shard parse_shard(const std::string& text) {
  Shard shard;
  const char *begin = text.data(), *end = begin + text.size();
  const auto [slash, error] = std::from_chars(begin, end, shard.number);
  bool good = error == std::errc() && slash != end && *slash == '/';
  if (good) {
    const auto [rest, wrong] = std::from_chars(slash + 1, end, shard.count);
    good = wrong == std::errc() && rest == end;
  }
  if (!good || shard.number < 1 || shard.number > shard.count || shard.count > kMostParts)
    throw Failure(Exit::kUsage, "",
                  "--shard " + text +
                      " is no share of a bake: give I/K, as 2/8, with I from 1 to K, and K up to a million");
  return shard;
}

}  // namespace lsp
