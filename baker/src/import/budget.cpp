#include "import/budget.h"

#include <unistd.h>

#include "lsp/program.h"

namespace lsp {
namespace {

uint64_t physical_memory() {
  const long pages = sysconf(_SC_PHYS_PAGES);
  const long page_bytes = sysconf(_SC_PAGE_SIZE);
  if (pages <= 0 || page_bytes <= 0) return uint64_t{1} << 34;
  return uint64_t(pages) * uint64_t(page_bytes);
}

std::string in_words(uint64_t bytes) {
  constexpr uint64_t kMebi = 1 << 20;
  return bytes < kMebi ? std::to_string(bytes) + " bytes" : std::to_string(bytes / kMebi) + " MiB";
}

}  // namespace

Budget::Budget(uint64_t limit) : limit_(limit ? limit : physical_memory()) {}

void Budget::charge(const std::string& file, uint64_t count, uint64_t bytes_each) {
  const uint64_t left = limit_ - used_;
  if (count > left / bytes_each) {
    throw Failure(Exit::kLimit, file,
                  "needs more memory to import than the limit of " + in_words(limit_) +
                      ", raise --memory-limit or split the mesh");
  }
  used_ += count * bytes_each;
}

}  // namespace lsp
