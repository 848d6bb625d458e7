// The report's building blocks: numbers survive, pages stand alone, timing says what it knows.
#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <fstream>
#include <stdexcept>

#include "answers.h"
#include "lsp/in_chunks.hpp"
#include "picture_page.h"
#include "report.h"
#include "temporary_folder.h"
#include "timing.h"

namespace lsp::bench {
namespace {

Report sample() {
  Report report;
  report.title = "A <b>test</b> & more";
  report.facts["processor"] = "abacus";
  report.answers = {"It is 2 < 3."};
  report.warnings = {"Two were measured together."};
  Section section{"one", "Section one", {"Words."}, {}, {}, {}};
  section.tables.push_back({"numbers", "Numbers", "", {{"name", "name"}, {"value", "value", 3}}, {}});
  section.tables[0].rows.push_back({{"name", "a, \"b\""}, {"value", 1234567}});
  section.tables[0].rows.push_back({{"name", "tiny"}, {"value", 1.25e-7}});
  section.tables[0].rows.push_back({{"name", "none"}});
  section.plots.push_back(
      {"plot",
       "Plot",
       "",
       {"x", true},
       {"y", false},
       {{"first", {{0.1, 1, "p"}, {10, 2, ""}}, true}, {"second", {{0, NAN, ""}}, false}}});
  section.pictures.push_back(
      {"Dots",
       "Two of them",
       2,
       {{"dot", "A dot", std::string("\x89PNG\r\n", 6)}, {"spot", "Another", "\xff\xd8", true}}});
  report.sections.push_back(section);
  return report;
}

TEST(Report, CsvQuotesAndKeepsPrecision) {
  EXPECT_EQ(to_csv(sample().sections[0].tables[0]),
            "name,value\n\"a, \"\"b\"\"\",1234567\ntiny,1.25e-07\nnone,\n");
}

TEST(Report, JsonHoldsTheRows) {
  const Json json = to_json(sample());
  EXPECT_EQ(json["sections"]["one"]["tables"]["numbers"][1]["value"].get<double>(), 1.25e-7);
  EXPECT_EQ(json["facts"]["processor"], "abacus");
}

TEST(Report, PageStandsAlone) {
  const std::string html = to_html(sample());
  EXPECT_NE(html.find("A &lt;b&gt;test&lt;/b&gt; &amp; more"), std::string::npos);
  EXPECT_NE(html.find("1,234,567"), std::string::npos);
  EXPECT_NE(html.find("1.2e-07"), std::string::npos);
  EXPECT_NE(html.find("data:image/png;base64,iVBORw0K"), std::string::npos);
  EXPECT_NE(html.find("data:image/jpeg;base64,/9g="), std::string::npos);
  EXPECT_NE(html.find("width=device-width"), std::string::npos);
  EXPECT_EQ(html.find("nan"), std::string::npos);
  // Nothing is fetched: the only addresses are namespaces.
  for (const char* word : {"src='http", "href='http", "<script", "<link", "@import", "url("}) {
    EXPECT_EQ(html.find(word), std::string::npos) << word;
  }
}

TEST(Report, IsWrittenWhole) {
  const auto directory = std::filesystem::temp_directory_path() / "lsp_test_report";
  std::filesystem::remove_all(directory);
  write_report(sample(), directory);
  for (const char* name : {"report.html", "report.json", "numbers.csv", "plot.svg", "dot.png", "spot.jpg"}) {
    EXPECT_TRUE(std::filesystem::exists(directory / name)) << name;
  }
  std::filesystem::remove_all(directory);
}

// Names of scenes need not be UTF-8, and JSON is.
TEST(Report, IsJsonWhateverAFileIsCalled) {
  const test::TemporaryFolder folder;
  Report report = sample();
  report.warnings = {"l\xE4n.ply: left out"};
  write_report(report, folder.path());
  EXPECT_EQ(Json::parse(std::ifstream(folder.path() / "report.json"))["warnings"][0],
            "l\xEF\xBF\xBDn.ply: left out");
}

// A table of a suite that the later run did not ask for would look like its own.
TEST(Report, TakesThePlaceOfAnEarlierOne) {
  const test::TemporaryFolder folder;
  const std::filesystem::path directory = folder.path() / "report";
  write_report(sample(), directory);
  std::ofstream(directory / "mine.csv") << "not of a report\n";
  std::ofstream(folder.path() / "outside.csv") << "not in the folder\n";
  Json json = Json::parse(std::ifstream(directory / "report.json"));
  json["files"].push_back("../outside.csv");
  std::ofstream(directory / "report.json") << json;

  Report later = sample();
  later.sections[0].tables[0].id = "others";
  later.sections[0].plots.clear();
  write_report(later, directory);
  for (const char* gone : {"numbers.csv", "plot.svg"})
    EXPECT_FALSE(std::filesystem::exists(directory / gone)) << gone;
  for (const char* there : {"others.csv", "dot.png", "mine.csv", "../outside.csv", "report.html"})
    EXPECT_TRUE(std::filesystem::exists(directory / there)) << there;
}

TEST(PicturePage, ShowsWhereSomethingIsThatANoiseFilterWouldLeave) {
  Image exact(64, 48, glm::vec3(0.5f)), wrong = exact;
  for (uint32_t y = 0; y < wrong.height; ++y) {
    for (uint32_t x = 0; x < 20; ++x)  // noise on the left
      wrong.at(x, y) += glm::vec3((x + y) % 2 ? 0.3f : -0.3f);
  }
  for (uint32_t y = 30; y < 36; ++y) wrong.at(50, y) += glm::vec3(0.2f);  // a seam on the right
  const Spot spot = worst_spot(exact, wrong);
  EXPECT_EQ(spot.width, 8u);
  EXPECT_EQ(spot.height, 6u);
  EXPECT_LE(spot.x, 50u);
  EXPECT_GT(spot.x + spot.width, 50u);
  EXPECT_NEAR(spot.y, 30, 1);

  const Image shown = amplified_difference(exact, wrong);
  EXPECT_EQ(shown.at(40, 40), glm::vec3(0));
  const float off = to_display(wrong).at(50, 33).g - to_display(exact).at(50, 33).g;
  EXPECT_FLOAT_EQ(shown.at(50, 33).g, kAmplified * off);
  EXPECT_EQ(shown.at(0, 0), glm::vec3(1));  // no more than white

  const PictureGrid grid =
      exhibition("A wall", {{"a", "exact", "", exact}, {"b", "fast", ": 3 %", wrong}}, 1);
  EXPECT_EQ(grid.columns, 2u);
  ASSERT_EQ(grid.pictures.size(), 6u);  // the pictures, their differences, the enlarged part
  EXPECT_EQ(grid.pictures[1].caption, "fast: 3 %");
  EXPECT_EQ(grid.pictures[3].id, "b-difference");
  EXPECT_FALSE(grid.pictures[5].jpeg);
}

TEST(Answers, TakeTheFastestWithinALimit) {
  Answers answers;
  answers.threads = 2;
  answers.device = "a device";
  answers.samples = {{"hall", "A", "approximate", 1.2, 1.5, 0.3, 0.1, 20},
                     {"hall", "B", "approximate, near skipped", 2.0, 0.8, 0.9, 0.5, 30},
                     {"cup", "A", "approximate", 0.9, 1.25, 0.05, 0.2, 10},
                     {"cup", "B", "approximate", 3.0, 3.0, 5.0, 0.2, 15}};
  answers.peers["hall"] = {1.6, 1.25, 12};
  answers.peers["cup"] = {2.0, 0, 8};
  const auto within = best_within(answers.samples, 1, &Sample::times);
  EXPECT_EQ(within.at("hall").bake, "B");
  EXPECT_EQ(within.at("cup").mode, "exact");
  EXPECT_EQ(best_within(answers.samples, 1, &Sample::times_vulkan).at("cup").times_vulkan, 1.25);
  std::string text;
  for (const std::string& sentence : sentences(answers)) text += sentence + "\n";
  // sqrt(2.0 * 1.0), sqrt(1.5 * 1.25)
  EXPECT_NE(
      text.find(
          "At 1 % wrong answers, shuffled diffuse rays, the fastest approximate trace is 1.41x (1.00x cup "
          "to 2.00x hall) the exact one on the CPU and 1.37x (1.25x cup to 1.50x hall) on Vulkan."),
      std::string::npos)
      << text;
  EXPECT_NE(
      text.find(
          "At 0.1 % wrong answers, shuffled diffuse rays, the fastest approximate trace is 1.00x the exact "
          "one on the CPU"),
      std::string::npos)
      << text;
  EXPECT_NE(text.find("we are faster on hall at 1 % wrong answers"), std::string::npos) << text;
  EXPECT_NE(text.find("hall 30.0 MB for 12.0"), std::string::npos) << text;
  EXPECT_NE(
      text.find("On the CPU (2 threads), it is not worth using (under 1.1x at 1 % wrong answers) on cup."),
      std::string::npos)
      << text;
  EXPECT_NE(
      text.find("On Vulkan (a device), it is not worth using (under 1.1x at 1 % wrong answers) on none"),
      std::string::npos)
      << text;
  EXPECT_EQ(answers_section(answers).tables.at(0).rows.size(), 16u);  // limits, backends, scenes
  EXPECT_TRUE(sentences({}).empty());
}

TEST(Answers, SayWhatTheDialOfCellsDoes) {
  Answers answers;
  answers.cells = {{"hall", "cells", "max-loss 100", 4.0, 3.0, 0.8, 0.9, 20},
                   {"hall", "cells", "max-loss 1", 1.5, 0.9, 0.05, 0.1, 20}};
  std::string text;
  for (const std::string& sentence : sentences(answers)) text += sentence + "\n";
  EXPECT_NE(
      text.find("At 1 % wrong answers, shuffled diffuse rays, the fastest point of the dial of cells is "
                "4.00x the exact trace of the same file (wide nodes) on the CPU and 3.00x on Vulkan."),
      std::string::npos)
      << text;
  EXPECT_NE(
      text.find("At 0.1 % wrong answers, shuffled diffuse rays, the fastest point of the dial of cells is "
                "1.50x the exact trace of the same file (wide nodes) on the CPU and 1.00x on Vulkan."),
      std::string::npos)
      << text;
}

TEST(Plot, KinHaveOneColourAndTheYoungerIsDashed) {
  Plot plot = sample().sections[0].plots[0];
  plot.series = {{"one", {{1, 1, ""}, {2, 2, ""}}, true},
                 {"two", {{1, 2, ""}, {2, 3, ""}}, true},
                 {"one's kin", {{1, 3, ""}, {2, 4, ""}}, true, 0}};
  const std::string svg = to_svg(plot);
  const auto strokes = [&](const std::string& text) {
    size_t count = 0;
    for (size_t at = svg.find(text); at != std::string::npos; at = svg.find(text, at + 1)) ++count;
    return count;
  };
  EXPECT_EQ(strokes("stroke='#0072B2'"), 2u);
  EXPECT_EQ(strokes("stroke='#D55E00'"), 1u);
  EXPECT_EQ(strokes("stroke-dasharray"), 1u);
}

TEST(Timing, MedianAndSpread) {
  const Timing timing = timing_of({5, 1, 2, 3, 4});
  EXPECT_DOUBLE_EQ(timing.median, 3);
  EXPECT_DOUBLE_EQ(timing.least, 1);
  EXPECT_DOUBLE_EQ(timing.spread, 2.0 / 3);
  EXPECT_TRUE(ratio_is_meaningless(timing_of({1, 2, 3}), timing_of({2, 2.5, 3})));
  EXPECT_FALSE(ratio_is_meaningless(timing_of({1, 1.01, 1.02}), timing_of({2, 2.01, 2.02})));
}

TEST(Timing, RaceInterleavesAndDropsTheWarmUp) {
  std::string order;
  int calls = 0;
  const auto contender = [&](char name) {
    return Contender{std::string(1, name), [&, name] {
                       order += name;
                       return static_cast<double>(++calls);
                     }};
  };
  const auto timings = race({contender('a'), contender('b')}, 1, 2);
  EXPECT_EQ(order, "baabba");
  EXPECT_EQ(timings[0].repeats, 2u);
  EXPECT_DOUBLE_EQ(timings[0].median, (3 + 6) / 2.0);
}

TEST(Timing, ChunksCoverEverythingOnce) {
  for (unsigned threads : {1u, 3u}) {
    std::vector<std::atomic<int>> touched(10001);
    const double seconds = run_in_chunks(touched.size(), threads, [&](size_t first, size_t count) {
      for (size_t i = first; i < first + count; ++i) ++touched[i];
    });
    EXPECT_GT(seconds, 0);
    for (const auto& count : touched) ASSERT_EQ(count, 1);
    EXPECT_THROW(
        run_in_chunks(touched.size(), threads, [](size_t, size_t) { throw std::runtime_error("no"); }),
        std::runtime_error);
  }
}

}  // namespace
}  // namespace lsp::bench
