#pragma once

#include <cstdint>
#include <string_view>

namespace rtpm::events {

/// The URL at which rtpm-eventd listens by default.
inline constexpr std::string_view kDefaultHubUrl = "rtpm://127.0.0.1:7421/rtpm/events";
inline constexpr std::uint16_t kDefaultHubPort = 7421;
/// The hub's path in its server, and its default name at the registry.
inline constexpr std::string_view kHubPath = "rtpm/events";

}  // namespace rtpm::events
