/* LSP_API marks what the libraries export. LSP_STATIC says that they are static, and exports nothing: not out
 * of an engine's own shared library either. lsp's CMake targets and lsp.pc define it. */
#ifndef LSP_EXPORT_H
#define LSP_EXPORT_H

#ifdef LSP_STATIC
#define LSP_API
#else
#define LSP_API __attribute__((visibility("default")))
#endif

#endif /* LSP_EXPORT_H */
