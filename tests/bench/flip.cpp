// LDR-FLIP after Andersson et al. 2020; section and equation numbers are the paper's.
//
//   colour:   sRGB -> YCxCz -> contrast sensitivity filters -> linear RGB, clamped -> L*a*b* -> Hunt -> HyAB
//   feature:  Y -> first and second derivatives of a Gaussian -> how much edges and points differ
//   FLIP    = colour ^ (1 - feature)
#include <algorithm>
#include <cmath>

#include "image.h"
#include "same_size.h"

namespace lsp::bench {
namespace {

using Vec = glm::dvec3;

constexpr double kPi = 3.14159265358979323846;
const Vec kWhite(0.950428545, 1.0, 1.088900371);  // D65, of linear sRGB (1, 1, 1)

Vec to_linear(const glm::vec3& srgb) {
  Vec out;
  for (int c = 0; c < 3; ++c) {
    const double x = std::clamp(double{srgb[c]}, 0.0, 1.0);
    out[c] = x <= 0.04045 ? x / 12.92 : std::pow((x + 0.055) / 1.055, 2.4);
  }
  return out;
}

// Columns of linear sRGB to XYZ.
const glm::dmat3 kToXyz(Vec(10135552.0 / 24577794, 2613072.0 / 12288897, 1425312.0 / 73733382),
                        Vec(8788810.0 / 24577794, 8788810.0 / 12288897, 8788810.0 / 73733382),
                        Vec(4435075.0 / 24577794, 887015.0 / 12288897, 70074185.0 / 73733382));

// Linearised L*a*b* (section 4.1.1): the opponent space the filters work in.
Vec to_ycxcz(const Vec& linear) {
  const Vec p = kToXyz * linear / kWhite;
  return {116 * p.y - 16, 500 * (p.x - p.y), 200 * (p.y - p.z)};
}

Vec from_ycxcz(const Vec& c) {
  const double y = (c.x + 16) / 116;
  return glm::inverse(kToXyz) * (Vec(y + c.y / 500, y, y - c.z / 200) * kWhite);
}

Vec to_lab(const Vec& linear) {
  constexpr double kDelta = 6.0 / 29;
  Vec p = kToXyz * linear / kWhite;
  for (int c = 0; c < 3; ++c) {
    p[c] = p[c] > kDelta * kDelta * kDelta ? std::cbrt(p[c]) : p[c] / (3 * kDelta * kDelta) + 4.0 / 29;
  }
  return {116 * p.y - 16, 500 * (p.x - p.y), 200 * (p.y - p.z)};
}

// Colours look more colourful when brighter (the Hunt effect, equation 6).
Vec hunt(const Vec& lab) { return {lab.x, 0.01 * lab.x * lab.y, 0.01 * lab.x * lab.z}; }

double hyab(const Vec& a, const Vec& b) { return std::abs(a.x - b.x) + std::hypot(a.y - b.y, a.z - b.z); }

struct Plane {
  int width, height;
  std::vector<double> values;
  double& at(int x, int y) {
    return values[static_cast<size_t>(y) * static_cast<size_t>(width) + static_cast<size_t>(x)];
  }
  double at(int x, int y) const {
    return values[static_cast<size_t>(y) * static_cast<size_t>(width) + static_cast<size_t>(x)];
  }
};

// Separable convolution with odd kernels, borders repeated. The kernels are given from -radius on and are
// applied as a correlation, which for the odd ones differs in sign only.
Plane convolve(const Plane& in, const std::vector<double>& along_x, const std::vector<double>& along_y) {
  const int radius = static_cast<int>(along_x.size() / 2);
  Plane rows = in, out = in;
  for (int y = 0; y < in.height; ++y) {
    for (int x = 0; x < in.width; ++x) {
      double sum = 0;
      for (int k = -radius; k <= radius; ++k) {
        sum += along_x[static_cast<size_t>(k + radius)] * in.at(std::clamp(x + k, 0, in.width - 1), y);
      }
      rows.at(x, y) = sum;
    }
  }
  for (int y = 0; y < in.height; ++y) {
    for (int x = 0; x < in.width; ++x) {
      double sum = 0;
      for (int k = -radius; k <= radius; ++k) {
        sum += along_y[static_cast<size_t>(k + radius)] * rows.at(x, std::clamp(y + k, 0, in.height - 1));
      }
      out.at(x, y) = sum;
    }
  }
  return out;
}

// A Gaussian of the contrast sensitivity functions (table 1) in one dimension, and the sum of its samples.
std::vector<double> sensitivity_kernel(double b, int radius, double pixels_per_degree, double* sum) {
  std::vector<double> kernel;
  *sum = 0;
  for (int k = -radius; k <= radius; ++k) {
    const double x = k / pixels_per_degree;
    kernel.push_back(std::exp(-kPi * kPi * x * x / b));
    *sum += kernel.back();
  }
  for (double& value : kernel) value /= *sum;
  return kernel;
}

// What the eye resolves of a channel: one Gaussian, or the normalised sum of two (blue-yellow).
Plane filter_channel(const Plane& in, double a1, double b1, double a2, double b2, int radius, double ppd) {
  double sum1 = 0, sum2 = 0;
  const std::vector<double> first = sensitivity_kernel(b1, radius, ppd, &sum1);
  Plane out = convolve(in, first, first);
  if (a2 == 0) return out;
  const std::vector<double> second = sensitivity_kernel(b2, radius, ppd, &sum2);
  const Plane other = convolve(in, second, second);
  const double weight1 = a1 * std::sqrt(kPi / b1) * sum1 * sum1;
  const double weight2 = a2 * std::sqrt(kPi / b2) * sum2 * sum2;
  for (size_t i = 0; i < out.values.size(); ++i) {
    out.values[i] = (weight1 * out.values[i] + weight2 * other.values[i]) / (weight1 + weight2);
  }
  return out;
}

struct Opponent {
  Plane channel[3];  // YCxCz
};

Opponent opponent(const Image& image) {
  Opponent out;
  for (Plane& plane : out.channel) {
    plane = {static_cast<int>(image.width), static_cast<int>(image.height), {}};
    plane.values.resize(image.pixels.size());
  }
  for (size_t i = 0; i < image.pixels.size(); ++i) {
    const Vec c = to_ycxcz(to_linear(image.pixels[i]));
    for (int k = 0; k < 3; ++k) out.channel[k].values[i] = c[k];
  }
  return out;
}

std::vector<Vec> perceived(const Opponent& in, double ppd) {
  const int radius = static_cast<int>(std::ceil(3 * std::sqrt(0.04 / (2 * kPi * kPi)) * ppd));
  const Plane y = filter_channel(in.channel[0], 1, 0.0047, 0, 1e-5, radius, ppd);
  const Plane cx = filter_channel(in.channel[1], 1, 0.0053, 0, 1e-5, radius, ppd);
  const Plane cz = filter_channel(in.channel[2], 34.1, 0.04, 13.5, 0.025, radius, ppd);
  std::vector<Vec> out(y.values.size());
  for (size_t i = 0; i < out.size(); ++i) {
    const Vec linear = glm::clamp(from_ycxcz({y.values[i], cx.values[i], cz.values[i]}), 0.0, 1.0);
    out[i] = hunt(to_lab(linear));
  }
  return out;
}

// Positive weights to a sum of one, negative ones to minus one.
void normalise_signed(std::vector<double>& kernel) {
  double positive = 0, negative = 0;
  for (double value : kernel) (value > 0 ? positive : negative) += value;
  for (double& value : kernel) value /= value > 0 ? positive : -negative;
}

// Magnitude of the edge (first derivative) or point (second) detector of section 4.2.
std::vector<double> features(const Plane& luminance, double ppd, bool points) {
  constexpr double kWidthDegrees = 0.082;
  const double sigma = 0.5 * kWidthDegrees * ppd;
  const int radius = static_cast<int>(std::ceil(3 * sigma));
  std::vector<double> smooth, derivative;
  double sum = 0;
  for (int k = -radius; k <= radius; ++k) {
    const double g = std::exp(-k * k / (2 * sigma * sigma));
    smooth.push_back(g);
    derivative.push_back(points ? (k * k / (sigma * sigma) - 1) * g : -k * g);
    sum += g;
  }
  for (double& value : smooth) value /= sum;
  normalise_signed(derivative);
  const Plane dx = convolve(luminance, derivative, smooth), dy = convolve(luminance, smooth, derivative);
  std::vector<double> out(dx.values.size());
  for (size_t i = 0; i < out.size(); ++i) out[i] = std::hypot(dx.values[i], dy.values[i]);
  return out;
}

}  // namespace

std::vector<float> flip_map(const Image& reference, const Image& image, double pixels_per_degree) {
  require_same_size(reference, image);
  constexpr double kQc = 0.7, kPc = 0.4, kPt = 0.95, kQf = 0.5;
  const Opponent a = opponent(reference), b = opponent(image);
  const std::vector<Vec> seen_a = perceived(a, pixels_per_degree), seen_b = perceived(b, pixels_per_degree);

  Plane y_a = a.channel[0], y_b = b.channel[0];
  for (Plane* plane : {&y_a, &y_b}) {
    for (double& value : plane->values) value = (value + 16) / 116;
  }
  const std::vector<double> edges_a = features(y_a, pixels_per_degree, false);
  const std::vector<double> edges_b = features(y_b, pixels_per_degree, false);
  const std::vector<double> points_a = features(y_a, pixels_per_degree, true);
  const std::vector<double> points_b = features(y_b, pixels_per_degree, true);

  const double greatest = std::pow(hyab(hunt(to_lab(Vec(0, 1, 0))), hunt(to_lab(Vec(0, 0, 1)))), kQc);
  const double knee = kPc * greatest;
  std::vector<float> map(image.pixels.size());
  for (size_t i = 0; i < map.size(); ++i) {
    const double power = std::pow(hyab(seen_a[i], seen_b[i]), kQc);
    const double colour =
        power < knee ? kPt / knee * power : kPt + (power - knee) / (greatest - knee) * (1 - kPt);
    const double feature = std::max(std::abs(edges_b[i] - edges_a[i]), std::abs(points_b[i] - points_a[i]));
    const double exponent = std::clamp(std::pow(feature / std::sqrt(2.0), kQf), 0.0, 1.0);
    map[i] = static_cast<float>(std::pow(colour, 1 - exponent));
  }
  return map;
}

double flip(const Image& reference, const Image& image, double pixels_per_degree) {
  double sum = 0;
  const std::vector<float> map = flip_map(reference, image, pixels_per_degree);
  for (float value : map) sum += value;
  return sum / static_cast<double>(map.size());
}

}  // namespace lsp::bench
