#pragma once

#include <cstdint>
#include <string_view>

namespace rtpm::names {

/// The URL at which rtpm-registryd listens by default.
inline constexpr std::string_view kDefaultRegistryUrl = "rtpm://127.0.0.1:7420/rtpm/names";
inline constexpr std::uint16_t kDefaultRegistryPort = 7420;
/// The default scope for look-ups: the registry of this host or, without one, programs of this host
/// that serve their names themselves.
inline constexpr std::string_view kThisHost = "host";
/// Path of the registry in its server.
inline constexpr std::string_view kRegistryPath = "rtpm/names";

}  // namespace rtpm::names
