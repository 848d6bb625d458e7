#include "import/gltf_textures.h"

#include <algorithm>
#include <cmath>

#include "import/gltf_numbers.h"
#include "import/json_member.h"
#include "import/source_file.h"
#include "import/uri.h"
#include "lsp/program.h"

namespace lsp {

using nlohmann::json;

namespace {

Wrap wrap_of(const json& sampler, const char* key) {
  constexpr int64_t kClampToEdge = 33071, kMirroredRepeat = 33648;
  const int64_t mode = index_member(sampler, key);
  return mode == kClampToEdge ? Wrap::kClamp : mode == kMirroredRepeat ? Wrap::kMirror : Wrap::kRepeat;
}

int64_t image_of(const json& texture) {
  const json& extensions = member(texture, "extensions");
  int64_t image = index_member(member(extensions, "EXT_texture_webp"), "source");
  if (image < 0) image = index_member(texture, "source");
  if (image < 0) image = index_member(member(extensions, "KHR_texture_basisu"), "source");
  return image;
}

}  // namespace

// The picture of the texture that a material names; -1, with a note, where there is none that is read.
int64_t GltfTextures::image_at(const json& info) {
  const int64_t index = index_member(info, "index");
  const json& texture = element(member(document_.looks, "textures"), index);
  const int64_t image = image_of(texture);
  if (index < 0) {
    note("a texture without a number is not read; factors hold without it");
  } else if (texture.is_null()) {
    note("texture " + std::to_string(index) + " is not there; factors hold without it");
  } else if (image < 0) {
    note("texture " + std::to_string(index) + " names no picture that is read; factors hold without it");
  }
  return image;
}

std::optional<glm::dvec4> GltfTextures::mean(const json& info) {
  if (info.is_null()) return std::nullopt;
  const int64_t image = image_at(info);
  if (image < 0) return std::nullopt;
  const auto [at, fresh] = means_.try_emplace(image);
  if (fresh) {
    const Picture picture = read_picture(image);
    glm::dvec4 sum(0);
    for (size_t i = 0; i < picture.rgba.size(); i += 4)
      sum += glm::dvec4(picture.rgba[i], picture.rgba[i + 1], picture.rgba[i + 2], picture.rgba[i + 3]);
    if (!picture.rgba.empty()) at->second = sum * 4.0 / (255.0 * double(picture.rgba.size()));
    builder_.budget().release(picture.rgba.size() * 4);
  }
  return at->second;
}

TextureUse GltfTextures::use(const json& info, const AlphaRule& rule) {
  TextureUse use;
  if (info.is_null()) return use;
  const int64_t image = image_at(info);
  if (image < 0) return use;
  use.texture = texture(image, rule);
  place(info, use);
  return use;
}

// Wrap modes, the set of coordinates and KHR_texture_transform.
void GltfTextures::place(const json& info, TextureUse& use) {
  const json& source = element(member(document_.looks, "textures"), index_member(info, "index"));
  const json& sampler = element(member(document_.looks, "samplers"), index_member(source, "sampler"));
  use.wrap_x = wrap_of(sampler, "wrapS");
  use.wrap_y = wrap_of(sampler, "wrapT");
  constexpr int64_t kNearest = 9728;
  use.nearest = index_member(sampler, "magFilter") == kNearest;
  constexpr int64_t kMostSets = 1 << 20;
  use.set = int(std::min(index_member(info, "texCoord", 0), kMostSets));
  const json& placed = member(member(info, "extensions"), "KHR_texture_transform");
  if (!placed.is_object()) return;
  const GltfNumbers read(document_.file, builder_);
  double scale[2] = {1, 1};
  read.numbers(placed, "scale", 2, scale);
  read.numbers(placed, "offset", 2, &use.offset[0]);
  const double angle = read.number(placed, "rotation", 0), c = std::cos(angle), s = std::sin(angle);
  use.linear = glm::dmat2(c * scale[0], -s * scale[0], s * scale[1], c * scale[1]);
  use.set = int(std::min(index_member(placed, "texCoord", use.set), kMostSets));
}

std::string GltfTextures::picture_bytes(const json& image) {
  if (const std::string uri = text_member(image, "uri"); !uri.empty()) {
    if (is_data_uri(uri)) return decode_data_uri(document_.file, uri);
    std::string remark;
    const std::filesystem::path path = resolve_uri(path_, uri, remark);
    std::string bytes = read_file(path, builder_.budget());
    builder_.budget().release(bytes.size());
    builder_.add_source(path);
    if (!remark.empty()) note(remark);
    return bytes;
  }
  const int64_t view = index_member(image, "bufferView");
  const Bytes bytes = accessors_.view(view >= 0 && view < 0x7FFFFFFF ? int(view) : -1);
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

// Empty, with a note that names it, where it cannot be had: the factors hold alone then.
Picture GltfTextures::read_picture(int64_t image) {
  const json& source = element(member(document_.looks, "images"), image);
  const std::string uri = text_member(source, "uri"), given = text_member(source, "name");
  const std::string name = !uri.empty() && !is_data_uri(uri) ? uri
                           : !given.empty()                  ? given
                                                             : std::to_string(image);
  std::string why = "is not there";
  Picture picture;
  try {
    if (source.is_object())
      picture = decode_picture(document_.file, picture_bytes(source), builder_.budget(), why);
  } catch (const Failure& failure) {
    if (failure.exit() == Exit::kLimit) throw;
    why = failure.what();
  }
  if (picture.rgba.empty()) note("the picture " + name + " " + why + "; factors hold without it");
  return picture;
}

std::shared_ptr<Texture> GltfTextures::texture(int64_t image, const AlphaRule& rule) {
  const auto [at, fresh] = textures_.try_emplace({image, rule.mode, rule.factor, rule.cutoff});
  if (!fresh) return at->second;
  Picture picture = read_picture(image);
  if (picture.rgba.empty()) return nullptr;
  // The levels that may yet be made are charged at once.
  const uint64_t bytes = picture.rgba.size() * 7;
  builder_.budget().charge(document_.file, bytes);
  charged_ += bytes;
  return at->second = std::make_shared<Texture>(std::move(picture), rule);
}

bool GltfTextures::trim() {
  constexpr uint64_t kMuch = uint64_t{1} << 30;
  if (charged_ <= std::min(kMuch, builder_.budget().left() / 2)) return false;
  textures_.clear();
  builder_.budget().release(charged_);
  charged_ = 0;
  return true;
}

}  // namespace lsp
