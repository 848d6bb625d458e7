#include "machine.h"

#include <sys/utsname.h>
#include <unistd.h>

#include <cstdlib>
#include <ctime>
#include <fstream>

#include "embree_scene.h"
#include "lsp/in_chunks.hpp"
#include "lsp/layout.h"
#include "lsp/program.h"

namespace lsp::bench {
namespace {

// The value of the first line "key : value" of a file of such lines; empty without one.
std::string value_of(const char* path, const std::string& key) {
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);) {
    if (line.rfind(key, 0) != 0) continue;
    const size_t colon = line.find_first_of(":=");
    if (colon == std::string::npos) continue;
    const size_t first = line.find_first_not_of(" \t\"", colon + 1);
    if (first == std::string::npos) continue;
    return line.substr(first, line.find_last_not_of(" \t\"") - first + 1);
  }
  return "";
}

std::string cache(long name) {
  const long bytes = sysconf(static_cast<int>(name));
  return bytes > 0 ? std::to_string(bytes / 1024) + " KiB" : "?";
}

}  // namespace

double machine_load() {
  double load = 0;
  return getloadavg(&load, 1) == 1 ? load : 0;
}

Json machine_facts() {
  Json facts;
  const std::string model = value_of("/proc/cpuinfo", "model name");
  const std::string flags = value_of("/proc/cpuinfo", "flags");
  const char* simd = flags.find("avx512f") != std::string::npos ? "AVX-512"
                     : flags.find("avx2") != std::string::npos  ? "AVX2"
                                                                : "SSE or other";
  facts["processor"] =
      (model.empty() ? "unknown" : model) + ", " + std::to_string(machine_threads()) + " threads, " + simd;
  facts["caches"] = "L1 " + cache(_SC_LEVEL1_DCACHE_SIZE) + ", L2 " + cache(_SC_LEVEL2_CACHE_SIZE) + ", L3 " +
                    cache(_SC_LEVEL3_CACHE_SIZE);
  const auto memory =
      static_cast<double>(sysconf(_SC_PHYS_PAGES)) * static_cast<double>(sysconf(_SC_PAGESIZE));
  facts["memory"] = std::to_string(static_cast<int>(memory / (1 << 30) + 0.5)) + " GiB";
  utsname system{};
  uname(&system);
  facts["system"] = value_of("/etc/os-release", "PRETTY_NAME") + ", " + system.sysname + " " + system.release;
#if defined(__clang__)
  facts["compiler"] = std::string("clang ") + __clang_version__;
#else
  facts["compiler"] = std::string("gcc ") + __VERSION__;
#endif
  facts["lsp"] = std::string(kProgramVersion) + ", format " + std::to_string(LSP_VERSION_MAJOR) + "." +
                 std::to_string(LSP_VERSION_MINOR);
  facts["Embree"] = EmbreeScene::version();
  const std::time_t now = std::time(nullptr);
  char text[64];
  std::strftime(text, sizeof text, "%Y-%m-%d %H:%M UTC", std::gmtime(&now));
  facts["date"] = text;
  std::snprintf(text, sizeof text, "%.2f", machine_load());
  facts["load before the run"] = text;
  return facts;
}

}  // namespace lsp::bench
