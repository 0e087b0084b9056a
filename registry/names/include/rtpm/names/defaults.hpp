#pragma once

#include <cstdint>
#include <string_view>

namespace rtpm::names {

/// The URL at which rtpm-registryd listens by default.
inline constexpr std::string_view kDefaultRegistryUrl = "rtpm://127.0.0.1:7420/rtpm/names";
inline constexpr std::uint16_t kDefaultRegistryPort = 7420;
/// The default scope for look-ups: this host's registry or, without one, programs on this host that
/// serve their names themselves.
inline constexpr std::string_view kThisHost = "host";
/// The registry's path in its server.
inline constexpr std::string_view kRegistryPath = "rtpm/names";

}  // namespace rtpm::names
