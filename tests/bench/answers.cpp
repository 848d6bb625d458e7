#include "answers.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>

namespace lsp::bench {
namespace {

using Best = std::map<std::string, Sample>;

std::string number(const char* format, double value) {
  char text[64];
  std::snprintf(text, sizeof text, format, value);
  return text;
}

// "1.23x (1.00x dragon to 1.50x sponza)": geometric mean, least and greatest of `value` over the scenes; the
// mean alone where they do not differ.
std::string range_of(const Best& best, const std::function<double(const Sample&)>& value) {
  double log_sum = 0;
  std::pair<double, std::string> least{INFINITY, ""}, greatest{0, ""};
  for (const auto& [scene, sample] : best) {
    const double x = value(sample);
    log_sum += std::log(x);
    if (x < least.first) least = {x, scene};
    if (x > greatest.first) greatest = {x, scene};
  }
  const std::string mean = number("%.2fx", std::exp(log_sum / static_cast<double>(best.size())));
  if (best.size() < 2 || greatest.first - least.first < 0.005) return mean;
  return mean + number(" (%.2fx ", least.first) + least.second + number(" to %.2fx ", greatest.first) +
         greatest.second + ")";
}

std::string joined(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : ", ") + word;
  return text;
}

bool measured_on_vulkan(const std::vector<Sample>& samples) {
  return !samples.empty() &&
         std::all_of(samples.begin(), samples.end(), [](const Sample& s) { return s.times_vulkan > 0; });
}

// One sentence a limit: the fastest of `samples`, which is called `what`, against `yardstick`.
void add_limits(std::vector<std::string>& out, const std::vector<Sample>& samples, const std::string& what,
                const std::string& yardstick) {
  for (const double limit : kLimits) {
    std::string text =
        number("At %g %% wrong answers", limit) + ", shuffled diffuse rays, the fastest " + what + " " +
        range_of(best_within(samples, limit, &Sample::times), [](const Sample& s) { return s.times; }) + " " +
        yardstick + " on the CPU";
    if (measured_on_vulkan(samples)) {
      text += " and " +
              range_of(best_within(samples, limit, &Sample::times_vulkan),
                       [](const Sample& s) { return s.times_vulkan; }) +
              " on Vulkan";
    }
    out.push_back(text + ".");
  }
}

// The fastest approximate trace against another exact tracer on the CPU.
void add_peer(std::vector<std::string>& out, const Answers& answers, const std::string& name,
              double ScenePeers::*times) {
  const auto of = [&](const std::string& scene) {
    const auto peer = answers.peers.find(scene);
    return peer == answers.peers.end() ? 0.0 : peer->second.*times;
  };
  Best all = best_within(answers.samples, 1, &Sample::times);
  std::erase_if(all, [&](const auto& entry) { return !(of(entry.first) > 0); });
  if (all.empty()) return;
  std::vector<std::string> faster[2];
  for (size_t k = 0; k < 2; ++k) {
    for (const auto& [scene, sample] : best_within(answers.samples, k == 0 ? 1 : 2, &Sample::times)) {
      if (of(scene) > 0 && sample.mode != "exact" && sample.times > of(scene)) faster[k].push_back(scene);
    }
  }
  const auto names = [](const std::vector<std::string>& list) {
    return list.empty() ? std::string("on no scene") : "on " + joined(list);
  };
  out.push_back(
      "Against " + name + " traces at " + range_of(all, [&](const Sample& s) { return of(s.scene); }) +
      " our exact trace, so our fastest at 1 % wrong answers at " +
      range_of(all, [&](const Sample& s) { return s.times / of(s.scene); }) + " its speed; we are faster " +
      names(faster[0]) + " at 1 % wrong answers, " + names(faster[1]) + " at 2 %.");
}

void add_bytes(std::vector<std::string>& out, const Answers& answers) {
  std::vector<std::string> costs;
  for (const auto& [scene, sample] : best_within(answers.samples, 1, &Sample::times)) {
    const auto peer = answers.peers.find(scene);
    if (sample.mode == "exact" || peer == answers.peers.end() || !(peer->second.exact_megabytes > 0))
      continue;
    costs.push_back(scene + number(" %.1f MB", sample.megabytes) +
                    number(" for %.1f", peer->second.exact_megabytes));
  }
  if (!costs.empty()) {
    out.push_back("In bytes, the file that is fastest at 1 % wrong answers, for one without Line Spaces: " +
                  joined(costs) + ".");
  }
}

void add_useless(std::vector<std::string>& out, const Answers& answers, double Sample::*times,
                 const std::string& where) {
  std::vector<std::string> useless;
  for (const auto& [scene, sample] : best_within(answers.samples, 1, times)) {
    if (sample.*times < 1.1) useless.push_back(scene);
  }
  out.push_back(where + ", it is not worth using (under 1.1x at 1 % wrong answers) on " +
                (useless.empty() ? "none of these scenes" : joined(useless)) + ".");
}

}  // namespace

Best best_within(const std::vector<Sample>& samples, double limit, double Sample::*times) {
  Best best;
  for (const Sample& sample : samples) {
    const auto [it, fresh] =
        best.try_emplace(sample.scene, Sample{sample.scene, "-", "exact", 1, 1, 0, 0, 0});
    if (sample.wrong_percent <= limit && sample.*times > it->second.*times) it->second = sample;
  }
  return best;
}

std::vector<std::string> sentences(const Answers& answers) {
  std::vector<std::string> out;
  if (!answers.cells.empty())
    add_limits(out, answers.cells, "point of the dial of cells is",
               "the exact trace of the same file (wide nodes)");
  if (!answers.samples.empty()) {
    const bool vulkan = measured_on_vulkan(answers.samples);
    add_limits(out, answers.samples, "approximate trace is", "the exact one");
    add_peer(out, answers, "Embree (rtcIntersect1, robust, the same rays and threads), which",
             &ScenePeers::embree);
    add_peer(out, answers, "an exact tree of our own with eight children a node and SIMD, which",
             &ScenePeers::wide);
    add_bytes(out, answers);
    add_useless(out, answers, &Sample::times, "On the CPU (" + std::to_string(answers.threads) + " threads)");
    if (vulkan) add_useless(out, answers, &Sample::times_vulkan, "On Vulkan (" + answers.device + ")");
  }
  out.insert(out.end(), answers.others.begin(), answers.others.end());
  return out;
}

Section answers_section(const Answers& answers) {
  Section section{"answers", "In one sentence each", sentences(answers), {}, {}, {}};
  Table table{
      "answers",
      "The fastest within a limit of wrong answers",
      "On shuffled diffuse rays, times the BVH's exact trace. \"exact\" where nothing approximate is faster "
      "within the limit. Factors of Embree and of the wide tree are those of this row against theirs, on "
      "the CPU.",
      {{"limit", "wrong answers at most, %", 1},
       {"where", "on"},
       {"scene", "scene"},
       {"times", "x exact"},
       {"times_embree", "x Embree"},
       {"times_wide", "x wide tree"},
       {"bake", "bake"},
       {"mode", "mode"},
       {"wrong_percent", "wrong %", 3},
       {"depth_percent", "depth error, % of diagonal", 3},
       {"file_mb", "file, MB", 1},
       {"exact_mb", "without Line Spaces, MB", 1}},
      {}};
  for (const double limit : kLimits) {
    for (double Sample::*times : {&Sample::times, &Sample::times_vulkan}) {
      const bool cpu = times == &Sample::times;
      if (!cpu && !measured_on_vulkan(answers.samples)) continue;
      for (const auto& [scene, sample] : best_within(answers.samples, limit, times)) {
        Json row;
        row["limit"] = limit;
        row["where"] = cpu ? "CPU" : "Vulkan";
        row["scene"] = scene;
        row["times"] = sample.*times;
        row["bake"] = sample.bake;
        row["mode"] = sample.mode;
        row["wrong_percent"] = sample.wrong_percent;
        row["depth_percent"] = sample.depth_percent;
        if (sample.megabytes > 0) row["file_mb"] = sample.megabytes;
        const auto peer = answers.peers.find(scene);
        if (peer != answers.peers.end()) {
          if (cpu && peer->second.embree > 0) row["times_embree"] = sample.times / peer->second.embree;
          if (cpu && peer->second.wide > 0) row["times_wide"] = sample.times / peer->second.wide;
          if (peer->second.exact_megabytes > 0) row["exact_mb"] = peer->second.exact_megabytes;
        }
        table.rows.push_back(row);
      }
    }
  }
  if (!table.rows.empty()) section.tables.push_back(std::move(table));
  return section;
}

}  // namespace lsp::bench
