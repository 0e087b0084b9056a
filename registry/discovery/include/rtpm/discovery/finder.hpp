#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/discovery/scope.hpp"

namespace rtpm::discovery {

/// Maximum number of this host's servers that are asked for their own names, and of services of the
/// LAN.
inline constexpr std::size_t kLocalServiceCountMax = 64;
inline constexpr std::size_t kLanServiceCountMax = 256;
/// How long to wait for answers from the LAN.
inline constexpr Duration kLanPatience = std::chrono::milliseconds{250};

/// An object with the interface of names that was not asked yet.
struct FoundService {
  std::string url{};
  bool is_registry = false;
  std::uint32_t process_id = 0;  ///< The process on its host; 0 if unknown.
  bool is_of_this_host = false;
  /// It was not announced, but may run, because this is the usual place.
  bool is_guess = false;
};

struct FoundServices {
  std::vector<FoundService> services{};  ///< Registries first, without duplicates.
  /// The services that were left out and why, as sentences.
  std::vector<std::string> notes{};
};

/// The name services of the scope at present. On the LAN it sends queries and waits for
/// kLanPatience, for host names up to 1 s, or until `deadline`. It reports the interfaces that it
/// uses on standard error, once per program.
/// @threads  any, several at once
/// @realtime set-up only; blocks
/// @errors   the folder of this host is not safe to use; no such interface
[[nodiscard]] expected<FoundServices, SetupError> find_services(const Scope& scope,
                                                                MonotonicTime deadline = kNever);

}  // namespace rtpm::discovery
