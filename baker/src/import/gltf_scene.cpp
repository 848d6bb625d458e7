#include "import/gltf_scene.h"

#include <algorithm>

#include "lsp/program.h"

namespace lsp {
namespace {

// Nodes a scene may visit, shared ones counted each time: seconds, and no more.
constexpr uint64_t kMaxVisits = 1 << 24;

}  // namespace

void GltfScene::fail(const std::string& what) const {
  throw Failure(Exit::kInvalid, document_.file, what + ", export it again");
}

const tinygltf::Node& GltfScene::node_at(int node) const {
  if (node < 0 || size_t(node) >= model_.nodes.size())
    fail("refers to node " + std::to_string(node) + ", which is not there");
  return model_.nodes[size_t(node)];
}

std::vector<int> GltfScene::find_roots() {
  if (model_.defaultScene >= 0) {
    if (size_t(model_.defaultScene) >= model_.scenes.size()) fail("names a default scene that is not there");
    return model_.scenes[size_t(model_.defaultScene)].nodes;
  }
  std::vector<bool> is_child(model_.nodes.size(), false);
  for (const tinygltf::Node& node : model_.nodes) {
    for (const int child : node.children) {
      node_at(child);
      is_child[size_t(child)] = true;
    }
  }
  std::vector<bool> in_scene(model_.nodes.size(), model_.scenes.empty());
  for (const tinygltf::Scene& scene : model_.scenes) {
    for (const int node : scene.nodes) {
      if (node >= 0 && size_t(node) < in_scene.size()) in_scene[size_t(node)] = true;
    }
  }
  std::vector<int> roots;
  size_t in_none = 0;
  for (size_t i = 0; i < model_.nodes.size(); ++i) {
    if (is_child[i]) continue;
    roots.push_back(int(i));
    in_none += !in_scene[i];
  }
  if (in_none)
    builder_.note(document_.file + ": no scene is the default one, all nodes are read: " +
                  std::to_string(in_none) + " of them are in no scene");
  return roots;
}

uint64_t GltfScene::check(const std::function<uint64_t(int)>& own_triangles) {
  enum : uint8_t { kNew, kOpen, kDone };
  std::vector<uint8_t> state(model_.nodes.size(), kNew);
  extents_.assign(model_.nodes.size(), {});
  Extent all;
  size_t hidden = 0;
  std::vector<std::pair<int, size_t>> stack;
  for (const int root : roots_) {
    node_at(root);
    if (state[size_t(root)] == kNew) stack.push_back({root, 0});
    if (!stack.empty()) state[size_t(root)] = kOpen;
    while (!stack.empty()) {
      const int node = stack.back().first;
      const auto& children = node_at(node).children;
      if (stack.back().second < children.size()) {
        const int child = children[stack.back().second++];
        node_at(child);
        if (state[size_t(child)] == kOpen) fail("has nodes that are their own ancestors");
        if (state[size_t(child)] == kNew) {
          state[size_t(child)] = kOpen;
          stack.push_back({child, 0});
        }
        continue;
      }
      Extent& extent = extents_[size_t(node)];
      extent.visits = 1 + children.size();
      extent.triangles = own_triangles(node);
      for (const int child : children) add(extent, extents_[size_t(child)]);
      if (is_hidden(node)) hidden += extent.triangles > 0, extent = {};
      state[size_t(node)] = kDone;
      stack.pop_back();
    }
    add(all, extents_[size_t(root)]);
  }
  if (hidden) {
    builder_.note(document_.file + ": " + std::to_string(hidden) +
                  " nodes are not visible, they and what hangs below are left out");
  }
  size_t left_out = 0;
  for (size_t node = 0; node < state.size(); ++node)
    left_out += state[node] == kNew && model_.nodes[node].mesh >= 0;
  if (left_out) {
    builder_.note(document_.file + ": " + std::to_string(left_out) +
                  " nodes with meshes are in no scene that is read, they are left out");
  }
  if (all.visits > kMaxVisits) {
    throw Failure(Exit::kLimit, document_.file, "places more than 2^24 nodes, split the scene");
  }
  return all.triangles;
}

// KHR_node_visibility.
bool GltfScene::is_hidden(int node) const {
  const auto& extensions = model_.nodes[size_t(node)].extensions;
  const auto found = extensions.find("KHR_node_visibility");
  if (found == extensions.end() || !found->second.IsObject()) return false;
  const tinygltf::Value& visible = found->second.Get("visible");
  return visible.IsBool() && !visible.Get<bool>();
}

void GltfScene::add(Extent& to, const Extent& more) {
  constexpr uint64_t kFull = uint64_t{1} << 62;
  to.triangles = std::min(kFull, to.triangles + more.triangles);
  to.visits = std::min(kFull, to.visits + (more.triangles ? more.visits : 0));
}

}  // namespace lsp
