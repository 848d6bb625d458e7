// Of scenes with LSP_FEATURE_COVERAGE: the text of the others with every part.
#define LSP_VARIANT partial

#include "../trace_wide.cpp"
