#pragma once

#include <cstdint>
#include <string_view>

namespace rtpm::names {

/// Where rtpm-registryd listens by default.
inline constexpr std::string_view kDefaultRegistryUrl = "rtpm://127.0.0.1:7420/rtpm/names";
inline constexpr std::uint16_t kDefaultRegistryPort = 7420;
/// Where names are looked for by default: at the registry of this host, else where programs of this
/// host serve them themselves.
inline constexpr std::string_view kThisHost = "host";
/// Path of the registry in its server.
inline constexpr std::string_view kRegistryPath = "rtpm/names";

}  // namespace rtpm::names
