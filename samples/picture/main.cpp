// lsp-compare: how far apart two linear pictures are, in numbers and as a picture.
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "compare.h"
#include "lsp/command_line.h"
#include "lsp/json_result.h"
#include "lsp/output_file.h"

namespace {

// Short, and never 0 where it is not.
std::string text(double value) {
  char digits[32];
  std::snprintf(digits, sizeof digits, "%g", value);
  return digits;
}

// JSON has no infinity: of equal pictures' PSNR, of errors against a black reference.
nlohmann::ordered_json finite_or_null(double value) {
  return std::isfinite(value) ? nlohmann::ordered_json(value) : nlohmann::ordered_json();
}

std::string size_of(const lsp::sample::Picture& picture) {
  return std::to_string(picture.width) + "x" + std::to_string(picture.height);
}

}  // namespace

int main(int argc, char** argv) {
  using namespace lsp;
  using namespace lsp::sample;
  constexpr const char* kProgram = "lsp-compare";
  CLI::App app("Compares two linear pictures (.pfm) of the same size: REFERENCE with TEST.", kProgram);
  CommonOptions common;
  std::string reference_path;
  std::string test_path;
  std::string output;
  float factor = 4.0f;
  double max_rmse = -1.0;
  add_common_options(app, kProgram, common);
  app.add_option("REFERENCE.pfm", reference_path, "The picture to trust")->required();
  app.add_option("TEST.pfm", test_path, "The picture to judge")->required();
  app.add_option("-o,--output", output, "Write the absolute difference, amplified, to this .png or .pfm");
  app.add_option("--factor", factor, "Amplification of the difference picture (default 4)")
      ->check(CLI::Range(0.0f, 1e6f));
  app.add_option("--max-rmse", max_rmse, "Exit with 7 if the linear RMSE is larger")
      ->check(CLI::Range(0.0, 1e9));
  arrange_help(app, "lsp-compare exact.pfm approximate.pfm -o difference.png",
               {{"Options", {"REFERENCE.pfm", "TEST.pfm", "--output FILE", "--factor", "--max-rmse"}}});
  return run_program(kProgram, app, argc, argv, [&] {
    const std::filesystem::path inputs[] = {reference_path, test_path};
    if (output.empty() && app.count("--factor") > 0 && !common.quiet)
      std::cerr << kProgram << ": --factor does nothing: no --output asks for a difference picture\n";
    if (!output.empty()) check_picture_name(output);
    if (!output.empty()) check_output(output, inputs);
    const Picture reference = read_pfm(reference_path);
    const Picture test = read_pfm(test_path);
    if (reference.width != test.width || reference.height != test.height)
      throw Failure(Exit::kInvalid, test_path,
                    "has " + size_of(test) + " pixels, " + reference_path + " " + size_of(reference) +
                        "; render both with the same --size");
    const Comparison c = compare(reference, test);
    if (!output.empty()) write_picture(output, difference(reference, test, factor), Transfer::kDisplay);
    const double far_share =
        static_cast<double>(c.pixels_over_5_percent) / static_cast<double>(test.pixels.size());
    if (common.json) {
      nlohmann::ordered_json json = {{"mean_absolute", c.mean_absolute},
                                     {"rmse", c.rmse},
                                     {"relative_mean", finite_or_null(c.relative_mean)},
                                     {"mean_reference", c.mean_reference},
                                     {"mean_test", c.mean_test},
                                     {"pixels_over_5_percent", far_share},
                                     {"factor", factor},
                                     {"psnr_db", finite_or_null(c.psnr_db)}};
      json_result() = json;
    } else if (!common.quiet) {
      std::cout << "RMSE " << c.rmse << ", mean absolute " << c.mean_absolute;
      if (c.mean_reference > 0) std::cout << " (" << 100 * c.relative_mean << " % of the mean)";
      std::cout << ", PSNR " << c.psnr_db << " dB, " << 100 * far_share
                << " % of pixels differ visibly (over 5 % in a displayed channel)\n";
    }
    if (max_rmse >= 0 && !(c.rmse <= max_rmse)) {
      throw Failure(Exit::kDiffer, test_path,
                    "RMSE " + text(c.rmse) + " against " + reference_path + " is over " + text(max_rmse));
    }
  });
}
