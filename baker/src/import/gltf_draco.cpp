#include "import/gltf_draco.h"

#include <draco/compression/decode.h>

#include <algorithm>

#include "import/source_file.h"
#include "lsp/program.h"

namespace lsp {
namespace {

// Values of one attribute for every point, as three floats.
bool read_attribute(const draco::Mesh& mesh, int id, bool normalized, std::vector<float>& out) {
  const draco::PointAttribute* attribute = mesh.GetAttributeByUniqueId(uint32_t(id));
  if (!attribute || attribute->num_components() != 3) return false;
  double scale = 1;
  if (normalized) {
    switch (attribute->data_type()) {
      case draco::DT_INT8:
        scale = 127;
        break;
      case draco::DT_UINT8:
        scale = 255;
        break;
      case draco::DT_INT16:
        scale = 32767;
        break;
      case draco::DT_UINT16:
        scale = 65535;
        break;
      default:
        break;
    }
  }
  // Draco divides by the largest value itself where its own attribute says so.
  if (attribute->normalized()) scale = 1;
  out.resize(size_t{3} * mesh.num_points());
  for (uint32_t point = 0; point < mesh.num_points(); ++point) {
    const draco::AttributeValueIndex at = attribute->mapped_index(draco::PointIndex(point));
    float value[3];
    if (at.value() >= attribute->size() || !attribute->ConvertValue<float, 3>(at, value)) return false;
    for (int k = 0; k < 3; ++k) {
      out[size_t{3} * point + size_t(k)] = scale == 1 ? value[k] : std::max(float(value[k] / scale), -1.0f);
    }
  }
  return true;
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
  budget.charge(file, mesh->num_points(), 6 * sizeof(float));
  DracoMesh out;
  out.indices.reserve(size_t{3} * mesh->num_faces());
  for (uint32_t i = 0; i < mesh->num_faces(); ++i) {
    const draco::Mesh::Face& face = mesh->face(draco::FaceIndex(i));
    for (int k = 0; k < 3; ++k) out.indices.push_back(face[size_t(k)].value());
  }
  if (job.position_id >= 0 &&
      !read_attribute(*mesh, job.position_id, job.position_normalized, out.positions)) {
    throw fail("lacks the positions");
  }
  if (job.normal_id >= 0 && !read_attribute(*mesh, job.normal_id, job.normal_normalized, out.normals))
    throw fail("lacks the normals");
  return out;
}

}  // namespace lsp
