// Typed reading of glTF accessors, every offset checked.
#pragma once

#include <map>

#include "import/gltf_document.h"

namespace lsp {

class GltfAccessors {
 public:
  GltfAccessors(const GltfDocument& document, Budget& budget) : document_(document), budget_(budget) {}

  // The accessor, or a Failure kInvalid where the index is out of range.
  const tinygltf::Accessor& at(int accessor) const;

  // `components` floats an element (1: a scalar, 16: a matrix by columns), count * components in all:
  // quantised values are decoded, an accessor without a buffer view is zero, sparse values are laid over.
  // kInvalid for another number of components, a component type glTF does not permit for vertices, or bytes
  // outside the buffers.
  std::vector<float> floats(int accessor, int components);

  // Unsigned scalars. kInvalid as above.
  std::vector<uint32_t> indices(int accessor);

  // Lays the accessor's sparse values, if it has any, over `values` (count * components floats).
  void overlay_sparse(int accessor, int components, std::vector<float>& values);

  // The bytes of a buffer view, decompressed where EXT_meshopt_compression says so. kUnsupported where that
  // fails; kInvalid where they lie outside the buffer.
  Bytes view(int buffer_view);

 private:
  const uint8_t* elements(int accessor, uint64_t element, uint64_t& stride);
  template <typename Set>
  void for_each_sparse(int accessor, uint64_t element, const Set& set);
  Bytes decode_meshopt(int buffer_view, const tinygltf::Value& extension);
  Bytes buffer_range(int buffer, uint64_t offset, uint64_t length) const;

  const GltfDocument& document_;
  Budget& budget_;
  std::map<int, std::vector<uint8_t>> decoded_;
};

// How many numbers make a value of a vertex attribute by that name.
int gltf_components(const std::string& name, const tinygltf::Accessor& accessor);

}  // namespace lsp
