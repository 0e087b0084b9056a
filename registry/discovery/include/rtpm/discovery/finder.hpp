#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/discovery/scope.hpp"

namespace rtpm::discovery {

/// How many servers' own name services of this host are asked, and services of the LAN.
inline constexpr std::size_t kLocalServiceCountMax = 64;
inline constexpr std::size_t kLanServiceCountMax = 256;
/// How long answers from the LAN are awaited.
inline constexpr Duration kLanPatience = std::chrono::milliseconds{250};

/// An object with the interface of names, not yet asked.
struct FoundService {
  std::string url{};
  bool is_registry = false;
  std::uint32_t process_id = 0;  ///< On its host; 0: not known.
  bool is_of_this_host = false;
  /// Nobody said so: it may be there because this is its usual place.
  bool is_guess = false;
};

struct FoundServices {
  std::vector<FoundService> services{};  ///< Registries first; each once.
  /// What was left out and why, as sentences.
  std::vector<std::string> notes{};
};

/// The name services of the scope, as they are now. On the LAN it sends queries and waits for
/// kLanPatience, for host names up to 1 s, or until `deadline`. The interfaces that it uses are
/// said on standard error, once in a program.
/// @threads  any, several at once
/// @realtime set-up only; blocks
/// @errors   the folder of this host is not safe to use; no such interface
[[nodiscard]] expected<FoundServices, SetupError> find_services(const Scope& scope,
                                                                MonotonicTime deadline = kNever);

}  // namespace rtpm::discovery
