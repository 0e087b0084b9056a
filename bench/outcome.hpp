#pragma once

#include <string>
#include <type_traits>
#include <utility>

#include "rtpm/base/expected.hpp"

namespace rtpm::bench {

/// A value, or the reason why there is none, as a text for people.
template <class T = void>
using Outcome = expected<T, std::string>;

/// A reason: a text, an error with text(), or one that its namespace's to_string() names.
template <class Error>
[[nodiscard]] unexpected<std::string> failure(const Error& error) {
  if constexpr (std::is_convertible_v<const Error&, std::string>) {
    return {error};
  } else if constexpr (requires { error.text(); }) {
    return {error.text()};
  } else {
    return {std::string(to_string(error))};
  }
}

/// The result of a library's function with its error as a text.
template <class T, class Error>
[[nodiscard]] Outcome<T> outcome(expected<T, Error> result) {
  if (!result) return failure(result.error());
  if constexpr (std::is_void_v<T>) {
    return {};
  } else {
    return *std::move(result);
  }
}

}  // namespace rtpm::bench
