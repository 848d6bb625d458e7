// lsp-render: a picture of an .lsp file or a scene of instances, its indirect light traced exactly or
// approximately.
#include <tbb/global_control.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <optional>

#include "exposure.h"
#include "heat.h"
#include "lsp/command_line.h"
#include "lsp/file_ending.h"
#include "lsp/json_result.h"
#include "lsp/lsp_vulkan.h"
#include "lsp/output_file.h"
#include "lsp/trace_arguments.hpp"
#include "renderer.h"

namespace lsp::sample {
namespace {

struct Arguments {
  std::string file;
  std::vector<std::string> outputs;
  std::string effect = "all";
  std::string heat;
  std::string mode = "exact";
  TraceArguments trace;
  std::string light_quality;
  std::string camera;
  std::string size = "1280x720";
  std::string backend = "cpu";
  std::string sun;
  float verify_percent = 0.0f;
  std::string up;
  std::string exposure;
  RenderOptions options;
};

// Nothing: the sky's own.
std::optional<glm::vec3> parse_sun(const std::string& text) {
  if (text.empty()) return std::nullopt;
  glm::vec3 d(0.0f);
  int used = 0;
  const int count = std::sscanf(text.c_str(), "%f,%f,%f%n", &d.x, &d.y, &d.z, &used);
  if (count != 3 || static_cast<size_t>(used) != text.size() || !(glm::length(d) > 0) ||
      !std::isfinite(glm::length(d))) {
    throw Failure(Exit::kUsage, "", "--sun '" + text + "' is not X,Y,Z, the direction towards the sun");
  }
  return glm::normalize(d);
}

Effect parse_effect(const std::string& name) {
  if (name == "ao") return Effect::kAmbientOcclusion;
  if (name == "direct") return Effect::kDirect;
  if (name == "diffuse") return Effect::kDiffuse;
  if (name == "glossy") return Effect::kGlossy;
  return Effect::kAll;
}

// Of rays to lights from where indirect rays land.
lsp_trace_options light_options(const Arguments& arguments, bool approximate) {
  if (arguments.light_quality == "exact") return {};
  TraceArguments trace = arguments.trace;
  if (!arguments.light_quality.empty()) {
    trace.quality = arguments.light_quality;
    trace.max_loss = -1;
  }
  return to_trace_options(trace, approximate);
}

Heat parse_heat(const std::string& name) {
  return name == "loss" ? Heat::kLoss : name == "steps" ? Heat::kSteps : Heat::kExact;
}

// --heat: a map in place of the picture.
void run_heat(const Arguments& arguments, const CommonOptions& common, const RenderScene& scene,
              const Camera& camera, const RenderOptions& options) {
  const bool show_progress = !common.quiet && isatty(STDERR_FILENO) != 0;
  const HeatMap map = heat_map(scene, camera,
                               {parse_heat(arguments.heat), options.indirect, options.width, options.height,
                                options.samples, options.threads},
                               [&](double done) {
                                 if (show_progress) std::fprintf(stderr, "\rheat %3.0f %%", 100.0 * done);
                               });
  if (show_progress) std::fprintf(stderr, "\r               \r");
  for (const std::string& output : arguments.outputs) {
    const bool colors = file_ending(output) == ".png";
    write_picture(output, colors ? in_colors(map) : map.values, Transfer::kDisplay);
  }
  if (common.json) {
    json_result() = {{"file", arguments.file},     {"outputs", arguments.outputs},
                     {"heat", arguments.heat},     {"mode", arguments.mode},
                     {"width", options.width},     {"height", options.height},
                     {"samples", options.samples}, {"camera", to_string(camera)},
                     {"mean", map.mean},           {"white", map.top}};
  } else if (!common.quiet) {
    std::printf("%s: heat of %s, %d x %d, %u samples: mean %.4g a ray, white is %.4g; camera %s%s\n",
                arguments.outputs.front().c_str(), arguments.heat.c_str(), options.width, options.height,
                options.samples, map.mean, static_cast<double>(map.top), to_string(camera).c_str(),
                up_option(camera));
  }
}

// What the user should know before it starts.
void print_notes(const Arguments& arguments, const char* program, const RenderScene& scene,
                 bool approximate) {
  const auto say = [&](const std::string& note) {
    std::cerr << program << ": " << arguments.file << ": " << note << "\n";
  };
  for (const std::string& note : scene.notes()) say(note);
  for (const std::string& note : unused_arguments(arguments.trace, approximate, scene.headers())) say(note);
  if (!arguments.light_quality.empty() && !approximate) say("--light-quality does nothing: rays are exact");
  if (!arguments.light_quality.empty() && approximate && arguments.effect == "ao")
    say("--light-quality does nothing: ambient occlusion has no rays to lights");
  if (arguments.options.denoise && !arguments.heat.empty())
    say("--denoise does nothing: --heat shows rays as they are");
  if (arguments.options.bounces > 1 && (arguments.effect == "ao" || arguments.effect == "direct"))
    say("--bounces does nothing: --effect " + arguments.effect + " has no indirect light");
  if (arguments.verify_percent > 0 && !approximate) say("--verify does nothing: rays are exact");
  if (arguments.verify_percent > 0 && approximate && !arguments.heat.empty())
    say("--verify does nothing: --heat shows rays as they are");
  if (approximate && !scene.has_tables())
    say("neither Line Spaces nor cells in the file: approximate rays are exact");
}

double mega(uint64_t rays, double seconds) {
  return seconds > 0 ? static_cast<double>(rays) / seconds * 1e-6 : 0;
}

void print_report(const Arguments& arguments, const CommonOptions& common, const RenderOptions& options,
                  const Camera& camera, float stops, const RayTracer& tracer, const RenderReport& report) {
  const double rate = mega(report.indirect_rays, report.indirect_seconds);
  if (common.json) {
    json_result() = {
        {"file", arguments.file},
        {"outputs", arguments.outputs},
        {"effect", arguments.effect},
        {"mode", arguments.mode},
        {"near", arguments.trace.near},
        {"lod", arguments.trace.lod},
        {"light_quality", arguments.light_quality.empty() ? "as the others" : arguments.light_quality},
        {"width", options.width},
        {"height", options.height},
        {"samples", options.samples},
        {"bounces", options.bounces},
        {"denoised", options.denoise},
        {"camera", to_string(camera)},
        {"up", camera.up.z > 0 ? "z" : "y"},
        {"exposure", stops},
        {"verify", 100.0f * options.verify},
        {"backend", arguments.backend},
        {"device", tracer.device()},
        {"load_path", tracer.load_path()},
        {"dispatches", tracer.dispatches()},
        {"seconds", report.seconds},
        {"primary_rays", report.primary_rays},
        {"primary_seconds", report.primary_seconds},
        {"shadow_rays", report.shadow_rays},
        {"shadow_seconds", report.shadow_seconds},
        {"indirect_rays", report.indirect_rays},
        {"indirect_seconds", report.indirect_seconds},
        {"indirect_mrays_per_second", rate},
        {"paths", report.paths},
        {"verified_paths", report.verified_paths},
        {"mean_luminance", report.mean_luminance}};
  } else if (!common.quiet) {
    std::printf("%s: %d x %d, %u samples, %s, %s, %s\n", arguments.outputs.front().c_str(), options.width,
                options.height, options.samples, arguments.effect.c_str(), arguments.mode.c_str(),
                tracer.device().c_str());
    std::printf(
        "%.2f s; indirect %.2f Mrays in %.2f s: %.2f Mrays/s; primary %.2f s, shadow %.2f s; camera %s%s\n",
        report.seconds, static_cast<double>(report.indirect_rays) * 1e-6, report.indirect_seconds, rate,
        report.primary_seconds, report.shadow_seconds, to_string(camera).c_str(), up_option(camera));
  }
}

void run(const Arguments& arguments, const CommonOptions& common, const char* program) {
  RenderOptions options = arguments.options;
  options.effect = parse_effect(arguments.effect);
  const bool approximate = arguments.mode == "approximate";
  options.indirect = to_trace_options(arguments.trace, approximate);
  if (approximate) options.verify = arguments.verify_percent / 100.0f;
  options.light = light_options(arguments, approximate);
  const glm::ivec2 size = parse_size(arguments.size);
  options.width = size.x;
  options.height = size.y;
  for (const std::string& output : arguments.outputs) {
    check_picture_name(output);
    check_output(output);
  }
  const std::optional<float> exposure = parse_exposure(arguments.exposure, !arguments.camera.empty());
  if (!arguments.camera.empty()) parse_camera(arguments.camera);
  const std::optional<glm::vec3> sun = parse_sun(arguments.sun);

  // Without this oneTBB would never use more threads than there are cores.
  std::optional<tbb::global_control> allowed;
  if (options.threads > 0) {
    allowed.emplace(tbb::global_control::max_allowed_parallelism, static_cast<size_t>(options.threads));
  }
  const RenderScene scene(arguments.file);
  if (!common.quiet) print_notes(arguments, program, scene, approximate);
  const uint32_t uses = LSP_USE_EXACT | (approximate ? LSP_USE_APPROXIMATE : 0u);
  const auto tracer = arguments.backend == "vulkan" ? make_vulkan_tracer(scene, uses)
                                                    : make_cpu_tracer(scene, options.threads);
  const float aspect = static_cast<float>(options.width) / static_cast<float>(options.height);
  const Shot shot = choose_shot(scene, *tracer, arguments.camera, arguments.up, sun, aspect);
  if (!common.quiet) {
    for (const std::string& note : shot.notes)
      std::cerr << program << ": " << arguments.file << ": " << note << "\n";
  }
  if (!arguments.heat.empty()) return run_heat(arguments, common, scene, shot.camera, options);
  const bool show_progress = !common.quiet && isatty(STDERR_FILENO) != 0;
  RenderReport report;
  const Picture picture = render(scene, shot.sky, shot.camera, options, *tracer, report, [&](double done) {
    if (show_progress) std::fprintf(stderr, "\rrendering %3.0f %%", 100.0 * done);
  });
  if (show_progress) std::fprintf(stderr, "\r               \r");
  const bool grey = options.effect == Effect::kAmbientOcclusion;
  const float stops =
      exposure ? *exposure : chosen_exposure(report.surface_luminance, report.bright_luminance);
  for (const std::string& output : arguments.outputs) {
    Picture shown = picture;
    if (file_ending(output) == ".png" && !grey) {
      for (glm::vec3& pixel : shown.pixels) pixel *= std::exp2(stops);
    }
    write_picture(output, shown, grey ? Transfer::kDisplay : Transfer::kToneMapped);
  }

  print_report(arguments, common, options, shot.camera, stops, *tracer, report);
}

}  // namespace
}  // namespace lsp::sample

int main(int argc, char** argv) {
  using namespace lsp;
  using namespace lsp::sample;
  constexpr const char* kProgram = "lsp-render";
  CLI::App app(
      "Renders an .lsp file or a scene of instances of several. Primary rays are exact; --mode governs "
      "indirect rays.",
      kProgram);
  CommonOptions common;
  Arguments a;
  add_common_options(app, kProgram, common);
  app.add_option("FILE.lsp", a.file, "The baked scene: an .lsp file, or .json with instances of several")
      ->required();
  app.add_option("-o,--output", a.outputs,
                 "The picture: .png (tone-mapped) or .pfm (linear floats); may be given twice")
      ->required()
      ->allow_extra_args(false);
  app.add_option("--effect", a.effect, "The light that is shown (default all)")
      ->check(CLI::IsMember({"ao", "diffuse", "glossy", "all", "direct"}));
  app.add_option("--heat", a.heat,
                 "A map in place of the picture, black to white: loss (where rays are wrong), steps (where "
                 "work goes) "
                 "or exact (where tables are not heeded); .pfm keeps the numbers")
      ->check(CLI::IsMember({"loss", "steps", "exact"}));
  app.add_option("--mode", a.mode, "How indirect rays are traced (default exact)")
      ->check(CLI::IsMember({"exact", "approximate"}));
  add_trace_arguments(app, a.trace);
  app.add_option("--light-quality", a.light_quality,
                 "Approximate, cells: the quality of rays to lights from where indirect rays land, most of "
                 "all rays, whose errors show least; exact: none of them errs (default: as --quality and "
                 "--max-loss say)")
      ->check(CLI::IsMember({"fast", "balanced", "accurate", "exact"}));
  app.add_option(
         "--verify", a.verify_percent,
         "Approximate: share of indirect paths that are traced exactly, too, and correct the others, "
         "in per cent: errors become noise, the mean of many samples is the exact picture (default 0)")
      ->check(CLI::Range(0.0f, 100.0f));
  app.add_option("--camera", a.camera,
                 "X,Y,Z:X,Y,Z:FOV, the vertical angle in degrees (default: from the scene)");
  app.add_option("--size", a.size,
                 "In pixels (default 1280x720); traced in pieces, so that no device is kept busy for long");
  app.add_option("--samples", a.options.samples, "Samples a pixel (default 16)")
      ->check(CLI::Range(1u, 1u << 20));
  app.add_option("--bounces", a.options.bounces, "Bounces of indirect light (default 1)")
      ->check(CLI::Range(1, 16));
  app.add_option("--radius,--ao-distance", a.options.ao_distance,
                 "Reach of --effect ao in diagonals of the scene (default 0.1)")
      ->check(CLI::Range(1e-6f, 1e6f));
  app.add_flag("--denoise", a.options.denoise, "Filter the noise of few samples out of the picture");
  app.add_option(
         "--up", a.up,
         "Which axis is up: y or z (default y; without --camera as shape and source suggest, z with a note)")
      ->check(CLI::IsMember({"y", "z"}));
  app.add_option("--sun", a.sun, "Direction towards the sun");
  app.add_option("--exposure", a.exposure,
                 "Stops to brighten a .png by, or auto: what is too dark or too bright is brought into range "
                 "(default auto, with --camera 0)");
  app.add_option("--backend", a.backend,
                 "Where rays are traced (default cpu); of a scene of instances vulkan needs assets "
                 "with cells or wide nodes")
      ->check(CLI::IsMember({"cpu", "vulkan"}));
  add_threads(app, a.options.threads, "Threads of the CPU");
  arrange_help(
      app, "lsp-render room.lsp -o room.png --effect diffuse --mode approximate",
      {{"What most people need",
        {"FILE.lsp", "--output FILE", "--effect", "--mode", "--camera EYE:TARGET:ANGLE", "--samples"}},
       {"The picture", {"--size WxH", "--exposure STOPS|auto", "--denoise", "--heat"}},
       {"Light", {"--bounces", "--radius", "--up", "--sun X,Y,Z"}},
       {"Approximate mode",
        {"--near", "--lod", "--quality", "--max-loss PERCENT", "--light-quality", "--verify PERCENT"}},
       {"The machine", {"--backend", "--threads"}}});
  return run_program(kProgram, app, argc, argv, [&] { run(a, common, kProgram); });
}
