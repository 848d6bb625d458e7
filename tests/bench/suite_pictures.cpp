// What the error looks like: ambient occlusion near and far, a diffuse bounce and reflections, from where the
// scene is seen at large and from close to its detail; exact, and from tables at the points of the dial. With
// the same samples, so that a difference is the approximation's; and in the same time, because a user can buy
// speed by noise as well.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <optional>

#include "context.h"
#include "picture_errors.h"
#include "picture_page.h"
#include "picture_shots.h"
#include "viewpoints.h"

namespace lsp::bench {
namespace {

struct Light {
  const char* name;    // in tables and file names
  const char* effect;  // of lsp-render
  double radius;
};
constexpr Light kLights[] = {
    {"ao-short", "ao", 0.067}, {"ao-long", "ao", 0.2}, {"diffuse", "diffuse", 0}, {"glossy", "glossy", 0}};

struct View {
  std::string name;
  Camera camera;
};

// A way to trace, and the file that it is done in.
struct Variant {
  std::string name, id;
  std::filesystem::path file;
  std::vector<std::string> mode;
  bool shown = false;       // on the page, not in the table alone
  bool equal_time = false;  // set against exact rays of the same time
};

struct Taken {
  Variant variant;
  Image image;  // on the scale of the exact picture's exposure
  double seconds = 0;
};

// One scene, view and light; what is made of it goes to the tables and the page.
struct Subject {
  std::string scene;
  View view;
  Light light;
};

struct Tables {
  Table same{"pictures", "Against the exact picture of as many samples", "", {}, {}};
  Table equal{"pictures_equal_time", "In equal time, against an exact picture of many samples", "", {}, {}};
};

constexpr unsigned kSamples = 16;  // a pixel, of what is compared
unsigned many_samples(const Context& context) { return context.quick ? 128 : 256; }

std::vector<View> views_of(const Context& context, const SceneUnderTest& scene) {
  Camera wide = scene.camera();
  wide.width = context.quick ? 128 : 240;
  wide.height = context.quick ? 72 : 135;
  std::vector<View> views = {{"wide", wide}};
  if (context.quick) return views;
  const TraceFunction trace = [&](auto rays, auto hits) { scene.reference().closest(rays, hits); };
  views.push_back({"close", choose_close_camera(scene.soup(), trace, wide)});
  return views;
}

std::vector<Light> lights_of(const Context& context) {
  if (context.quick) return {kLights[0]};
  return {std::begin(kLights), std::end(kLights)};
}

std::vector<Variant> dial_of(const OpenFile& file) {
  const auto way = [&](const char* name, const char* id, std::vector<std::string> options, bool shown) {
    options.insert(options.begin(), {"--mode", "approximate"});
    return Variant{name, id, file.path(), options, shown, shown};
  };
  if (file.has_cells()) {
    return {way("fast", "fast", {"--quality", "fast"}, true),
            way("balanced", "balanced", {"--quality", "balanced"}, true),
            way("accurate", "accurate", {"--quality", "accurate"}, true),
            way("max-loss 0", "max-loss-0", {"--max-loss", "0"}, false)};
  }
  if (file.has_line_spaces()) return {way("Line Spaces", "line-spaces", {}, true)};
  return {};
}

// Exact first, then what the file's tables offer, and for comparison the Line Spaces of the first bake.
std::vector<Variant> variants_of(SceneUnderTest& scene, const std::filesystem::path& path) {
  const OpenFile file(path);
  std::vector<Variant> variants = {{"exact", "exact", path, {}, true, false}};
  for (Variant& variant : dial_of(file)) variants.push_back(std::move(variant));
  if (variants.size() == 1) return {};
  if (file.has_cells() && !scene.is_file()) {
    const OpenFile other(scene.base().path);
    for (Variant& variant : dial_of(other)) {
      variant.shown = variant.equal_time = false;
      variants.push_back(std::move(variant));
    }
  }
  return variants;
}

// All variants of the subject in turn, as often as times want it; exposed as the exact one. Empty where that
// is black.
std::vector<Taken> take(Context& context, const Subject& subject, const std::vector<Variant>& variants,
                        float& exposure) {
  const int repeats = context.quick ? 1 : 3;
  std::vector<Taken> taken;
  std::vector<std::vector<double>> seconds(variants.size());
  for (int repeat = 0; repeat < repeats; ++repeat) {
    for (size_t k = 0; k < variants.size(); ++k) {
      Rendered done = render(
          context, variants[k].file,
          {subject.light.effect, subject.light.radius, subject.view.camera, kSamples, variants[k].mode});
      seconds[k].push_back(done.seconds);
      if (repeat == 0) taken.push_back({variants[k], std::move(done.image), 0});
    }
  }
  exposure = exposure_for(subject.light.effect, taken[0].image);
  if (!(exposure > 0)) return {};
  for (size_t k = 0; k < taken.size(); ++k) {
    taken[k].seconds = timing_of(seconds[k]).median;
    for (glm::vec3& pixel : taken[k].image.pixels) pixel *= exposure;
  }
  return taken;
}

Json row_of(const Subject& subject, const std::string& mode) {
  Json row;
  row["scene"] = subject.scene;
  row["view"] = subject.view.name;
  row["light"] = subject.light.name;
  row["mode"] = mode;
  return row;
}

void add_picture_errors(Json& row, const Image& reference, const Image& image, const std::string& prefix) {
  const PictureErrors errors = picture_errors(reference, image);
  row[prefix + "mean_percent"] = 100 * errors.mean;
  row[prefix + "p99_percent"] = 100 * errors.p99;
  row[prefix + "blurred_percent"] = 100 * errors.blurred_mean;
  row[prefix + "blurred_p99_percent"] = 100 * errors.blurred_p99;
  row[prefix + "structure"] = errors.structure();
  row[prefix + "bias_percent"] = 100 * errors.bias;
  const Image shown = to_display(image), shown_reference = to_display(reference);
  row[prefix + "flip"] = flip(shown_reference, shown);
  row[prefix + "ssim"] = ssim(shown_reference, shown);
}

void add_same_samples(const Subject& subject, const std::vector<Taken>& taken, Table& table) {
  const Taken& exact = taken.front();
  for (size_t k = 1; k < taken.size(); ++k) {
    Json row = row_of(subject, taken[k].variant.name);
    row["samples"] = kSamples;
    row["exact_seconds"] = exact.seconds;
    row["seconds"] = taken[k].seconds;
    if (taken[k].seconds > 0) row["times"] = exact.seconds / taken[k].seconds;
    add_picture_errors(row, exact.image, taken[k].image, "");
    table.rows.push_back(row);
  }
}

// Exact rays with as many samples as take the time of each point of the dial.
void add_equal_time(Context& context, const Subject& subject, const std::vector<Taken>& taken, float exposure,
                    Table& table) {
  const auto exact = [&](unsigned samples) {
    Image image = render(context, taken[0].variant.file,
                         {subject.light.effect, subject.light.radius, subject.view.camera, samples, {}})
                      .image;
    for (glm::vec3& pixel : image.pixels) pixel *= exposure;
    return image;
  };
  const Image truth = exact(many_samples(context));
  for (const Taken& one : taken) {
    if (!one.variant.equal_time || !(taken[0].seconds > 0)) continue;
    const double share = one.seconds / taken[0].seconds;
    const auto samples = static_cast<unsigned>(std::clamp(std::lround(kSamples * share), 1l, 1l << 16));
    Json row = row_of(subject, one.variant.name);
    row["samples"] = kSamples;
    row["exact_samples"] = samples;
    add_picture_errors(row, truth, one.image, "");
    add_picture_errors(row, truth, exact(samples), "exact_");
    table.rows.push_back(row);
  }
}

void add_to_page(const Subject& subject, const std::vector<Taken>& taken, const Table& same,
                 Section& section) {
  std::vector<Exhibit> exhibits;
  size_t worst_of = 1;
  for (size_t k = 0; k < taken.size(); ++k) {
    const Variant& variant = taken[k].variant;
    if (!variant.shown) continue;
    if (variant.id == "balanced") worst_of = exhibits.size();
    const std::string id =
        subject.scene + "-" + subject.view.name + "-" + subject.light.name + "-" + variant.id;
    char figures[128] = "";
    if (k > 0) {
      // The rows of this subject are the table's last.
      const Json& row = same.rows[same.rows.size() - taken.size() + k];
      std::snprintf(figures, sizeof figures, ": %.1f %% off, %.1f %% after a blur, FLIP %.3f, %.2fx",
                    row["mean_percent"].get<double>(), row["blurred_percent"].get<double>(),
                    row["flip"].get<double>(), row.value("times", 0.0));
    }
    exhibits.push_back({id, variant.name, figures, taken[k].image});
  }
  std::string light = subject.light.effect;
  if (subject.light.radius > 0) {
    char text[96];
    std::snprintf(text, sizeof text, "ambient occlusion, radius %g of the diagonal", subject.light.radius);
    light = text;
  }
  section.pictures.push_back(
      exhibition(subject.scene + ", " + subject.view.name + ", " + light, exhibits, worst_of));
}

void measure(Context& context, SceneUnderTest& scene, const Subject& subject, Section& section,
             Tables& tables) {
  std::optional<Polished> polished, polished_other;
  std::vector<Variant> variants = variants_of(scene, context.cells(scene).path);
  if (variants.empty()) return;
  if (std::string_view(subject.light.effect) == "glossy") {
    const std::filesystem::path main = variants.front().file, other = variants.back().file;
    polished.emplace(main, context.cache);
    if (other != main) polished_other.emplace(other, context.cache);
    for (Variant& variant : variants)
      variant.file = variant.file == main ? polished->path() : polished_other->path();
  }
  float exposure = 1;
  const std::vector<Taken> taken = take(context, subject, variants, exposure);
  if (taken.empty()) {
    section.paragraphs.push_back(subject.scene + ", " + subject.view.name + ", " + subject.light.name +
                                 ": no light comes there; left out.");
    return;
  }
  add_same_samples(subject, taken, tables.same);
  add_to_page(subject, taken, tables.same, section);
  add_equal_time(context, subject, taken, exposure, tables.equal);
}

std::vector<Column> error_columns_of_pictures(const std::string& prefix, const std::string& whose) {
  return {{prefix + "mean_percent", whose + "error, %"},
          {prefix + "p99_percent", "99th", 1},
          {prefix + "blurred_percent", "blurred, %"},
          {prefix + "blurred_p99_percent", "99th", 1},
          {prefix + "structure", "blurred / error"},
          {prefix + "bias_percent", "bias, %"},
          {prefix + "flip", "FLIP", 4},
          {prefix + "ssim", "SSIM", 4}};
}

void set_columns(Tables& tables) {
  for (Table* table : {&tables.same, &tables.equal}) {
    table->columns = {
        {"scene", "scene"}, {"view", "view"}, {"light", "light"}, {"mode", "mode"}, {"samples", "samples"}};
  }
  const auto add = [](Table& table, const std::vector<Column>& columns) {
    table.columns.insert(table.columns.end(), columns.begin(), columns.end());
  };
  add(tables.same, {{"exact_seconds", "exact: indirect rays, s", 3},
                    {"seconds", "indirect rays, s", 3},
                    {"times", "x exact"}});
  add(tables.same, error_columns_of_pictures("", ""));
  add(tables.equal, error_columns_of_pictures("", ""));
  add(tables.equal, {{"exact_samples", "exact: samples in that time"}});
  add(tables.equal, error_columns_of_pictures("exact_", "its "));
}

}  // namespace

Section pictures_suite(Context& context) {
  Section section{"pictures", "What the error looks like", {}, {}, {}, {}};
  section.paragraphs.push_back(
      "Pictures of " + std::to_string(kSamples) +
      " samples a pixel, on the CPU; below each its difference to the exact one, four times as bright, and "
      "enlarged the framed part, where the default, balanced, is worst after a blur. The same random numbers "
      "drive all, so that a difference is the approximation's and not noise. Primary rays and light rays "
      "from "
      "what they see are exact. Wide is the scene at large, close a place near its surfaces where depth and "
      "normal change most from pixel to pixel. For glossy pictures every surface is metal of roughness 0.3.");
  section.paragraphs.push_back(
      "Errors are the mean and the 99th percentile over pixels of the absolute difference, over the exact "
      "picture's mean or a quarter of white, whichever is larger; ambient occlusion in [0, 1], light so "
      "exposed that the 95th percentile of what is not black is 0.9. Blurred: the same of pictures blurred "
      "by five pixels; their ratio is about 0.2 for noise and 1 for seams and facets, which a filter leaves. "
      "FLIP, at 67 pixels a degree, and SSIM are of display values. In equal time: against an exact picture "
      "of " +
      std::to_string(many_samples(context)) + " samples, so that noise counts for both.");
  Tables tables;
  set_columns(tables);
  context.each_scene(section, [&](SceneUnderTest& scene) {
    context.say_what_cells_are(scene, section);
    for (const View& view : views_of(context, scene)) {
      for (const Light& light : lights_of(context)) {
        const std::string what = scene.name() + ", " + view.name + ", " + light.name;
        context.progress("pictures: " + what);
        context.guarded(section, what, [&] {
          measure(context, scene, {scene.name(), view, light}, section, tables);
        });
      }
    }
  });
  section.tables = {std::move(tables.same), std::move(tables.equal)};
  return section;
}

}  // namespace lsp::bench
