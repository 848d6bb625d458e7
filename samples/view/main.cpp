// lsp-view: flies through an .lsp file or a scene of instances, exact light on the left of a line,
// approximate light on its right.
#include <cstdio>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#define GLFW_INCLUDE_NONE
#include "bake_first.h"
#include "controls.h"
#include "exposure.h"
#include "exposure_meter.h"
#include "lsp/command_line.h"
#include "lsp/file_ending.h"
#include "lsp/instanced_scene.hpp"
#include "lsp/json_result.h"
#include "lsp/output_file.h"
#include "lsp/trace_arguments.hpp"
#include "picture.h"
#include "renderer.h"

#include <GLFW/glfw3.h>

namespace lsp::sample {
namespace {

constexpr const char* kProgram = "lsp-view";
const std::vector<std::string> kEffects{"light", "diffuse", "ao", "heat"};  // by VIEW_LIGHT and so on

struct Arguments {
  std::string file;
  std::string effect = "light";
  TraceArguments trace;
  std::string camera;
  std::string up;
  std::string size = "960x540";
  std::string exposure;
  std::string screenshot;
  uint32_t frames = 0;  // 0: until the window is closed
  bool validation = false;
  std::optional<float> split;  // nothing: by what the file has
  ViewState state;
};

// GLFW, and a window of it.
class Window {
 public:
  explicit Window(glm::ivec2 size) {
    if (glfwInit() != GLFW_TRUE) {
      throw Failure(Exit::kUnsupported, "",
                    "there is no display to open a window on; run it from a desktop, under xvfb-run, or use "
                    "lsp-render");
    }
    glfwWindowHint(GLFW_CLIENT_API, GLFW_NO_API);
    window_ = glfwCreateWindow(size.x, size.y, kProgram, nullptr, nullptr);
    if (window_ == nullptr) {
      glfwTerminate();
      throw Failure(Exit::kUnsupported, "",
                    "the display opens no window of " + std::to_string(size.x) + "x" +
                        std::to_string(size.y) + "; choose another --size");
    }
  }
  ~Window() {
    glfwDestroyWindow(window_);
    glfwTerminate();
  }
  Window(const Window&) = delete;
  Window& operator=(const Window&) = delete;
  GLFWwindow* handle() const { return window_; }

 private:
  GLFWwindow* window_ = nullptr;
};

bool has_cells(const RenderScene& scene) {
  return std::ranges::any_of(scene.headers(), [](const LspHeader* header) {
    return (header->required_features & LSP_FEATURE_CELLS) != 0;
  });
}

std::string dial_name(const lsp_trace_options& options, const RenderScene& scene) {
  char text[64] = "approximate";
  if (!scene.has_tables()) return "exact, no tables";  // what approximate rays are then
  if (!has_cells(scene)) {
    if (options.lod > 0) std::snprintf(text, sizeof text, "lod %g", static_cast<double>(options.lod));
  } else if ((options.flags & LSP_TRACE_MAX_LOSS) != 0) {
    std::snprintf(text, sizeof text, "max loss %g %%", static_cast<double>(options.max_loss));
  } else {
    const char* const names[] = {"balanced", "fast", "accurate"};
    return names[options.quality];
  }
  return text;
}

double milliseconds(const ViewReport& report, uint32_t part) {
  return report.samples > 0 ? 1e3 * report.seconds[part] / report.samples : 0;
}

// Of the halves that there are.
std::string figures(const ViewReport& report, const ViewState& state, const RenderScene& scene) {
  const double exact = report.mrays(VIEW_EXACT), approximate = report.mrays(VIEW_APPROXIMATE);
  char text[256];
  std::string line = kEffects[state.effect];
  const auto add = [&](const char* before, const std::string& name, uint32_t part) {
    std::snprintf(text, sizeof text, "%s%s %.1f ms, %.2f Mrays/s", before, name.c_str(),
                  milliseconds(report, part), report.mrays(part));
    line += text;
  };
  if (state.split > 0) add(": ", "exact", VIEW_EXACT);
  if (state.split < 1)
    add(state.split > 0 ? " | " : ": ", dial_name(state.approximate, scene), VIEW_APPROXIMATE);
  if (exact > 0 && approximate > 0) {
    std::snprintf(text, sizeof text, ", %.2fx", approximate / exact);
    line += text;
  }
  std::snprintf(text, sizeof text, " | %u samples, %.0f ms each", report.samples, 1e3 * report.frame_seconds);
  return line + text;
}

// Keeps the window up until it is closed or has shown so many frames. `meter`: null where the exposure is
// what it is.
void show(Viewer& viewer, GLFWwindow* window, ViewState& state, ExposureMeter* meter,
          const Arguments& arguments, const RenderScene& scene) {
  Controls controls(window, state.camera, scene.diagonal());
  double titled = -1.0;
  double metered = glfwGetTime();
  uint32_t shown = 0;
  while (glfwWindowShouldClose(window) == GLFW_FALSE && (arguments.frames == 0 || shown < arguments.frames)) {
    glfwPollEvents();
    const bool moving = controls.apply(state);
    const double time = glfwGetTime();
    if (meter != nullptr) meter->follow(state, static_cast<float>(time - metered));
    metered = time;
    const ViewState now = state;
    const bool done = viewer.frame(now, moving, [&] {
      glfwPollEvents();
      controls.apply(state);
      return !state.same_samples(now) || glfwWindowShouldClose(window) != GLFW_FALSE;
    });
    if (done) ++shown;
    if (!done && glfwGetWindowAttrib(window, GLFW_ICONIFIED) != GLFW_FALSE) glfwWaitEventsTimeout(0.2);
    if (glfwGetTime() - titled < 0.5 || !done) continue;
    titled = glfwGetTime();
    glfwSetWindowTitle(
        window, ("lsp-view " + arguments.file + " | " + figures(viewer.report(), state, scene)).c_str());
  }
}

void report(const ViewReport& r, const ViewState& state, const Arguments& arguments,
            const CommonOptions& common, const Gpu& gpu, const RenderScene& scene) {
  const auto half = [&](uint32_t part) {
    return nlohmann::ordered_json{{"rays", r.rays[part]},
                                  {"seconds", r.seconds[part]},
                                  {"milliseconds_per_sample", milliseconds(r, part)},
                                  {"mrays_per_second", r.mrays(part)},
                                  {"steps", r.steps[part]}};
  };
  if (common.json) {
    json_result() = {{"file", arguments.file},
                     {"device", gpu.properties.deviceName},
                     {"effect", kEffects[state.effect]},
                     {"split", state.split},
                     {"dial", dial_name(state.approximate, scene)},
                     {"exposure", state.exposure},
                     {"camera", to_string(state.camera)},
                     {"samples", r.samples},
                     {"exact", half(VIEW_EXACT)},
                     {"approximate", half(VIEW_APPROXIMATE)},
                     {"incomplete", r.incomplete},
                     {"screenshot", arguments.screenshot},
                     {"validation_messages", gpu.messages}};
  } else if (!common.quiet) {
    std::printf("%s, %s\n%s\ncamera %s%s\n", arguments.file.c_str(), gpu.properties.deviceName,
                figures(r, state, scene).c_str(), to_string(state.camera).c_str(), up_option(state.camera));
  }
}

void say(const CommonOptions& common, const std::string& file, const std::vector<std::string>& notes) {
  if (common.quiet) return;
  for (const std::string& note : notes) std::cerr << kProgram << ": " << file << ": " << note << "\n";
}

// The exposure that lsp-render chooses of a small picture, of `longest` pixels along its longer side, traced
// on the CPU by so many threads.
float automatic_exposure(const RenderScene& scene, const Sky& sky, const ViewState& state, glm::ivec2 size,
                         float longest, int threads) {
  RenderOptions options;
  options.effect = state.effect == VIEW_DIFFUSE ? Effect::kDiffuse : Effect::kAll;
  const float scale = std::min(1.0f, longest / static_cast<float>(std::max(size.x, size.y)));
  options.width = std::max(1, static_cast<int>(scale * static_cast<float>(size.x)));
  options.height = std::max(1, static_cast<int>(scale * static_cast<float>(size.y)));
  options.samples = 4;
  options.threads = threads;
  RenderReport report;
  render(scene, sky, state.camera, options, *make_cpu_tracer(scene, threads), report, {});
  return chosen_exposure(report.surface_luminance, report.bright_luminance);
}

// The file, or a mesh once it is baked.
std::unique_ptr<RenderScene> open_scene(const std::string& file, const CommonOptions& common) {
  if (file_ending(file) == ".lsp" || is_instanced_scene(file)) return std::make_unique<RenderScene>(file);
  say(common, file, {"is baked first; to keep that: lsp-bake " + file + " -o scene.lsp"});
  const BakedFile baked(file, common.quiet);
  if (!common.quiet) {
    for (const std::string& note : baked.notes()) std::cerr << kProgram << ": note: " << note << "\n";
  }
  return std::make_unique<RenderScene>(baked.path());  // a mapping needs no name
}

// What the user should know before the window opens.
void say_notes(const Arguments& arguments, const CommonOptions& common, const RenderScene& scene) {
  say(common, arguments.file, scene.notes());
  say(common, arguments.file, unused_arguments(arguments.trace, true, scene.headers()));
  if (!scene.has_tables())
    say(common, arguments.file, {"neither Line Spaces nor cells in the file: every ray is exact"});
}

void run(Arguments& arguments, const CommonOptions& common) {
  if (!arguments.screenshot.empty() && file_ending(arguments.screenshot) != ".png")
    throw Failure(Exit::kUsage, arguments.screenshot, "screenshots are written as .png; choose such a name");
  if (!arguments.screenshot.empty()) check_output(arguments.screenshot);
  if (!arguments.screenshot.empty() && arguments.frames == 0)
    throw Failure(Exit::kUsage, "", "--screenshot needs --frames, how many to render before it is taken");
  const glm::ivec2 size = parse_size(arguments.size);
  ViewState& state = arguments.state;
  state.approximate = to_trace_options(arguments.trace, true);
  state.effect = static_cast<uint32_t>(std::ranges::find(kEffects, arguments.effect) - kEffects.begin());
  if (!arguments.camera.empty()) parse_camera(arguments.camera);
  const std::optional<float> exposure = parse_exposure(arguments.exposure, !arguments.camera.empty());

  const std::unique_ptr<RenderScene> opened = open_scene(arguments.file, common);
  const RenderScene& scene = *opened;
  say_notes(arguments, common, scene);
  state.split = arguments.split.value_or(scene.has_tables() ? 0.0f : 1.0f);
  const float aspect = static_cast<float>(size.x) / static_cast<float>(size.y);
  const Shot shot =
      choose_shot(scene, *make_cpu_tracer(scene, 0), arguments.camera, arguments.up, std::nullopt, aspect);
  say(common, arguments.file, shot.notes);
  state.camera = shot.camera;
  std::optional<ExposureMeter> meter;
  state.exposure = exposure ? *exposure : automatic_exposure(scene, shot.sky, state, size, 160, 0);
  if (!exposure) {
    // While one flies, few pixels in one thread will do: the rest is the picture's.
    meter.emplace(
        state, [&](const ViewState& seen) { return automatic_exposure(scene, shot.sky, seen, size, 64, 1); });
  }

  const Window window(size);
  Gpu gpu(window.handle(), arguments.validation);
  ViewReport shown;
  {
    Viewer viewer(gpu, window.handle(), scene, shot.sky);
    show(viewer, window.handle(), state, meter ? &*meter : nullptr, arguments, scene);
    shown = viewer.report();
    if (!arguments.screenshot.empty()) {
      const Viewer::Screenshot taken = viewer.screenshot();
      write_file(arguments.screenshot, rgba_png(taken.width, taken.height, taken.rgba));
    }
  }
  report(shown, state, arguments, common, gpu, scene);
  if (shown.incomplete > 0)
    say(common, arguments.file,
        {std::to_string(shown.incomplete) + " rays were cut short by the device and are dark"});
  if (!gpu.messages.empty())
    throw Failure(Exit::kInternal, "", "the validation layer says: " + gpu.messages.front());
}

}  // namespace
}  // namespace lsp::sample

int main(int argc, char** argv) {
  using namespace lsp;
  using namespace lsp::sample;
  CLI::App app(
      std::string(
          "Shows a baked scene in a window to fly through. Indirect light comes from the tables; left of "
          "a line, which the Right key brings in from the left, it is exact.\n") +
          kControlsHelp,
      kProgram);
  CommonOptions common;
  Arguments a;
  add_common_options(app, kProgram, common);
  app.add_option(
         "FILE", a.file,
         "The baked scene: an .lsp file, or .json with instances of several; or a mesh, which is baked first")
      ->required();
  app.add_option("--effect", a.effect,
                 "What is shown: light (all of it, with one diffuse bounce; metals are matt, of their "
                 "colour), diffuse "
                 "(the bounce alone), ao, or heat "
                 "(steps of the bounce's rays: black, red, yellow, from 128 on white) (default light)")
      ->check(CLI::IsMember(kEffects));
  app.add_option(
         "--split", a.split,
         "Where the line is, a share of the width: 0 all approximate, 1 all exact (default 0; 1 where "
         "the file has no tables)")
      ->check(CLI::Range(0.0f, 1.0f));
  add_trace_arguments(app, a.trace);
  app.add_option("--camera", a.camera,
                 "X,Y,Z:X,Y,Z:FOV, the vertical angle in degrees (default: from the scene)");
  app.add_option(
         "--up", a.up,
         "Which axis is up: y or z (default y; without --camera as shape and source suggest, z with a note)")
      ->check(CLI::IsMember({"y", "z"}));
  app.add_option("--size", a.size, "Of the window, in pixels (default 960x540)");
  app.add_option("--radius", a.state.ao_distance,
                 "Reach of --effect ao in diagonals of the scene (default 0.1)")
      ->check(CLI::Range(1e-6f, 1e6f));
  app.add_option(
      "--exposure", a.exposure,
      "Stops to brighten light by, or auto: what is too dark or too bright is brought into range, as by "
      "lsp-render, and follows the camera (default auto, with --camera 0)");
  app.add_option("--frames", a.frames, "Show so many and end (default: until the window is closed)")
      ->check(CLI::Range(1u, 1u << 20));
  app.add_option("--screenshot", a.screenshot, "Write what the window shows after --frames, as .png");
  app.add_flag("--validation", a.validation,
               "Switch Vulkan's validation layer on; what it says is exit code 4");
  arrange_help(
      app, "lsp-view room.lsp --quality fast",
      {{"What most people need", {"FILE", "--effect", "--split SHARE", "--quality", "--max-loss PERCENT"}},
       {"The picture",
        {"--camera EYE:TARGET:ANGLE", "--size WxH", "--up", "--exposure STOPS|auto", "--radius"}},
       {"Line Spaces", {"--near", "--lod"}},
       {"Without hands", {"--frames", "--screenshot FILE.png", "--validation"}}});
  return run_program(kProgram, app, argc, argv, [&] { run(a, common); });
}
