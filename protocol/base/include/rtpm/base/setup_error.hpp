#pragma once

#include <string>
#include <system_error>
#include <utility>

#include "rtpm/base/expected.hpp"

namespace rtpm::inline base {

/// A failure of set-up, each part as a clause.
struct SetupError {
  std::string what;         ///< The failure: "UDP 127.0.0.1:4711 can't be served".
  std::string why{};        ///< The reason: "Address already in use"; empty if `what` includes it.
  std::string remedy{};     ///< The next step, "choose another port"; empty if `why` names it.
  std::error_code cause{};  ///< For programs: an errno or a CallError, if that is the reason.

  /// The failure and its reason, as a clause.
  [[nodiscard]] std::string reason() const { return why.empty() ? what : what + ": " + why; }
  /// For people: "<what>: <why>. Remedy: <remedy>.", with foreign text escaped.
  [[nodiscard]] std::string text() const;
};

[[nodiscard]] inline unexpected<SetupError> setup_error(std::string what, std::string why = {},
                                                        std::string remedy = {}) {
  return {{std::move(what), std::move(why), std::move(remedy)}};
}
/// Uses the message of `cause` as `why`.
[[nodiscard]] inline unexpected<SetupError> setup_error(std::string what, std::error_code cause,
                                                        std::string remedy = {}) {
  return {{std::move(what), cause.message(), std::move(remedy), cause}};
}
/// Reports that `what` failed because of `error`; keeps the remedy and cause of `error`.
[[nodiscard]] inline unexpected<SetupError> setup_error(std::string what, SetupError error) {
  return {{std::move(what), error.reason(), std::move(error.remedy), error.cause}};
}
/// An errno as a std::error_code.
[[nodiscard]] inline std::error_code system_error(int number) noexcept {
  return {number, std::generic_category()};
}

}  // namespace rtpm::inline base
