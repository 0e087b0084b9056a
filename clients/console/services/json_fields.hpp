#pragma once

#include <cstdint>
#include <string>

/// Reads fields of JSON objects of unknown form: one that is absent, or of another type, is the
/// stated default.
/// @tparam Json  nlohmann's, ordered or not
namespace rtpm::console::fields {

template <class Json>
[[nodiscard]] std::string text(const Json& json, const char* key) {
  const auto found = json.find(key);
  return found != json.end() && found->is_string() ? found->template get<std::string>()
                                                   : std::string{};
}

template <class Json>
[[nodiscard]] bool flag(const Json& json, const char* key) {
  const auto found = json.find(key);
  return found != json.end() && found->is_boolean() && found->template get<bool>();
}

template <class Json>
[[nodiscard]] double number(const Json& json, const char* key) {
  const auto found = json.find(key);
  return found != json.end() && found->is_number() ? found->template get<double>() : 0;
}

/// A whole number of at least 0.
template <class Json>
[[nodiscard]] std::uint64_t count(const Json& json, const char* key, std::uint64_t otherwise) {
  const auto found = json.find(key);
  return found != json.end() && found->is_number_unsigned() ? found->template get<std::uint64_t>()
                                                            : otherwise;
}

}  // namespace rtpm::console::fields
