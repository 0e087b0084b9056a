#pragma once

#include <string>
#include <system_error>
#include <utility>

#include "rtpm/base/expected.hpp"

namespace rtpm::inline base {

/// Why set-up failed, each part as a clause.
struct SetupError {
  std::string what;         ///< What failed: "UDP 127.0.0.1:4711 can't be served".
  std::string why{};        ///< "Address already in use"; empty: `what` says it.
  std::string remedy{};     ///< What to do: "choose another port"; empty: `why` says it.
  std::error_code cause{};  ///< For programs: an errno or a CallError, if that is why.

  /// What failed and why, as a clause.
  [[nodiscard]] std::string reason() const { return why.empty() ? what : what + ": " + why; }
  /// For people: "<what>: <why>. Remedy: <remedy>.", foreign text in it escaped.
  [[nodiscard]] std::string text() const;
};

[[nodiscard]] inline unexpected<SetupError> setup_error(std::string what, std::string why = {},
                                                        std::string remedy = {}) {
  return {{std::move(what), std::move(why), std::move(remedy)}};
}
/// `why` is what `cause` says.
[[nodiscard]] inline unexpected<SetupError> setup_error(std::string what, std::error_code cause,
                                                        std::string remedy = {}) {
  return {{std::move(what), cause.message(), std::move(remedy), cause}};
}
/// `what` failed because of `error`, whose remedy and cause stay.
[[nodiscard]] inline unexpected<SetupError> setup_error(std::string what, SetupError error) {
  return {{std::move(what), error.reason(), std::move(error.remedy), error.cause}};
}
/// An errno as a cause.
[[nodiscard]] inline std::error_code system_error(int number) noexcept {
  return {number, std::generic_category()};
}

}  // namespace rtpm::inline base
