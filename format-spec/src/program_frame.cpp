#include "program_frame.h"

#include <lsp/layout.h>
#include <lsp/program.h>

#include <cstdio>
#include <exception>
#include <new>

namespace lsp::format {

void add_common_options(CLI::App& app, CommonOptions& options) {
  app.set_version_flag("--version", app.get_name() + " " + kProgramVersion + ", format " +
                                        std::to_string(LSP_VERSION_MAJOR) + "." +
                                        std::to_string(LSP_VERSION_MINOR));
  app.add_flag("--quiet", options.quiet, "Print nothing but errors");
  app.add_flag("--json", options.json, "Print one JSON object on standard output, and nothing else there");
}

int run_program(CLI::App& app, int argc, char** argv, const std::function<int()>& body) {
  const std::string name = app.get_name();
  try {
    app.parse(argc, argv);
    const int code = body();
    if (std::fflush(stdout) != 0) throw Failure(Exit::kFile, "standard output", "cannot be written");
    return code;
  } catch (const CLI::ParseError& error) {
    const int code = app.exit(error);
    return code == 0 ? 0 : static_cast<int>(Exit::kUsage);
  } catch (const Failure& failure) {
    std::fprintf(stderr, "%s: %s%s%s\n", name.c_str(), failure.file().c_str(),
                 failure.file().empty() ? "" : ": ", failure.what());
    return static_cast<int>(failure.exit());
  } catch (const std::bad_alloc&) {
    std::fprintf(stderr, "%s: there is not enough memory\n", name.c_str());
    return static_cast<int>(Exit::kLimit);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s: internal error: %s, please report this\n", name.c_str(), error.what());
    return static_cast<int>(Exit::kInternal);
  }
}

}  // namespace lsp::format
