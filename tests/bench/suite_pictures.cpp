// What the error looks like: ambient occlusion, a diffuse bounce and reflections, exact and approximate, as
// in the paper's figures 5 and 6; their errors, and those of exact with fewer rays, because a user can also
// buy speed by noise.
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <optional>

#include "context.h"
#include "image.h"
#include "lsp/program.h"
#include "process.h"

namespace lsp::bench {
namespace {

struct Shot {
  std::string effect;
  std::string mode;  // exact or approximate
  unsigned samples = 64;
  std::string size;
  bool near_approximate = false;
};

struct Rendered {
  Image image;
  double seconds = 0;  // in indirect rays
  double mrays = 0;
};

std::string camera_option(const Camera& camera) {
  char text[256];
  std::snprintf(text, sizeof text, "--camera=%.9g,%.9g,%.9g:%.9g,%.9g,%.9g:%.9g", camera.eye.x, camera.eye.y,
                camera.eye.z, camera.target.x, camera.target.y, camera.target.z, camera.fov_degrees);
  return text;
}

Rendered render(Context& context, const SceneUnderTest& scene, const Baked& baked, const Shot& shot) {
  const auto path = context.cache / "picture.pfm";
  std::vector<std::string> command = {program_path("lsp-render").string(),
                                      baked.path.string(),
                                      "-o",
                                      path.string(),
                                      "--effect",
                                      shot.effect,
                                      "--mode",
                                      shot.mode,
                                      "--samples",
                                      std::to_string(shot.samples),
                                      "--size",
                                      shot.size,
                                      "--threads",
                                      std::to_string(context.threads),
                                      camera_option(scene.camera()),
                                      "--json"};
  if (shot.near_approximate) command.insert(command.end(), {"--near", "approximate"});
  const ProcessResult result = run_process(command);
  if (result.exit_code != 0) {
    throw Failure(static_cast<Exit>(result.exit_code), baked.path.string(),
                  "lsp-render failed: " + result.errors.substr(0, result.errors.find('\n')));
  }
  const Json json = Json::parse(result.output, nullptr, false);
  if (json.is_discarded())
    throw Failure(Exit::kInternal, baked.path.string(), "lsp-render --json wrote no JSON");
  return {read_pfm(path.string()), json.value("indirect_seconds", 0.0),
          json.value("indirect_mrays_per_second", 0.0)};
}

// A copy of a bake whose surfaces all are polished metal, for pictures of reflections: most meshes come
// without any surface that reflects. The bake itself where it has no materials.
class Polished {
 public:
  Polished(const Baked& baked, const std::filesystem::path& folder) : baked_(baked) {
    uint64_t first = 0;
    uint32_t count = 0;
    {
      const OpenFile file(baked.path);
      const lsp_scene& scene = file.scene();
      if (!scene.materials || scene.header->material_count == 0) return;
      first = static_cast<uint64_t>(reinterpret_cast<const char*>(scene.materials) -
                                    static_cast<const char*>(scene.bytes));
      count = scene.header->material_count;
    }
    copy_ = folder / (baked.path.stem().string() + "-polished.lsp");
    std::filesystem::copy_file(baked.path, copy_, std::filesystem::copy_options::overwrite_existing);
    baked_.path = copy_;
    std::fstream file(copy_, std::ios::binary | std::ios::in | std::ios::out);
    for (uint32_t i = 0; i < count; ++i) {
      const auto at = static_cast<std::streamoff>(first + i * sizeof(LspMaterial));
      LspMaterial material;
      file.seekg(at).read(reinterpret_cast<char*>(&material), sizeof material);
      material.roughness = kRoughness;
      material.metallic = 1;
      file.seekp(at).write(reinterpret_cast<const char*>(&material), sizeof material);
    }
    file.close();
    if (!file) throw Failure(Exit::kFile, copy_.string(), "cannot be written, make room");
  }
  ~Polished() {
    std::error_code ignored;
    if (!copy_.empty()) std::filesystem::remove(copy_, ignored);
  }
  Polished(const Polished&) = delete;
  Polished& operator=(const Polished&) = delete;

  const Baked& baked() const { return baked_; }
  static constexpr float kRoughness = 0.3f;

 private:
  Baked baked_;
  std::filesystem::path copy_;
};

// So that the reference's 95th percentile is near white: pictures of dark scenes must show something too.
float exposure_for(const std::string& effect, const Image& image) {
  if (effect == "ao") return 1;
  std::vector<float> values;
  for (const glm::vec3& pixel : image.pixels) values.push_back(std::max({pixel.r, pixel.g, pixel.b}));
  const auto at = values.begin() + static_cast<ptrdiff_t>(values.size() * 95 / 100);
  std::nth_element(values.begin(), at, values.end());
  return *at > 0 ? std::min(0.9f / *at, 1e4f) : 1;
}

void add_errors(Json& row, const Rendered& truth, const Rendered& done, float exposure) {
  const Image truth_display = to_display(truth.image, exposure), display = to_display(done.image, exposure);
  row["seconds"] = done.seconds;
  row["mrays"] = done.mrays;
  row["rmse"] = rmse(truth.image, done.image);
  row["bias"] = bias(truth.image, done.image);
  row["psnr"] = psnr(truth_display, display);
  row["ssim"] = ssim(truth_display, display);
  row["flip"] = flip(truth_display, display);
}

std::vector<Column> picture_error_columns() {
  return {{"seconds", "indirect rays, s", 3},
          {"mrays", "Mrays/s"},
          {"rmse", "RMSE", 4},
          {"bias", "bias", 4},
          {"psnr", "PSNR, dB", 1},
          {"ssim", "SSIM", 4},
          {"flip", "FLIP", 4}};
}

// Small pictures of many samples: what is left of the error when the noise is gone, and what noise costs.
void add_measured(Context& context, const SceneUnderTest& scene, const Baked& baked,
                  const std::string& effect, Table& table) {
  const unsigned many = context.quick || effect != "ao" ? 256 : 1024;
  const std::string size = context.quick ? "64x36" : "112x63";
  const Rendered truth = render(context, scene, baked, {effect, "exact", many, size});
  const float exposure = exposure_for(effect, truth.image);
  const Shot shots[] = {{effect, "exact", 64, size},
                        {effect, "approximate", 64, size},
                        {effect, "exact", 32, size},
                        {effect, "exact", 16, size},
                        {effect, "approximate", many, size}};
  for (const Shot& shot : shots) {
    Json row;
    row["scene"] = scene.name();
    row["effect"] = effect;
    row["mode"] = shot.mode;
    row["samples"] = shot.samples;
    add_errors(row, truth, render(context, scene, baked, shot), exposure);
    table.rows.push_back(row);
  }
}

// |difference| in shares of white.
std::vector<float> difference_of(const Image& a, const Image& b, float exposure) {
  std::vector<float> out(a.pixels.size());
  for (size_t i = 0; i < out.size(); ++i) {
    const glm::vec3 off = glm::abs(a.pixels[i] - b.pixels[i]);
    out[i] = exposure * std::max({off.r, off.g, off.b});
  }
  return out;
}

constexpr float kHeatFull = 0.25f;  // what the brightest colour of a heat map stands for

Image heat_map(const Image& like, const std::vector<float>& difference) {
  Image map(like.width, like.height);
  for (size_t i = 0; i < difference.size(); ++i) map.pixels[i] = heat_colour(difference[i] / kHeatFull);
  return map;
}

struct Spot {
  uint32_t x = 0, y = 0, width = 0, height = 0;
};

// The eighth of the picture, in width and height, where the difference is largest.
Spot worst_spot(const Image& like, const std::vector<float>& difference) {
  Spot best{0, 0, like.width / 8, like.height / 8};
  double best_sum = -1;
  for (uint32_t y = 0; y + best.height <= like.height; y += 2) {
    for (uint32_t x = 0; x + best.width <= like.width; x += 2) {
      double sum = 0;
      for (uint32_t j = 0; j < best.height; ++j) {
        for (uint32_t i = 0; i < best.width; ++i) sum += difference[size_t{y + j} * like.width + x + i];
      }
      if (sum > best_sum) best_sum = sum, best.x = x, best.y = y;
    }
  }
  return best;
}

struct Variant {
  std::string name, id;
  const Baked* baked;
  Shot shot;
};

// The paper's figures: pictures in a row, the same detail of each below, heat maps below that.
void add_figure(Context& context, const SceneUnderTest& scene, const Baked& bvh, const Baked& ntree,
                const std::string& effect, Section& section, Table& table) {
  const std::string size = context.quick ? "192x108" : "320x180";
  const unsigned samples = context.quick ? 16 : effect == "ao" ? 64 : 32;
  std::vector<Variant> columns = {{"exact", "exact", &bvh, {effect, "exact", samples, size}}};
  if (OpenFile(bvh.path).has_line_spaces()) {
    columns.push_back({context.quick ? "BVH, LS (9), N = 4" : "BVH, LS (9)",
                       "bvh",
                       &bvh,
                       {effect, "approximate", samples, size}});
    columns.push_back({"BVH, LS (9), near field approximate as in the paper",
                       "bvh-near",
                       &bvh,
                       {effect, "approximate", samples, size, true}});
  }
  if (ntree.available)
    columns.push_back({"NTree (6, 3), LS (1)", "ntree", &ntree, {effect, "approximate", samples, size}});

  std::vector<Rendered> shots;
  for (const Variant& column : columns) shots.push_back(render(context, scene, *column.baked, column.shot));
  const float exposure = exposure_for(effect, shots[0].image);
  std::vector<std::vector<float>> differences;
  for (const Rendered& shot : shots)
    differences.push_back(difference_of(shots[0].image, shot.image, exposure));
  const Spot spot = worst_spot(shots[0].image, differences[shots.size() > 1 ? 1 : 0]);

  PictureGrid grid;
  grid.title = scene.name() + ", " + effect;
  grid.columns = columns.size();
  grid.legend = "a quarter of white and more";
  std::vector<Picture> details, heats;
  for (size_t k = 0; k < columns.size(); ++k) {
    const std::string id = scene.name() + "-" + effect + "-" + columns[k].id;
    Image display = to_display(shots[k].image, exposure);
    details.push_back(
        {id + "-detail", "", encode_png(crop(display, spot.x, spot.y, spot.width, spot.height))});
    std::string caption = columns[k].name;
    if (k > 0) {
      Json row;
      row["scene"] = scene.name();
      row["effect"] = effect;
      row["structure"] = columns[k].name;
      row["samples"] = samples;
      row["exact_seconds"] = shots[0].seconds;
      add_errors(row, shots[0], shots[k], exposure);
      char text[96];
      std::snprintf(text, sizeof text, ": RMSE %.4f, FLIP %.4f, %.2fx", row["rmse"].get<double>(),
                    row["flip"].get<double>(),
                    shots[k].seconds > 0 ? shots[0].seconds / shots[k].seconds : 0.0);
      caption += text;
      table.rows.push_back(row);
      heats.push_back({id + "-heat", columns[k].name, encode_jpeg(heat_map(display, differences[k])), true});
    } else {
      heats.push_back({id + "-heat", "difference to exact",
                       encode_png(Image(display.width, display.height, heat_colour(0)))});
    }
    draw_frame(display, spot.x, spot.y, spot.width, spot.height, {1, 0.1f, 0.1f});
    grid.pictures.push_back({id, caption, encode_jpeg(display), true});
  }
  grid.pictures.insert(grid.pictures.end(), details.begin(), details.end());
  grid.pictures.insert(grid.pictures.end(), heats.begin(), heats.end());
  section.pictures.push_back(std::move(grid));
}

}  // namespace

Section pictures_suite(Context& context) {
  Section section{"pictures", "What the error looks like", {}, {}, {}, {}};
  section.paragraphs.push_back(
      std::string("Rows: pictures of ") + (context.quick ? "16" : "64, of diffuse and glossy light 32,") +
      " samples a pixel; the detail framed in red, where the first approximate picture errs most; the "
      "difference to "
      "the exact picture as a heat map. The same random numbers drive all, so that a difference is the "
      "approximation's and not noise. For glossy pictures every surface is metal of roughness 0.3. Primary "
      "rays are exact. Factors are of the time in indirect rays. Near "
      "field "
      "exact unless it says otherwise.");
  section.paragraphs.push_back(std::string("The table of picture errors is against an exact picture of ") +
                               (context.quick ? "256" : "1024 (diffuse and glossy: 256)") +
                               " samples a pixel, N = " + (context.quick ? "4" : "6") +
                               ", D = 9. SSIM and FLIP (67 pixels a degree) are of display values at one "
                               "exposure a scene and effect; RMSE "
                               "and bias of linear light, for ambient occlusion in [0, 1].");
  Table measured{"pictures", "Picture errors, and what fewer exact rays cost", "", {}, {}};
  measured.columns = {{"scene", "scene"}, {"effect", "effect"}, {"mode", "mode"}, {"samples", "samples"}};
  Table figures{
      "figures", "Errors of the pictures above, against the exact one of as many samples", "", {}, {}};
  figures.columns = {{"scene", "scene"},
                     {"effect", "effect"},
                     {"structure", "structure"},
                     {"samples", "samples"},
                     {"exact_seconds", "exact: indirect rays, s", 3}};
  for (Table* table : {&measured, &figures}) {
    for (const Column& column : picture_error_columns()) table->columns.push_back(column);
  }
  const std::vector<std::string> effects =
      context.quick ? std::vector<std::string>{"ao"} : std::vector<std::string>{"ao", "diffuse", "glossy"};
  context.each_scene(section, [&](SceneUnderTest& scene) {
    for (const std::string& effect : effects) {
      const std::string what = scene.name() + ", " + effect;
      context.progress("pictures: " + what);
      context.guarded(section, what, [&] {
        const Baked& bvh = scene.base();
        const Baked& ntree = scene.bake(ntree_bake(6, 1));
        if (effect != "glossy") {
          add_figure(context, scene, bvh, ntree, effect, section, figures);
          add_measured(context, scene, bvh, effect, measured);
          return;
        }
        const Polished polished(bvh, context.cache);
        std::optional<Polished> polished_ntree;
        if (ntree.available) polished_ntree.emplace(ntree, context.cache);
        add_figure(context, scene, polished.baked(), polished_ntree ? polished_ntree->baked() : ntree, effect,
                   section, figures);
        add_measured(context, scene, polished.baked(), effect, measured);
      });
    }
  });
  section.tables = {std::move(measured), std::move(figures)};
  return section;
}

}  // namespace lsp::bench
