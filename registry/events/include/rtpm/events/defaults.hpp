#pragma once

#include <cstdint>
#include <string_view>

namespace rtpm::events {

/// Where the hub is if nobody says otherwise.
inline constexpr std::string_view kDefaultHubUrl = "rtpm://127.0.0.1:7421/rtpm/events";
inline constexpr std::uint16_t kDefaultHubPort = 7421;
/// The path under which a server serves the hub, and the name under which rtpm-eventd binds it.
inline constexpr std::string_view kHubPath = "rtpm/events";

}  // namespace rtpm::events
