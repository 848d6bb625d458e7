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

// What extensions name comes before what stands there for readers without them, but for KTX2.
std::vector<int64_t> images_of(const json& texture) {
  const json& extensions = member(texture, "extensions");
  std::vector<int64_t> images;
  for (const int64_t image :
       {index_member(member(extensions, "EXT_texture_webp"), "source"), index_member(texture, "source"),
        index_member(member(extensions, "KHR_texture_basisu"), "source")}) {
    if (image >= 0) images.push_back(image);
  }
  return images;
}

}  // namespace

// The pictures of the texture that a material names; none, with a note, where none is named that is read.
GltfTextures::Images GltfTextures::images_at(const json& info) {
  const int64_t index = index_member(info, "index");
  const json& texture = element(member(document_.looks, "textures"), index);
  Images images = images_of(texture);
  if (index < 0) {
    note("a texture without a number is not read; factors hold without it");
  } else if (texture.is_null()) {
    note("texture " + std::to_string(index) + " is not there; factors hold without it");
  } else if (images.empty()) {
    note("texture " + std::to_string(index) + " names no picture that is read; factors hold without it");
  }
  return images;
}

std::optional<glm::dvec4> GltfTextures::mean(const json& info) {
  if (info.is_null()) return std::nullopt;
  const Images images = images_at(info);
  if (images.empty()) return std::nullopt;
  const auto [at, fresh] = means_.try_emplace(images);
  if (fresh) {
    const Picture picture = read_first(images);
    glm::dvec4 sum(0);
    for (size_t i = 0; i < picture.rgba.size(); i += 4)
      sum += glm::dvec4(picture.rgba[i], picture.rgba[i + 1], picture.rgba[i + 2], picture.rgba[i + 3]);
    if (!picture.rgba.empty()) at->second = sum * 4.0 / (255.0 * double(picture.rgba.size()));
    builder_.budget().release(picture.rgba.size() * 4);
  }
  return at->second;
}

// Repeated where the sampler does not say, and with a note where nobody knows what it says.
Wrap GltfTextures::wrap_of(const json& sampler, const char* key) {
  constexpr int64_t kRepeat = 10497, kClampToEdge = 33071, kMirroredRepeat = 33648;
  const json& mode = member(sampler, key);
  if (mode.is_null() || mode == kRepeat) return Wrap::kRepeat;
  if (mode == kClampToEdge) return Wrap::kClamp;
  if (mode == kMirroredRepeat) return Wrap::kMirror;
  note("the wrap mode of a sampler, " +
       mode.dump(-1, ' ', false, json::error_handler_t::replace).substr(0, 32) +
       ", is not known, its textures are repeated");
  return Wrap::kRepeat;
}

TextureUse GltfTextures::use(const json& info, const AlphaRule& rule) {
  TextureUse use;
  if (info.is_null()) return use;
  const Images images = images_at(info);
  if (images.empty()) return use;
  use.texture = texture(images, rule);
  place(info, use);
  return use;
}

// Wrap modes, the set of coordinates and KHR_texture_transform.
void GltfTextures::place(const json& info, TextureUse& use) {
  const json& source = element(member(document_.looks, "textures"), index_member(info, "index"));
  const json& number = member(source, "sampler");
  const json& sampler = element(member(document_.looks, "samplers"), index_member(source, "sampler"));
  if (!number.is_null() && !sampler.is_object())
    note("a texture has a sampler that is not there, it is repeated");
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
    if (std::error_code error; !std::filesystem::is_regular_file(path, error)) builder_.add_missing(path);
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

std::string GltfTextures::name_of(int64_t image) const {
  const json& source = element(member(document_.looks, "images"), image);
  const std::string uri = text_member(source, "uri"), given = text_member(source, "name");
  return !uri.empty() && !is_data_uri(uri) ? uri : !given.empty() ? given : std::to_string(image);
}

// Empty where it cannot be had, and `why` says why not.
Picture GltfTextures::read_picture(int64_t image, std::string& why) {
  const json& source = element(member(document_.looks, "images"), image);
  why = "is not there";
  try {
    if (source.is_object())
      return decode_picture(document_.file, picture_bytes(source), builder_.budget(), why);
  } catch (const Failure& failure) {
    if (failure.exit() == Exit::kLimit) throw;
    why = failure.what();
  }
  return {};
}

// The first that can be had, with a note on each before it; where none can, the factors hold alone.
Picture GltfTextures::read_first(const Images& images) {
  for (size_t i = 0; i < images.size(); ++i) {
    std::string why;
    Picture picture = read_picture(images[i], why);
    if (picture.turned) note("the picture " + name_of(images[i]) + kTurned);
    if (!picture.rgba.empty()) return picture;
    note(
        "the picture " + name_of(images[i]) + " " + why +
        (i + 1 < images.size() ? "; the next that its texture names is tried" : "; factors hold without it"));
  }
  return {};
}

std::shared_ptr<Texture> GltfTextures::texture(const Images& images, const AlphaRule& rule) {
  const auto [at, fresh] = textures_.try_emplace({images, rule});
  if (!fresh) return at->second;
  Picture picture = read_first(images);
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
