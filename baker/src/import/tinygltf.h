// tinygltf, compiled here under a name of its own and without files, pictures and Draco.
//
// Debian's libdraco carries a tinygltf of another version and exports it. Whichever of libdraco and
// libtinygltf the linker meets first then serves both, with structures laid out differently: a test crashed
// in it.
#pragma once

#define TINYGLTF_NO_FS
#define TINYGLTF_NO_EXTERNAL_IMAGE
#define TINYGLTF_NO_STB_IMAGE
#define TINYGLTF_NO_STB_IMAGE_WRITE
#define TINYGLTF_NO_INCLUDE_STB_IMAGE
#define TINYGLTF_NO_INCLUDE_STB_IMAGE_WRITE
#define tinygltf lsp_tinygltf
#include <tiny_gltf.h>
#undef tinygltf

namespace lsp {
namespace tinygltf = ::lsp_tinygltf;
}
