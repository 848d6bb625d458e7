#include "import/gltf_draco.h"

#include <draco/compression/decode.h>

#include <algorithm>

#include "import/source_file.h"
#include "lsp/program.h"

namespace lsp {
namespace {

double largest_of(draco::DataType type) {
  switch (type) {
    case draco::DT_INT8:
      return 127;
    case draco::DT_UINT8:
      return 255;
    case draco::DT_INT16:
      return 32767;
    case draco::DT_UINT16:
      return 65535;
    default:
      return 1;
  }
}

template <int kComponents>
bool read_values(const draco::Mesh& mesh, const draco::PointAttribute& attribute, double scale,
                 std::vector<float>& out) {
  out.resize(size_t{kComponents} * mesh.num_points());
  for (uint32_t point = 0; point < mesh.num_points(); ++point) {
    const draco::AttributeValueIndex at = attribute.mapped_index(draco::PointIndex(point));
    float value[kComponents];
    if (at.value() >= attribute.size() || !attribute.ConvertValue<float, kComponents>(at, value))
      return false;
    for (int k = 0; k < kComponents; ++k) {
      out[size_t{kComponents} * point + size_t(k)] =
          scale == 1 ? value[k] : std::max(float(value[k] / scale), -1.0f);
    }
  }
  return true;
}

// Values of one attribute for every point. False where the mesh does not hold it so.
bool read_attribute(const draco::Mesh& mesh, const DracoAttribute& wanted, std::vector<float>& out) {
  const draco::PointAttribute* attribute = mesh.GetAttributeByUniqueId(uint32_t(wanted.id));
  if (!attribute || attribute->num_components() != wanted.components) return false;
  // Draco divides by the largest value itself where its own attribute says so.
  const double scale = wanted.normalized && !attribute->normalized() ? largest_of(attribute->data_type()) : 1;
  switch (wanted.components) {
    case 2:
      return read_values<2>(mesh, *attribute, scale, out);
    case 3:
      return read_values<3>(mesh, *attribute, scale, out);
    case 4:
      return read_values<4>(mesh, *attribute, scale, out);
    default:
      return false;
  }
}

}  // namespace

DracoMesh decode_draco(const std::string& file, const DracoJob& job, Budget& budget) {
  const auto fail = [&](const std::string& what) -> Failure {
    return {Exit::kInvalid, file, "has KHR_draco_mesh_compression data that " + what + ", export it again"};
  };
  draco::DecoderBuffer buffer;
  buffer.Init(reinterpret_cast<const char*>(job.bytes.data()), job.bytes.size());
  draco::Decoder decoder;
  auto decoded = decoder.DecodeMeshFromBuffer(&buffer);
  if (!decoded.ok()) throw fail("is damaged (" + printable(decoded.status().error_msg_string()) + ")");
  const std::unique_ptr<draco::Mesh> mesh = std::move(decoded).value();

  budget.charge(file, mesh->num_faces(), 3 * sizeof(uint32_t));
  for (const DracoAttribute& attribute : job.attributes)
    budget.charge(file, mesh->num_points(), uint64_t(attribute.components) * sizeof(float));
  DracoMesh out;
  out.indices.reserve(size_t{3} * mesh->num_faces());
  for (uint32_t i = 0; i < mesh->num_faces(); ++i) {
    const draco::Mesh::Face& face = mesh->face(draco::FaceIndex(i));
    for (int k = 0; k < 3; ++k) out.indices.push_back(face[size_t(k)].value());
  }
  for (const DracoAttribute& attribute : job.attributes) {
    std::vector<float>& values = out.values.emplace_back();
    if (read_attribute(*mesh, attribute, values)) continue;
    if (attribute.required) throw fail("lacks the positions or normals");
    values.clear();
  }
  return out;
}

}  // namespace lsp
