/* The version of the library and of the programs, for C, C++ and preprocessors. That of the format is in
 * layout.h: LSP_VERSION_MAJOR, LSP_VERSION_MINOR. */
#ifndef LSP_VERSION_H
#define LSP_VERSION_H

#define LSP_LIBRARY_VERSION_MAJOR 0
#define LSP_LIBRARY_VERSION_MINOR 1
#define LSP_LIBRARY_VERSION_PATCH 0
#define LSP_LIBRARY_VERSION_STRING "0.1.0"

/* One number, to be compared: #if LSP_LIBRARY_VERSION >= LSP_MAKE_VERSION(0, 2, 0) */
#define LSP_MAKE_VERSION(major, minor, patch) ((major)*1000000 + (minor)*1000 + (patch))
#define LSP_LIBRARY_VERSION \
  LSP_MAKE_VERSION(LSP_LIBRARY_VERSION_MAJOR, LSP_LIBRARY_VERSION_MINOR, LSP_LIBRARY_VERSION_PATCH)

#endif /* LSP_VERSION_H */
