#include "rtpm/wire/status.hpp"

#include <array>

namespace rtpm::wire {

std::string_view to_string(Status status) noexcept {
  static constexpr std::array<std::string_view, kStatusCount> kNames{"ok",
                                                                     "overload",
                                                                     "expired",
                                                                     "no_such_method",
                                                                     "no_such_object",
                                                                     "bad_request",
                                                                     "not_lease_holder",
                                                                     "gone",
                                                                     "servant_failed",
                                                                     "too_large",
                                                                     "priority_not_allowed",
                                                                     "wrong_band",
                                                                     "unknown_session",
                                                                     "version_unsupported",
                                                                     "bad_limits",
                                                                     "wrong_interface",
                                                                     "cancelled",
                                                                     "stopping",
                                                                     "lost",
                                                                     "not_allowed"};
  const auto index = static_cast<std::size_t>(status);
  return index < kNames.size() ? kNames[index] : "unknown";
}

}  // namespace rtpm::wire
