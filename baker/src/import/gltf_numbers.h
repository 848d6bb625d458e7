// Numbers of a document's looks, with a note where something else stands in their place.
#pragma once

#include "import/json_member.h"
#include "import/mesh_builder.h"

namespace lsp {

class GltfNumbers {
 public:
  GltfNumbers(const std::string& file, MeshBuilder& builder) : file_(file), builder_(builder) {}

  double number(const nlohmann::json& parent, const char* key, double fallback) const {
    const nlohmann::json& value = member(parent, key);
    if (!value.is_null() && !value.is_number())
      builder_.note(file_ + ": " + key + " of a material is no number and not read");
    return number_member(parent, key, fallback);
  }

  // Leaves `values` as they are where there are not as many.
  template <typename T>
  void numbers(const nlohmann::json& parent, const char* key, size_t count, T* values) const {
    if (!numbers_member(parent, key, count, values))
      builder_.note(file_ + ": " + key + " of a material is not " + std::to_string(count) +
                    " numbers and not read");
  }

 private:
  const std::string& file_;
  MeshBuilder& builder_;
};

}  // namespace lsp
