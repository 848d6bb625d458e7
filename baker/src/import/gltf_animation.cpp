// glTF 2.0, section 3.11 and appendix C.
#include "import/gltf_animation.h"

#include <algorithm>
#include <cmath>

#include "import/json_member.h"
#include "import/source_file.h"
#include "import/text.h"
#include "lsp/program.h"

namespace lsp {
namespace {

using nlohmann::json;

// Which of the animations is meant, -1 for none.
int64_t find_animation(const json& animations, const std::string& wanted) {
  if (wanted.empty()) return 0;
  for (size_t i = 0; i < animations.size(); ++i) {
    if (text_member(animations[i], "name") == wanted) return int64_t(i);
  }
  int64_t number = -1;
  return integer_of(wanted, number) && number >= 0 && uint64_t(number) < animations.size() ? number : -1;
}

std::string in_words(const json& animations, size_t i) {
  const std::string name = printable(text_member(animations[i], "name").substr(0, 60));
  return std::to_string(i) + (name.empty() ? "" : " (" + name + ")");
}

double dot(const double* a, const double* b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]; }

// Between two rotations on the shorter way. Quantised ones are not of unit length, and of different ones.
std::vector<double> slerp(const double* from, const double* to, double u) {
  const double of_from = std::sqrt(dot(from, from)), of_to = std::sqrt(dot(to, to));
  const double cosine = of_from * of_to > 0 ? dot(from, to) / (of_from * of_to) : 1;
  const double angle = std::acos(std::min(std::abs(cosine), 1.0)), sine = std::sin(angle);
  const bool near = sine < 1e-9;
  const double a = near ? 1 - u : std::sin((1 - u) * angle) / sine;
  const double b = std::copysign(near ? u : std::sin(u * angle) / sine, cosine);
  std::vector<double> out;
  for (int k = 0; k < 4; ++k)
    out.push_back((of_from > 0 ? a * from[k] / of_from : 0) + (of_to > 0 ? b * to[k] / of_to : 0));
  return out;
}

class Player {
 public:
  Player(GltfDocument& document, GltfAccessors& accessors, MeshBuilder& builder, double seconds)
      : document_(document), accessors_(accessors), builder_(builder), time_(float(seconds)) {}

  void play(const json& animation) {
    const json &channels = member(animation, "channels"), &samplers = member(animation, "samplers");
    if (!channels.is_array() || !samplers.is_array()) fail("without channels or samplers");
    for (const json& channel : channels) {
      const json& target = member(channel, "target");
      if (member(target, "node").is_null()) continue;  // as the specification says
      const int64_t node = index_member(target, "node"), sampler = index_member(channel, "sampler");
      if (node < 0 || uint64_t(node) >= document_.model.nodes.size()) fail("of a node that is not there");
      if (sampler < 0 || uint64_t(sampler) >= samplers.size()) fail("with a sampler that is not there");
      move(document_.model.nodes[size_t(node)], text_member(target, "path"), samplers[size_t(sampler)]);
    }
  }

 private:
  [[noreturn]] void fail(const std::string& what) const {
    throw Failure(Exit::kInvalid, document_.file, "has an animation " + what + ", export it again");
  }
  void note(const std::string& text) { builder_.note(document_.file + ": " + text); }

  void move(tinygltf::Node& node, const std::string& path, const json& sampler) {
    const bool turns = path == "rotation", places = turns || path == "translation" || path == "scale";
    if (places && !node.matrix.empty())
      return note("a node with a matrix is animated, which glTF does not permit; it is not moved");
    if (turns) {
      node.rotation = value_at(sampler, 4, 1, true);
    } else if (places) {
      (path == "scale" ? node.scale : node.translation) = value_at(sampler, 3, 1, false);
    } else if (path == "weights") {
      const size_t targets = morph_targets(node);
      if (targets) node.weights = value_at(sampler, 1, targets, false);
    } else {
      note("animation channels of the path " + path + " are not played");
    }
  }

  size_t morph_targets(const tinygltf::Node& node) const {
    if (node.mesh < 0 || size_t(node.mesh) >= document_.model.meshes.size()) return 0;
    size_t most = 0;
    for (const tinygltf::Primitive& primitive : document_.model.meshes[size_t(node.mesh)].primitives)
      most = std::max(most, primitive.targets.size());
    return most;
  }

  // Keys hold `elements` elements of `components` numbers.
  std::vector<double> value_at(const json& sampler, int components, size_t elements, bool rotation) {
    const std::string given = text_member(sampler, "interpolation");
    const bool step = given == "STEP", cubic = given == "CUBICSPLINE";
    if (!step && !cubic && !given.empty() && given != "LINEAR") fail("with an unknown interpolation");
    const std::vector<float> times = accessors_.floats(accessor_of(sampler, "input"), 1);
    for (size_t i = 0; i < times.size(); ++i) {
      if (!std::isfinite(times[i]) || (i > 0 && times[i] < times[i - 1])) fail("whose times do not grow");
    }
    const std::vector<float> values = accessors_.floats(accessor_of(sampler, "output"), components);
    const size_t each = elements * size_t(components), stride = cubic ? 3 * each : each;
    if (times.empty() || values.size() % stride != 0 || values.size() / stride != times.size())
      fail("with more or fewer values than keys");

    // Part 0 of a cubic key is the tangent into it, 1 its value, 2 the tangent out of it.
    const auto key = [&](size_t i, size_t part) {
      const auto begin = values.begin() + std::ptrdiff_t(i * stride + (cubic ? part * each : 0));
      return std::vector<double>(begin, begin + std::ptrdiff_t(each));
    };
    const size_t after = size_t(std::upper_bound(times.begin(), times.end(), time_) - times.begin());
    if (after == 0) return key(0, 1);
    const std::vector<double> from = key(after - 1, 1);
    if (step || after == times.size()) return from;
    const std::vector<double> to = key(after, 1);
    const double length = double(times[after]) - double(times[after - 1]);
    const double u = (double(time_) - double(times[after - 1])) / length;
    if (rotation && !cubic) return slerp(from.data(), to.data(), u);
    std::vector<double> out(each);
    if (!cubic) {
      for (size_t k = 0; k < each; ++k) out[k] = (1 - u) * from[k] + u * to[k];
      return out;
    }
    const std::vector<double> leaves = key(after - 1, 2), arrives = key(after, 0);
    const double u2 = u * u, u3 = u2 * u;
    for (size_t k = 0; k < each; ++k) {
      out[k] = (2 * u3 - 3 * u2 + 1) * from[k] + length * (u3 - 2 * u2 + u) * leaves[k] +
               (3 * u2 - 2 * u3) * to[k] + length * (u3 - u2) * arrives[k];
    }
    return out;
  }

  int accessor_of(const json& sampler, const char* key) const {
    const int64_t accessor = index_member(sampler, key);
    if (accessor < 0 || uint64_t(accessor) >= document_.model.accessors.size())
      fail("with keys that are not there");
    return int(accessor);
  }

  GltfDocument& document_;
  GltfAccessors& accessors_;
  MeshBuilder& builder_;
  const float time_;  // as keys are: 0.1 s is at the key of 0.1 s
};

}  // namespace

void pose_document(GltfDocument& document, GltfAccessors& accessors, PoseRequest& request,
                   MeshBuilder& builder) {
  const json& animations = document.animations;
  if (!animations.is_array() || animations.empty()) return;
  const int64_t played = request.seconds ? find_animation(animations, request.animation) : -1;
  constexpr size_t kMostNames = 10;
  for (size_t i = 0; i < animations.size() && request.known.size() < kMostNames; ++i)
    request.known.push_back(in_words(animations, i));
  if (played < 0) {
    builder.note(document.file +
                 ": its animations are not played, the mesh is taken at rest; --time SECONDS takes it as "
                 "they have it");
    return;
  }
  request.met = true;
  Player(document, accessors, builder, *request.seconds).play(animations[size_t(played)]);
  if (request.animation.empty() && animations.size() > 1) {
    builder.note(document.file + ": of its " + std::to_string(animations.size()) + " animations the first, " +
                 in_words(animations, 0) + ", is played, --animation chooses another");
  }
}

}  // namespace lsp
