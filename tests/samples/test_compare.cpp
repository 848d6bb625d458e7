// Pictures: the comparison on pictures whose distance is known, and the .pfm file.
#include "compare.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <fstream>

#include "lsp/program.h"

namespace lsp::sample {
namespace {

class TemporaryFile {
 public:
  explicit TemporaryFile(const std::string& name)
      : path_(std::filesystem::temp_directory_path() / ("lsp_samples_" + std::to_string(::getpid()) + name)) {
  }
  ~TemporaryFile() { std::filesystem::remove(path_); }
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

Picture filled(int width, int height, float value) {
  Picture p(width, height);
  for (glm::vec3& pixel : p.pixels) pixel = glm::vec3(value);
  return p;
}

TEST(Compare, EqualPictures) {
  const Comparison c = compare(filled(3, 2, 0.5f), filled(3, 2, 0.5f));
  EXPECT_EQ(c.rmse, 0);
  EXPECT_EQ(c.mean_absolute, 0);
  EXPECT_TRUE(std::isinf(c.psnr_db));
  EXPECT_EQ(c.pixels_over_5_percent, 0u);
}

TEST(Compare, KnownDistance) {
  Picture reference = filled(2, 2, 0.5f);
  Picture test = reference;
  test.pixels[3] = glm::vec3(0.5f, 0.5f, 1.5f);  // one channel of twelve is off by 1
  const Comparison c = compare(reference, test);
  EXPECT_NEAR(c.mean_absolute, 1.0 / 12.0, 1e-9);
  EXPECT_NEAR(c.rmse, std::sqrt(1.0 / 12.0), 1e-9);
  EXPECT_NEAR(c.relative_mean, 1.0 / 6.0, 1e-9);
  EXPECT_NEAR(c.mean_test - c.mean_reference, 1.0 / 12.0, 1e-9);
  EXPECT_EQ(c.pixels_over_5_percent, 1u);
}

TEST(Compare, PsnrIsOfWhatIsShown) {
  // Black against the brightest that can be shown: an error of 1 everywhere.
  EXPECT_NEAR(compare(filled(4, 4, 0.0f), filled(4, 4, 1e4f)).psnr_db, 0.0, 0.01);
}

// A share of nothing is not 0, unless nothing differs.
TEST(Compare, ErrorAgainstABlackReferenceIsNotZero) {
  EXPECT_TRUE(std::isinf(compare(filled(2, 2, 0.0f), filled(2, 2, 0.25f)).relative_mean));
  EXPECT_EQ(compare(filled(2, 2, 0.0f), filled(2, 2, 0.0f)).relative_mean, 0);
}

TEST(Compare, DifferenceIsAmplified) {
  const Picture d = difference(filled(1, 1, 0.5f), filled(1, 1, 0.25f), 4.0f);
  EXPECT_EQ(d.pixels[0], glm::vec3(1.0f));
}

TEST(Compare, OtherSizesAreRefused) { EXPECT_THROW(compare(filled(2, 3, 0), filled(3, 2, 0)), Failure); }

TEST(Pfm, RoundTripKeepsEveryBit) {
  const TemporaryFile file("round.pfm");
  Picture p(3, 2);
  for (size_t i = 0; i < p.pixels.size(); ++i)
    p.pixels[i] = glm::vec3(0.1f * static_cast<float>(i), -1e-20f, 1e30f);
  write_picture(file.path(), p, Transfer::kToneMapped);
  const Picture back = read_pfm(file.path());
  ASSERT_EQ(back.width, 3);
  ASSERT_EQ(back.height, 2);
  EXPECT_EQ(back.pixels, p.pixels);
}

TEST(Pfm, DamagedFilesAreRefused) {
  for (const std::string& bytes : {std::string(), std::string("PF\n"), std::string("PF\n-1 4\n-1.0\n"),
                                   std::string("PF\n99999999 99999999\n-1.0\n"), std::string("PF\n4 4\n0\n"),
                                   std::string("PF\n4 4\nnan\n"), std::string("PF\n4 4\n-1.0\nshort"),
                                   std::string("Pf\n1 1\n-1.0\n0000"), std::string(100, '\xff'),
                                   "PF\n1 1\n-1.0\n" + std::string(13, '\0')}) {
    const TemporaryFile file("damaged.pfm");
    std::ofstream(file.path(), std::ios::binary) << bytes;
    EXPECT_THROW(read_pfm(file.path()), Failure) << bytes.substr(0, 20);
  }
  EXPECT_THROW(read_pfm("/nonexistent.pfm"), Failure);
}

TEST(Picture, FailedWriteLeavesNothing) {
  EXPECT_THROW(write_picture("/nonexistent/folder/a.png", filled(1, 1, 0), Transfer::kDisplay), Failure);
  EXPECT_THROW(write_picture("a.jpeg", filled(1, 1, 0), Transfer::kDisplay), Failure);
  EXPECT_FALSE(std::filesystem::exists("a.jpeg"));
}

TEST(Picture, ToneMapIsMonotonicAndBounded) {
  float before = -1;
  for (float x = 0; x < 50; x += 0.05f) {
    const float y = tone_map(glm::vec3(x)).x;
    EXPECT_GE(y, before);
    EXPECT_LE(y, 1.0f);
    before = y;
  }
  EXPECT_EQ(tone_map(glm::vec3(-1.0f)), glm::vec3(0.0f));
}

}  // namespace
}  // namespace lsp::sample
