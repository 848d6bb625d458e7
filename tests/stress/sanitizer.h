// LSP_ADDRESS_SANITIZER is defined where the address sanitizer is on; Clang and GCC say so in different ways.
#pragma once

#if defined(__has_feature)
#if __has_feature(address_sanitizer)
#define LSP_ADDRESS_SANITIZER
#endif
#elif defined(__SANITIZE_ADDRESS__)
#define LSP_ADDRESS_SANITIZER
#endif
