#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/discovery/scope.hpp"

namespace rtpm::discovery {

/// The most local servers that are asked for their own names, and the most LAN services.
inline constexpr std::size_t kLocalServiceCountMax = 64;
inline constexpr std::size_t kLanServiceCountMax = 256;
/// How long to wait for answers from the LAN.
inline constexpr Duration kLanPatience = std::chrono::milliseconds{250};

/// An object with the names interface that was not asked yet.
struct FoundService {
  std::string url{};
  bool is_registry = false;
  std::uint32_t process_id = 0;  ///< The process on its host; 0 if unknown.
  bool is_of_this_host = false;
  /// It was not announced, but may run at this default address.
  bool is_guess = false;
};

struct FoundServices {
  std::vector<FoundService> services{};  ///< Registries first, without duplicates.
  /// The services that were left out, and why; sentences.
  std::vector<std::string> notes{};
};

/// Finds the current name services of the scope. For listed hosts it first resolves their names,
/// for at most 1 s. Then it sends queries and waits for kLanPatience, or until all listed hosts
/// have answered, but never beyond `deadline`. Reports the interfaces that it uses on standard
/// error, once per program.
/// @threads  any, concurrently
/// @realtime set-up only; blocks
/// @errors   this host's folder is not safe to use; no such interface
[[nodiscard]] expected<FoundServices, SetupError> find_services(const Scope& scope,
                                                                MonotonicTime deadline = kNever);

}  // namespace rtpm::discovery
