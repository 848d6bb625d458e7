// Whether a bake errs no more than was asked for, what is done about it where cells err more, and whether
// their tables are worth it.
#pragma once

#include <string>

#include "error.h"

namespace lsp {

constexpr uint64_t kErrorRays = 65536;

// What is asked of a bake of cells.
struct Accuracy {
  double wrong = 0.01;   // share of the rays that the dial is measured for, see dial.h
  double max_error = 0;  // per cent of the rays, 0: not asked for
  bool weighed = false;  // the tables have to be worth their bytes and their time
};

// The bytes that tables may take when they are weighed, in those of the exact data.
constexpr double kTableShare = 3;

// Leaves the tables out where they are longer than that, or where a ray through them, by the gain that the
// dial measured, takes as long as an exact one. Answers whether it did.
bool weigh_tables(Baked& baked);

// Measures the error of cells whose dial is chosen for `asked`. Where they err more, the dial becomes
// sterner.
MeasuredError settle_dial(Baked& baked, const Accuracy& asked);

// Throws Failure with Exit::kLimit, naming `file`, where the error is above `max_error` per cent.
void check_error(const MeasuredError& error, double max_error, const std::string& file);

}  // namespace lsp
