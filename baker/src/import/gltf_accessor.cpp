#include "import/gltf_accessor.h"

#include <meshoptimizer.h>

#include <cstring>

#include "lsp/program.h"

namespace lsp {
namespace {

[[noreturn]] void fail(const GltfDocument& document, const std::string& what) {
  throw Failure(Exit::kInvalid, document.file, what + ", export it again");
}

size_t size_of(int component_type) {
  switch (component_type) {
    case TINYGLTF_COMPONENT_TYPE_BYTE:
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return 1;
    case TINYGLTF_COMPONENT_TYPE_SHORT:
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return 2;
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
    case TINYGLTF_COMPONENT_TYPE_FLOAT:
      return 4;
    default:
      return 0;
  }
}

template <typename T>
T load(const uint8_t* from) {
  T value;
  std::memcpy(&value, from, sizeof value);
  return value;
}

float load_float(const uint8_t* from, int type, bool normalized) {
  const auto scaled = [&](float value, float largest) {
    return normalized ? std::max(value / largest, -1.0f) : value;
  };
  switch (type) {
    case TINYGLTF_COMPONENT_TYPE_BYTE:
      return scaled(float(load<int8_t>(from)), 127.0f);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return scaled(float(load<uint8_t>(from)), 255.0f);
    case TINYGLTF_COMPONENT_TYPE_SHORT:
      return scaled(float(load<int16_t>(from)), 32767.0f);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return scaled(float(load<uint16_t>(from)), 65535.0f);
    default:
      return load<float>(from);
  }
}

uint32_t load_index(const uint8_t* from, int type) {
  switch (type) {
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return load<uint8_t>(from);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return load<uint16_t>(from);
    default:
      return load<uint32_t>(from);
  }
}

bool is_index_type(int type) {
  return type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE || type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT ||
         type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT;
}

std::string name_of(int accessor) { return "accessor " + std::to_string(accessor); }

// `count` elements of `element` bytes, `stride` apart, from `offset`: the first one's address, once all of
// them are known to lie inside `bytes`. `what` names them.
const uint8_t* checked(const GltfDocument& document, const std::string& what, Bytes bytes, uint64_t offset,
                       uint64_t count, uint64_t element, uint64_t stride) {
  const uint64_t room = bytes.size();
  if (count == 0) return bytes.data();
  if (offset > room || element > room - offset || count - 1 > (room - offset - element) / stride) {
    fail(document, "is cut short, or " + what + " reaches beyond its buffer");
  }
  return bytes.data() + offset;
}

uint64_t number(const tinygltf::Value& object, const char* key) {
  const tinygltf::Value& value = object.Get(key);
  if (!value.IsNumber()) return 0;
  const double number = value.GetNumberAsDouble();
  return number >= 0 && number < 9e15 ? uint64_t(number) : UINT64_MAX;
}

}  // namespace

const tinygltf::Accessor& GltfAccessors::at(int accessor) const {
  if (accessor < 0 || size_t(accessor) >= document_.model.accessors.size()) {
    fail(document_, "refers to accessor " + std::to_string(accessor) + ", which is not there");
  }
  return document_.model.accessors[size_t(accessor)];
}

Bytes GltfAccessors::buffer_range(int buffer, uint64_t offset, uint64_t length) const {
  if (buffer < 0 || size_t(buffer) >= document_.buffers.size()) {
    fail(document_, "refers to buffer " + std::to_string(buffer) + ", which is not there");
  }
  const Bytes bytes = document_.buffers[size_t(buffer)];
  if (offset > bytes.size()) fail(document_, "has a buffer view outside its buffer");
  // A view that is declared longer than its buffer is cut; what reads beyond is refused where it reads.
  return bytes.subspan(offset, std::min<uint64_t>(length, bytes.size() - offset));
}

Bytes GltfAccessors::view(int buffer_view) {
  if (buffer_view < 0 || size_t(buffer_view) >= document_.model.bufferViews.size()) {
    fail(document_, "refers to buffer view " + std::to_string(buffer_view) + ", which is not there");
  }
  const tinygltf::BufferView& view = document_.model.bufferViews[size_t(buffer_view)];
  const auto extension = view.extensions.find("EXT_meshopt_compression");
  if (extension != view.extensions.end()) return decode_meshopt(buffer_view, extension->second);
  return buffer_range(view.buffer, view.byteOffset, view.byteLength);
}

Bytes GltfAccessors::decode_meshopt(int buffer_view, const tinygltf::Value& extension) {
  const auto known = decoded_.find(buffer_view);
  if (known != decoded_.end()) return known->second;
  const auto text = [&](const char* key) {
    const tinygltf::Value& value = extension.Get(key);
    return value.IsString() ? value.Get<std::string>() : std::string();
  };
  if (!extension.IsObject() || !extension.Has("buffer"))
    fail(document_, "has a compressed buffer view without a buffer");
  const std::string mode = text("mode"), filter = text("filter");
  const uint64_t count = number(extension, "count"), stride = number(extension, "byteStride");
  const uint64_t buffer = number(extension, "buffer");
  const Bytes source = buffer_range(buffer < 0x7FFFFFFF ? int(buffer) : -1, number(extension, "byteOffset"),
                                    number(extension, "byteLength"));
  const bool is_vertices = mode == "ATTRIBUTES";
  // The decoders' own conditions, which they only assert.
  const bool good = is_vertices
                        ? stride > 0 && stride <= 256 && stride % 4 == 0
                        : (stride == 2 || stride == 4) && (mode == "INDICES" || mode == "TRIANGLES") &&
                              (mode == "INDICES" || count % 3 == 0);
  const bool good_filter =
      filter.empty() || filter == "NONE" ||
      (is_vertices && ((filter == "OCTAHEDRAL" && (stride == 4 || stride == 8)) ||
                       (filter == "QUATERNION" && stride == 8) || filter == "EXPONENTIAL"));
  if (!good || !good_filter)
    fail(document_, "has a buffer view that EXT_meshopt_compression does not permit");
  budget_.charge(document_.file, count, stride);
  std::vector<uint8_t> bytes(count * stride);
  const int result =
      is_vertices ? meshopt_decodeVertexBuffer(bytes.data(), count, stride, source.data(), source.size())
      : mode == "INDICES"
          ? meshopt_decodeIndexSequence(bytes.data(), count, stride, source.data(), source.size())
          : meshopt_decodeIndexBuffer(bytes.data(), count, stride, source.data(), source.size());
  if (result != 0) fail(document_, "has a buffer view whose EXT_meshopt_compression data is damaged");
  if (filter == "OCTAHEDRAL") meshopt_decodeFilterOct(bytes.data(), count, stride);
  if (filter == "QUATERNION") meshopt_decodeFilterQuat(bytes.data(), count, stride);
  if (filter == "EXPONENTIAL") meshopt_decodeFilterExp(bytes.data(), count, stride);
  return decoded_[buffer_view] = std::move(bytes);
}

std::vector<float> GltfAccessors::floats(int index, int components) {
  const tinygltf::Accessor& accessor = at(index);
  const size_t component = size_of(accessor.componentType);
  const int shape = components == 16  ? TINYGLTF_TYPE_MAT4
                    : components == 1 ? TINYGLTF_TYPE_SCALAR
                                      : components;
  if (accessor.type != shape || component == 0 ||
      accessor.componentType == TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT) {
    fail(document_,
         "has vertex attributes or keys of a type glTF does not permit for them, " + name_of(index));
  }
  const uint64_t element = component * uint64_t(components);
  uint64_t stride = 0;
  const uint8_t* from = elements(index, element, stride);
  budget_.charge(document_.file, accessor.count, uint64_t(components) * sizeof(float));
  std::vector<float> values(accessor.count * size_t(components), 0.0f);
  if (from) {
    for (size_t i = 0; i < accessor.count; ++i) {
      for (int k = 0; k < components; ++k) {
        values[i * size_t(components) + size_t(k)] = load_float(from + i * stride + size_t(k) * component,
                                                                accessor.componentType, accessor.normalized);
      }
    }
  }
  overlay_sparse(index, components, values);
  return values;
}

// Where the accessor's elements of `element` bytes begin, and how far apart they are, once all are known to
// be there; null where it has no buffer view.
const uint8_t* GltfAccessors::elements(int index, uint64_t element, uint64_t& stride) {
  const tinygltf::Accessor& accessor = at(index);
  if (accessor.bufferView < 0) return nullptr;
  const Bytes bytes = view(accessor.bufferView);
  const size_t declared = document_.model.bufferViews[size_t(accessor.bufferView)].byteStride;
  stride = declared ? declared : element;
  return checked(document_, name_of(index), bytes, accessor.byteOffset, accessor.count, element, stride);
}

// Calls set(number of an element, its bytes) for an accessor's sparse elements of `element` bytes.
template <typename Set>
void GltfAccessors::for_each_sparse(int index, uint64_t element, const Set& set) {
  const tinygltf::Accessor& accessor = at(index);
  const auto& sparse = accessor.sparse;
  if (!sparse.isSparse) return;
  const std::string name = "the sparse part of " + name_of(index);
  if (sparse.count < 0 || !is_index_type(sparse.indices.componentType) || sparse.indices.byteOffset < 0 ||
      sparse.values.byteOffset < 0) {
    fail(document_, "has sparse values that glTF does not permit, " + name);
  }
  const auto count = uint64_t(sparse.count);
  const size_t index_bytes = size_of(sparse.indices.componentType);
  const uint8_t* numbers = checked(document_, name, view(sparse.indices.bufferView),
                                   uint64_t(sparse.indices.byteOffset), count, index_bytes, index_bytes);
  const uint8_t* values = checked(document_, name, view(sparse.values.bufferView),
                                  uint64_t(sparse.values.byteOffset), count, element, element);
  for (uint64_t i = 0; i < count; ++i) {
    const uint64_t number = load_index(numbers + i * index_bytes, sparse.indices.componentType);
    if (number >= accessor.count)
      fail(document_,
           "has a value for element " + std::to_string(number) + ", which is not there, in " + name);
    set(number, values + i * element);
  }
}

void GltfAccessors::overlay_sparse(int index, int components, std::vector<float>& values) {
  const tinygltf::Accessor& accessor = at(index);
  const size_t component = size_of(accessor.componentType);
  for_each_sparse(index, component * uint64_t(components), [&](uint64_t number, const uint8_t* value) {
    const uint64_t first = number * uint64_t(components);
    if (first + uint64_t(components) > values.size())
      fail(document_, "has more values in " + name_of(index) + " than its compressed data hold");
    for (uint64_t k = 0; k < uint64_t(components); ++k)
      values[first + k] = load_float(value + k * component, accessor.componentType, accessor.normalized);
  });
}

std::vector<uint32_t> GltfAccessors::indices(int index) {
  const tinygltf::Accessor& accessor = at(index);
  const size_t component = size_of(accessor.componentType);
  if (accessor.type != TINYGLTF_TYPE_SCALAR || !is_index_type(accessor.componentType)) {
    fail(document_, "has indices of a type glTF does not permit for them, " + name_of(index));
  }
  uint64_t stride = 0;
  const uint8_t* from = elements(index, component, stride);
  budget_.charge(document_.file, accessor.count, sizeof(uint32_t));
  std::vector<uint32_t> values(accessor.count, 0);
  for (size_t i = 0; i < accessor.count && from; ++i)
    values[i] = load_index(from + i * stride, accessor.componentType);
  for_each_sparse(index, component, [&](uint64_t number, const uint8_t* value) {
    values[number] = load_index(value, accessor.componentType);
  });
  return values;
}

int gltf_components(const std::string& name, const tinygltf::Accessor& accessor) {
  if (name == "POSITION" || name == "NORMAL") return 3;
  if (name.starts_with("TEXCOORD_")) return 2;
  if (name == "COLOR_0") return accessor.type == TINYGLTF_TYPE_VEC3 ? 3 : 4;
  return 4;
}

}  // namespace lsp
