// What the error looks like: ambient occlusion, a diffuse bounce and reflections, exact and approximate,
// and exact with fewer rays, because a user can also buy speed by noise.
#include <cstdio>

#include "context.h"
#include "image.h"
#include "lsp/program.h"
#include "process.h"

namespace lsp::bench {
namespace {

struct Rendered {
  Image image;
  double seconds = 0;  // in indirect rays
  double mrays = 0;
};

Rendered render(Context& context, const Baked& baked, const std::string& effect, const std::string& mode,
                unsigned samples, const std::string& size) {
  const auto path = context.cache / "picture.pfm";
  const ProcessResult result =
      run_process({program_path("lsp-render").string(), baked.path.string(), "-o", path.string(), "--effect",
                   effect, "--mode", mode, "--samples", std::to_string(samples), "--size", size, "--json"});
  if (result.exit_code != 0) {
    throw Failure(static_cast<Exit>(result.exit_code), baked.path.string(),
                  "lsp-render failed: " + result.errors);
  }
  const Json json = Json::parse(result.output);
  return {read_pfm(path.string()), json.value("indirect_seconds", 0.0),
          json.value("indirect_mrays_per_second", 0.0)};
}

// So that the reference's 95th percentile is near white: pictures of dark scenes must show something too.
float exposure_for(const Image& image) {
  std::vector<float> values;
  for (const glm::vec3& pixel : image.pixels) values.push_back(std::max({pixel.r, pixel.g, pixel.b}));
  const auto at = values.begin() + static_cast<ptrdiff_t>(values.size() * 95 / 100);
  std::nth_element(values.begin(), at, values.end());
  return *at > 0 ? std::min(0.9f / *at, 1e4f) : 1;
}

}  // namespace

Section pictures_suite(Context& context) {
  Section section{"pictures", "What the error looks like", {}, {}, {}, {}};
  const unsigned truth_samples = context.quick ? 256 : 1024;
  const std::string size = context.quick ? "64x36" : "112x63";
  section.paragraphs.push_back(
      "Against the exact picture of " + std::to_string(truth_samples) +
      " samples a pixel, N = " + (context.quick ? "4" : "6") +
      ", D = 9, near field exact. SSIM and FLIP (67 pixels a degree) are "
      "of display values at one exposure a scene and effect; RMSE and bias of linear light, for ambient "
      "occlusion in [0, 1]. The same random numbers drive exact and approximate pictures, so their "
      "difference at many samples is the approximation's alone.");
  Table table{"pictures", "Picture errors", "", {}, {}};
  table.columns = {{"scene", "scene"},
                   {"effect", "effect"},
                   {"mode", "mode"},
                   {"samples", "samples"},
                   {"seconds", "indirect rays, s", 3},
                   {"mrays", "Mrays/s"},
                   {"rmse", "RMSE", 4},
                   {"bias", "bias", 4},
                   {"psnr", "PSNR, dB", 1},
                   {"ssim", "SSIM", 4},
                   {"flip", "FLIP", 4}};
  const std::vector<std::string> effects =
      context.quick ? std::vector<std::string>{"ao"} : std::vector<std::string>{"ao", "diffuse", "glossy"};
  struct Variant {
    const char* mode;
    unsigned samples;
  };
  const std::vector<Variant> variants = {
      {"exact", 64}, {"approximate", 64}, {"exact", 32}, {"exact", 16}, {"approximate", truth_samples}};
  for (const auto& scene : context.scenes) {
    const Baked& baked = scene->base();
    for (const std::string& effect : effects) {
      context.progress("pictures: " + scene->name() + " " + effect);
      Rendered truth;
      try {
        truth = render(context, baked, effect, "exact", truth_samples, size);
      } catch (const Failure& failure) {
        if (failure.exit() != Exit::kUnsupported) throw;
        context.warnings.push_back(scene->name() + ", " + effect + ": no pictures: " + failure.what());
        continue;
      }
      const float exposure = effect == "ao" ? 1 : exposure_for(truth.image);
      const Image truth_display = to_display(truth.image, exposure);
      for (const Variant& variant : variants) {
        const Rendered done = render(context, baked, effect, variant.mode, variant.samples, size);
        const Image display = to_display(done.image, exposure);
        Json row;
        row["scene"] = scene->name();
        row["effect"] = effect;
        row["mode"] = variant.mode;
        row["samples"] = variant.samples;
        row["seconds"] = done.seconds;
        row["mrays"] = done.mrays;
        row["rmse"] = rmse(truth.image, done.image);
        row["bias"] = bias(truth.image, done.image);
        row["psnr"] = psnr(truth_display, display);
        row["ssim"] = ssim(truth_display, display);
        row["flip"] = flip(truth_display, display);
        table.rows.push_back(row);
        if (variant.samples == truth_samples) {
          Image difference = done.image;
          for (size_t i = 0; i < difference.pixels.size(); ++i) {
            difference.pixels[i] = 5.0f * exposure * glm::abs(done.image.pixels[i] - truth.image.pixels[i]);
          }
          const std::string base = scene->name() + "-" + effect;
          section.pictures.push_back(
              {base + "-exact", scene->name() + ", " + effect + ", exact", encode_png(truth_display)});
          section.pictures.push_back({base + "-approximate", "approximate", encode_png(display)});
          section.pictures.push_back(
              {base + "-difference", "difference, five times", encode_png(difference)});
        }
      }
    }
  }
  section.tables = {std::move(table)};
  return section;
}

}  // namespace lsp::bench
