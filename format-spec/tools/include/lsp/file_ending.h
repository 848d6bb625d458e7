// What kind of file a name says.
#pragma once

#include <filesystem>
#include <string>

namespace lsp {

// The ending of a file's name in lower case, as ".png" of "Room.PNG"; empty where it has none.
inline std::string file_ending(const std::filesystem::path& path) {
  std::string ending = path.extension().string();
  for (char& c : ending)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  return ending;
}

}  // namespace lsp
