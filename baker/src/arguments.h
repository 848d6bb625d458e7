// What lsp-bake is asked for, as its command line says it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "bake.h"
#include "lsp/command_line.h"

namespace lsp {

constexpr uint32_t kNTreeLevels = 3;

struct Arguments {
  std::vector<std::filesystem::path> inputs;
  std::filesystem::path output;
  bool instances = false;     // the output is a scene, .json
  std::string base;           // empty: cells, or what the options given belong to
  bool weigh_tables = false;  // cells, but only as fine as they are worth it
  uint32_t cells = 0;
  uint32_t branching = 0;  // 0: the resolution
  uint32_t levels = kNTreeLevels;
  uint32_t resolution = 6;
  std::vector<uint32_t> depths = {9};
  uint32_t triangles = 0;
  Purpose purpose = Purpose::kAll;
  bool no_exact = false;
  bool exact = false;
  bool no_line_spaces = false;
  std::string compress = "none";
  uint32_t align = 0;  // 0: chosen by the file's length
  uint32_t threads = 0;
  uint64_t memory_limit = 0;
  float normal_angle = 180;
  float plane_tolerance = 0.0f;
  uint32_t samples = 5;
  float crease_angle = 40;
  std::optional<double> time;  // of an animation, none: at rest
  std::string animation;
  bool no_splits = false;
  std::string preset = "balanced";
  uint64_t max_size = 0;  // of the file, bytes; 0: none
  double max_error = 0;   // per cent of rays, 0: not asked for
  std::string shard;      // "I/K", empty: the whole bake
  bool strict = false;
  std::filesystem::path depfile;
  bool resolution_given = false, depth_given = false, samples_given = false;
  CommonOptions common;
};

}  // namespace lsp
