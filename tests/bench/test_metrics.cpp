// The error measures against values known from elsewhere.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>

#include "image.h"
#include "lsp/program.h"
#include "pcg32.h"
#include "picture_errors.h"
#include "ray_errors.h"

namespace lsp::bench {
namespace {

// A pair of test pictures by formula. The expected figures below were computed from the definitions with
// plain two-dimensional kernels in another language.
Image pattern(bool changed) {
  Image image(48, 40);
  for (uint32_t y = 0; y < image.height; ++y) {
    for (uint32_t x = 0; x < image.width; ++x) {
      const float r = static_cast<float>((x * 7 + y * 3 + (changed ? 2 : 0)) % 32) / 31.0f;
      const float g = static_cast<float>((x * y) % 29) / 28.0f * (changed ? 0.9f : 1.0f);
      const float b = static_cast<float>((x / 8 + (y + (changed ? 1 : 0)) / 8) % 2) * 0.8f + 0.1f;
      image.at(x, y) = {r, g, b};
    }
  }
  return image;
}

TEST(Image, StructuralSimilarity) {
  EXPECT_DOUBLE_EQ(ssim(pattern(false), pattern(false)), 1);
  EXPECT_NEAR(ssim(pattern(false), pattern(true)), 0.9567452409838539, 1e-6);
  // Constant pictures: only the luminance term (2ab + C1) / (a^2 + b^2 + C1) is left.
  EXPECT_NEAR(ssim(Image(16, 16, glm::vec3(1)), Image(16, 16, glm::vec3(0.5f))), 1.0001 / 1.2501, 1e-6);
}

TEST(Image, Flip) {
  EXPECT_EQ(flip(pattern(false), pattern(false)), 0);
  EXPECT_NEAR(flip(pattern(false), pattern(true)), 0.3489254555475028, 1e-6);
  EXPECT_NEAR(flip(pattern(false), pattern(true), 30), 0.4364332891044336, 1e-6);
  const std::vector<float> map = flip_map(pattern(false), pattern(true));
  EXPECT_NEAR(map[5 * 48 + 7], 0.37909073046352565, 1e-6);
  EXPECT_NEAR(map[39 * 48 + 47], 0.8491127855338712, 1e-6);
  // The measure is scaled so that green against blue is the greatest difference; black against white is less.
  EXPECT_NEAR(flip(Image(8, 8, glm::vec3(0, 1, 0)), Image(8, 8, glm::vec3(0, 0, 1))), 1, 1e-6);
  EXPECT_NEAR(flip(Image(8, 8, glm::vec3(0)), Image(8, 8, glm::vec3(1))), 0.9673797622066277, 1e-6);
}

TEST(Image, PfmAndPng) {
  const auto path = (std::filesystem::temp_directory_path() / "lsp_test_metrics.pfm").string();
  const float values[12] = {1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12};  // bottom row first
  std::ofstream file(path, std::ios::binary);
  file << "PF\n2 2\n-1.0\n";
  file.write(reinterpret_cast<const char*>(values), sizeof values);
  file.close();
  const Image image = read_pfm(path);
  EXPECT_EQ(image.at(0, 1), glm::vec3(1, 2, 3));
  EXPECT_EQ(image.at(1, 0), glm::vec3(10, 11, 12));
  std::filesystem::resize_file(path, 40);
  EXPECT_THROW(read_pfm(path), Failure);
  std::filesystem::remove(path);
  EXPECT_EQ(encode_png(pattern(false)).substr(1, 3), "PNG");
  EXPECT_EQ(encode_jpeg(pattern(false)).substr(0, 2), "\xff\xd8");
}

TEST(Image, Details) {
  Image image = pattern(false);
  const Image part = crop(image, 10, 20, 8, 6);
  EXPECT_EQ(part.at(0, 0), image.at(10, 20));
  EXPECT_EQ(part.at(7, 5), image.at(17, 25));
  const glm::vec3 red(1, 0, 0);
  draw_frame(image, 10, 20, 8, 6, red);
  EXPECT_EQ(image.at(9, 19), red);
  EXPECT_EQ(image.at(19, 27), red);
  EXPECT_EQ(image.at(10, 20), part.at(0, 0));
  EXPECT_EQ(image.at(7, 20), pattern(false).at(7, 20));
  draw_frame(image, 0, 0, 48, 40, red);  // has no room, draws nothing
  EXPECT_EQ(image.at(0, 0), pattern(false).at(0, 0));
}

// Grey, and one that differs by noise of mean magnitude `off`, or by a line one pixel wide.
Image grey() { return Image(80, 60, glm::vec3(0.5f)); }
Image noisy(float off) {
  Image image = grey();
  Random random(5);
  for (glm::vec3& pixel : image.pixels)
    pixel += glm::vec3(off * static_cast<float>(4 * random.uniform() - 2));
  return image;
}
Image seamed(float off) {
  Image image = grey();
  for (uint32_t y = 0; y < image.height; ++y) image.at(37, y) += glm::vec3(off);
  return image;
}

TEST(PictureErrors, ABlurTakesNoiseAndLeavesSeams) {
  const PictureErrors noise = picture_errors(grey(), noisy(0.05f));
  EXPECT_NEAR(noise.mean, 0.05 / 0.5, 0.003);
  EXPECT_NEAR(noise.p99, 0.1 / 0.5, 0.005);
  // A mean of 25 has a fifth of the deviation; the mean magnitude of a uniform value is 0.866 of its
  // deviation, of the nearly normal sum 0.798.
  EXPECT_NEAR(noise.structure(), 0.2 * 0.798 / 0.866, 0.02);
  EXPECT_NEAR(noise.bias, 0, 0.004);

  const PictureErrors seam = picture_errors(grey(), seamed(0.2f));
  EXPECT_NEAR(seam.mean, 0.2 / 0.5 / 80, 1e-6);
  EXPECT_NEAR(seam.p99, 0.2 / 0.5, 1e-6);  // one pixel in 80
  EXPECT_NEAR(seam.blurred_mean, seam.mean, 1e-6);
  EXPECT_NEAR(seam.blurred_p99, 0.2 / 0.5 / 5, 1e-6);
  EXPECT_NEAR(seam.structure(), 1, 1e-5);
  EXPECT_NEAR(seam.bias, seam.mean, 1e-6);
}

TEST(PictureErrors, AreRelativeToTheMeanButNotOfADarkPicture) {
  const Image bright(9, 9, glm::vec3(0.8f)), dark(9, 9, glm::vec3(0.01f));
  EXPECT_NEAR(picture_errors(bright, Image(9, 9, glm::vec3(0.6f))).mean, 0.25, 1e-6);
  EXPECT_NEAR(picture_errors(bright, Image(9, 9, glm::vec3(0.6f))).bias, -0.25, 1e-6);
  EXPECT_NEAR(picture_errors(dark, Image(9, 9, glm::vec3(0.06f))).mean, 0.05 / kLeastMean, 1e-6);
  const PictureErrors none = picture_errors(dark, dark);
  EXPECT_EQ(none.mean, 0);
  EXPECT_EQ(none.structure(), 0);
  EXPECT_THROW(picture_errors(bright, Image(9, 8)), Failure);
}

TEST(PictureErrors, ABlurKeepsWhatIsEvenUpToTheBorder) {
  const Image even(7, 3, glm::vec3(0.3f, 0.5f, 0.7f));
  for (const glm::vec3& pixel : blurred(even).pixels) {
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(pixel[c], even.pixels[0][c], 1e-6);
  }
  Image dot(11, 11);
  dot.at(5, 5) = glm::vec3(1);
  EXPECT_NEAR(blurred(dot).at(3, 7).g, 1.0 / 25, 1e-7);
  EXPECT_EQ(blurred(dot).at(2, 5).g, 0);
}

Soup quad() {
  Soup soup;
  soup.corners = {{glm::vec3(0), glm::vec3(3, 0, 0), glm::vec3(0, 4, 0)},
                  {glm::vec3(3, 0, 0), glm::vec3(3, 4, 0), glm::vec3(0, 4, 0)}};
  soup.primitives = {0, 1};
  soup.triangle_of = {0, 1};
  soup.hi = glm::dvec3(3, 4, 0);
  soup.diagonal = 5;
  return soup;
}

LspHit hit_of(float t, uint32_t primitive, lsp_float3 normal = {0, 0, 1}) {
  return {t, primitive, 0.25f, 0.25f, normal, 0};
}

TEST(RayErrors, CountsAndMeasures) {
  const Soup soup = quad();
  const LspHit miss = hit_of(INFINITY, LSP_NONE);
  const std::vector<LspRay> rays(5, LspRay{{1, 1, 2}, 0, {0, 0, -2}, 10});
  const std::vector<LspHit> truth = {hit_of(1, 0), hit_of(1, 0), miss, miss, hit_of(1, 1)};
  const std::vector<LspHit> answers = {hit_of(1.5f, 0), miss, hit_of(1, 0), miss, hit_of(1, 0, {0, 1, 0})};
  const RayErrors errors = ray_errors(soup, rays, truth, answers);
  EXPECT_EQ(errors.rays, 5u);
  EXPECT_EQ(errors.true_hits, 3u);
  EXPECT_EQ(errors.wrong_hits, 1u);
  EXPECT_EQ(errors.wrong_misses, 1u);
  EXPECT_EQ(errors.both_hit, 2u);
  EXPECT_EQ(errors.wrong_primitive, 1u);
  EXPECT_DOUBLE_EQ(errors.wrong_share(), 0.4);
  EXPECT_NEAR(errors.depth_diagonal.mean, 0.5 * (0.5 * 2 / 5), 1e-7);
  EXPECT_NEAR(errors.depth_diagonal.p99, 0.5 * 2 / 5, 1e-7);
  EXPECT_NEAR(errors.depth_distance.mean, 0.25, 1e-7);
  EXPECT_NEAR(errors.normal_degrees.mean, 45, 1e-4);
  const RayErrors any = occlusion_errors(truth, answers);
  EXPECT_EQ(any.wrong_hits, 1u);
  EXPECT_EQ(any.wrong_misses, 1u);
}

TEST(RayErrors, PercentilesByNearestRank) {
  std::vector<float> values;
  for (int i = 1; i <= 200; ++i) values.push_back(static_cast<float>(i));
  Random random(1);
  shuffle(values, random);
  const Spread spread = spread_of(values);
  EXPECT_DOUBLE_EQ(spread.mean, 100.5);
  EXPECT_DOUBLE_EQ(spread.p95, 190);
  EXPECT_DOUBLE_EQ(spread.p99, 198);
}

}  // namespace
}  // namespace lsp::bench
