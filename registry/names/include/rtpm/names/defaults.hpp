#pragma once

#include <cstdint>
#include <string_view>

namespace rtpm::names {

/// Where the registry is if nobody says otherwise.
inline constexpr std::string_view kDefaultRegistryUrl = "rtpm://127.0.0.1:7420/rtpm/names";
inline constexpr std::uint16_t kDefaultRegistryPort = 7420;
/// The path under which a server serves the registry.
inline constexpr std::string_view kRegistryPath = "rtpm/names";

}  // namespace rtpm::names
