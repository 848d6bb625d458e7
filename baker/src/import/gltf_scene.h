// Which nodes of a glTF document are there: the scene that is read, and what it comes to.
#pragma once

#include <functional>
#include <vector>

#include "import/gltf_document.h"
#include "import/mesh_builder.h"

namespace lsp {

class GltfScene {
 public:
  GltfScene(const GltfDocument& document, MeshBuilder& builder)
      : document_(document), model_(document.model), builder_(builder), roots_(find_roots()) {}

  // The default scene's nodes; without a default scene, all nodes that are no other node's child.
  const std::vector<int>& roots() const { return roots_; }

  // Refuses cycles and scenes too large before a single matrix is multiplied, notes what is left out. A node
  // may have several parents (files that do so exist, against the specification), so a small file can declare
  // a huge scene. `own_triangles` says how many a node has without its children; returned is how many the
  // scene has. Throws Failure.
  uint64_t check(const std::function<uint64_t(int)>& own_triangles);

  // Triangles of a node and of what hangs below it; 0 for what is not visible. Once check() was called.
  uint64_t triangles(int node) const { return extents_[size_t(node)].triangles; }

 private:
  struct Extent {
    uint64_t triangles = 0, visits = 0;
  };

  [[noreturn]] void fail(const std::string& what) const;
  const tinygltf::Node& node_at(int node) const;
  std::vector<int> find_roots();
  bool is_hidden(int node) const;
  static void add(Extent& to, const Extent& more);

  const GltfDocument& document_;
  const tinygltf::Model& model_;
  MeshBuilder& builder_;
  const std::vector<int> roots_;
  std::vector<Extent> extents_;  // of each node with what hangs below it
};

}  // namespace lsp
