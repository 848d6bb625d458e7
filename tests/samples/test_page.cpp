// The demo's page stands alone and holds the figures it is given.
#include "html_text.h"
#include "page.h"

#include <gtest/gtest.h>

namespace lsp::sample {
namespace {

Figures example() {
  const nlohmann::json bake = {{"triangles", {{"read", 12}, {"kept", 10}}},
                               {"notes", {"a <note>"}},
                               {"skipped", {"empty shafts: 5 of 9"}},
                               {"line_spaces", 3},
                               {"shafts", 9},
                               {"filled_shafts", 4},
                               {"seconds", {{"import", 0.5}, {"write", 0.25}}},
                               {"peak_memory_bytes", 2e6},
                               {"file_bytes", 4e6},
                               {"sections", {{{"name", "NODE"}, {"bytes", 1e6}, {"stored_bytes", 1e6}}}}};
  nlohmann::json render = {{"device", "a device"},
                           {"backend", "cpu"},
                           {"load_path", "mapped"},
                           {"width", 4},
                           {"height", 2},
                           {"samples", 8},
                           {"denoised", true},
                           {"seconds", 2.0},
                           {"primary_seconds", 0.5},
                           {"shadow_seconds", 0.5},
                           {"indirect_seconds", 1.0},
                           {"indirect_rays", 2000000},
                           {"indirect_mrays_per_second", 2.0},
                           {"mean_luminance", 0.25}};
  nlohmann::json approximate = render;
  approximate["indirect_mrays_per_second"] = 3.0;
  const nlohmann::json compare = {{"psnr_db", nullptr},
                                  {"factor", 4},
                                  {"rmse", 0.0},
                                  {"relative_mean", 0.0},
                                  {"pixels_over_5_percent", 0.0}};
  return {"a <scene>", 0.125, bake, render, approximate, compare, {}, {}};
}

TEST(Page, Base64) {
  EXPECT_EQ(base64(""), "");
  EXPECT_EQ(base64("f"), "Zg==");
  EXPECT_EQ(base64("fo"), "Zm8=");
  EXPECT_EQ(base64("foo"), "Zm9v");
  EXPECT_EQ(base64("foobar"), "Zm9vYmFy");
  EXPECT_EQ(base64(std::string("\xff\xfe\xfd", 3)), "//79");
  EXPECT_EQ(base64(std::string("\xff\xfe\xfd\x00", 4)), "//79AA==");
}

TEST(Page, StandsAlone) {
  const std::string page = make_page(example(), {"one", "two", "three"});
  for (const char* outside : {"http:", "https:", "src=\"/", "<link", "url("}) {
    EXPECT_EQ(page.find(outside), std::string::npos) << outside;
  }
  EXPECT_NE(page.find("data:image/png;base64," + base64("three")), std::string::npos);
}

TEST(Page, EscapesWhatComesFromFiles) {
  const std::string page = make_page(example(), {});
  EXPECT_EQ(page.find("<scene>"), std::string::npos);
  EXPECT_NE(page.find("a &lt;scene&gt;"), std::string::npos);
  EXPECT_NE(page.find("a &lt;note&gt;"), std::string::npos);
}

TEST(Page, SaysNothingOfATimeThatNobodyMeasured) {
  Figures figures = example();
  EXPECT_NE(make_page(figures, {}).find("time to validate"), std::string::npos);
  EXPECT_NE(make_summary(figures).find("validate:    0.12 s"), std::string::npos);
  figures.validate_seconds.reset();
  EXPECT_EQ(make_page(figures, {}).find("time to validate"), std::string::npos);
  EXPECT_EQ(make_summary(figures).find("validate:"), std::string::npos);
}

TEST(Page, SaysTheFigures) {
  const std::string page = make_page(example(), {});
  EXPECT_NE(page.find("1.50 times"), std::string::npos);
  EXPECT_NE(page.find("empty shafts: 5 of 9"), std::string::npos);
  EXPECT_NE(page.find("equal pictures"), std::string::npos);
  const std::string summary = make_summary(example());
  EXPECT_NE(summary.find("1.50 times"), std::string::npos);
  EXPECT_NE(summary.find("skipped:     empty shafts"), std::string::npos);
  EXPECT_NE(summary.find("note:        a <note>"), std::string::npos);
  EXPECT_NE(summary.find("a second; equal pictures, mean"), std::string::npos) << summary;
}

TEST(Page, TellsOfCellsAndTheirDial) {
  Figures figures = example();
  EXPECT_EQ(make_page(figures, {}).find("The dial"), std::string::npos);
  figures.bake["cells"] = {{"grid", {24, 10, 15}}, {"filled", 2130}, {"planes", 1}, {"splits", 1}};
  nlohmann::json fast = figures.approximate, compare = figures.compare;
  fast["indirect_mrays_per_second"] = 9.0;
  compare["relative_mean"] = 0.0625;
  figures.curve.push_back({"fast", fast, compare});
  figures.curve.push_back({"10", fast, compare});
  figures.curve_exact = figures.exact;
  const std::string page = make_page(figures, {});
  for (const char* part : {"24 x 10 x 15", "2130", "The dial", "4.50", "6.25 %"})
    EXPECT_NE(page.find(part), std::string::npos) << part;
  EXPECT_EQ(page.find("Line Spaces"), std::string::npos);
  EXPECT_NE(make_summary(figures).find("not denoised: fast 4.50 times, 6.25 %\n"), std::string::npos);
}

TEST(Page, DrawsTheDialsCurve) {
  Figures figures = example();
  figures.bake["cells"] = {{"grid", {24, 10, 15}}, {"filled", 2130}, {"planes", 1}, {"splits", 1}};
  EXPECT_EQ(make_page(figures, {}).find("<svg"), std::string::npos);
  figures.curve_exact = figures.exact;
  const auto add = [&](const char* name, double speed, double error) {
    nlohmann::json approximate = figures.approximate, compare = figures.compare;
    approximate["indirect_mrays_per_second"] = 2.0 * speed;
    compare["relative_mean"] = error;
    figures.curve.push_back({name, approximate, compare});
  };
  add("fast", 3.25, 0.0575);
  add("balanced", 1.75, 0.0225);
  add("3", 1.25, 0.0125);
  const auto drawing = [&] {
    const std::string page = make_page(figures, {});
    const size_t begin = page.find("<svg");
    return begin == page.npos ? "" : page.substr(begin, page.find("</svg>") - begin);
  };
  const std::string page = make_page(figures, {});
  const std::string svg = drawing();
  size_t circles = 0;
  for (size_t at = svg.find("<circle"); at != svg.npos; at = svg.find("<circle", at + 1)) ++circles;
  EXPECT_EQ(circles, 3u);
  EXPECT_LT(svg.find(">3</text>"), svg.find(">balanced</text>")) << "in the order of their errors";
  EXPECT_LT(svg.find(">balanced</text>"), svg.find(">fast</text>"));
  for (const char* part : {"nan", "inf"}) EXPECT_EQ(svg.find(part), std::string::npos) << part;
  for (const char* part : {"--max-loss 3", "3.25</td><td>5.75 %", "1.25</td><td>1.25 %"})
    EXPECT_NE(page.find(part), std::string::npos) << part;
  // Equal pictures, as of a scene that tables answer without error, are drawn, too.
  for (Figures::Setting& point : figures.curve) point.compare["relative_mean"] = 0.0;
  EXPECT_NE(drawing().find("<circle"), std::string::npos);
  EXPECT_EQ(drawing().find("nan"), std::string::npos);
  // And where the exact picture is black a share of it says nothing: no point is drawn.
  for (Figures::Setting& point : figures.curve) point.compare["relative_mean"] = nullptr;
  for (const char* part : {"nan", "inf", "<circle"})
    EXPECT_EQ(drawing().find(part), std::string::npos) << part;
}

TEST(Page, ComparesInPlaceByKeyboardToo) {
  const std::string page = make_page(example(), {"one", "two", "three"});
  for (const char* part :
       {"type=\"range\"", "<button id=\"blink\"", "<button id=\"map\"", "aria-pressed", "'keydown'",
        "class=\"error\" alt=\"error map\" src=\"data:image/png;base64,dGhyZWU=\""})
    EXPECT_NE(page.find(part), std::string::npos) << part;
}

TEST(Page, SaysWhereThereAreNoTables) {
  Figures figures = example();
  figures.bake["line_spaces"] = 0;
  figures.bake["shafts"] = figures.bake["filled_shafts"] = 0;
  const std::string page = make_page(figures, {});
  EXPECT_NE(page.find("both pictures are exact"), std::string::npos);
  EXPECT_EQ(page.find("Line Spaces"), std::string::npos);
  EXPECT_NE(make_summary(figures).find("no tables"), std::string::npos);
}

TEST(Page, MissingFigureIsReported) {
  Figures figures = example();
  figures.bake.erase("shafts");
  EXPECT_THROW(make_page(figures, {}), nlohmann::json::exception);
}

}  // namespace
}  // namespace lsp::sample
