// The saving half of the header wants this and includes it only with files.
#include <fstream>

#define TINYGLTF_IMPLEMENTATION
#include "import/tinygltf.h"
