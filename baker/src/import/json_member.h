// Reading JSON whose shape nobody has checked.
#pragma once

#include <cmath>
#include <nlohmann/json.hpp>
#include <string>

namespace lsp {

// The member of an object, or null; never throws whatever `parent` is.
inline const nlohmann::json& member(const nlohmann::json& parent, const char* key) {
  static const nlohmann::json kNull;
  if (!parent.is_object()) return kNull;
  const auto at = parent.find(key);
  return at != parent.end() ? *at : kNull;
}

// An element of an array, null where there is none by that number.
inline const nlohmann::json& element(const nlohmann::json& list, int64_t index) {
  static const nlohmann::json kNull;
  return list.is_array() && index >= 0 && uint64_t(index) < list.size() ? list[size_t(index)] : kNull;
}

// A whole number of 0 or more, or `fallback` for anything else.
inline int64_t index_member(const nlohmann::json& parent, const char* key, int64_t fallback = -1) {
  const nlohmann::json& value = member(parent, key);
  if (!value.is_number()) return fallback;
  const auto number = value.get<double>();
  return number >= 0 && number < 9e15 && number == std::floor(number) ? int64_t(number) : fallback;
}

inline double number_member(const nlohmann::json& parent, const char* key, double fallback) {
  const nlohmann::json& value = member(parent, key);
  return value.is_number() ? value.get<double>() : fallback;
}

inline std::string text_member(const nlohmann::json& parent, const char* key) {
  const nlohmann::json& value = member(parent, key);
  return value.is_string() ? value.get<std::string>() : std::string();
}

// Overwrites `values` by an array's `count` numbers. False, with nothing changed, where there is something
// else.
template <typename T>
bool numbers_member(const nlohmann::json& parent, const char* key, size_t count, T* values) {
  const nlohmann::json& array = member(parent, key);
  if (array.is_null()) return true;
  if (!array.is_array() || array.size() != count) return false;
  for (const nlohmann::json& item : array) {
    if (!item.is_number()) return false;
  }
  for (size_t i = 0; i < count; ++i) values[i] = T(array[i].template get<double>());
  return true;
}

}  // namespace lsp
