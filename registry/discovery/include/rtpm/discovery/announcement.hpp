#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/discovery/scope.hpp"

namespace rtpm::discovery {

/// A name service to announce.
struct AnnouncedService {
  bool is_registry = false;
  /// The numeric addresses that it serves. The first match is announced: an IPv4 address of the
  /// scope's interfaces, then any IPv4 address that other hosts can reach, then any address.
  std::vector<std::string> hosts{};
  std::uint16_t port = 0;
};

/// Counts of the datagrams from the LAN. Malformed and suppressed ones are also reported on
/// standard error, at most one line every 10 s.
struct AnswerCounts {
  std::uint64_t answered = 0;
  std::uint64_t malformed = 0;     ///< Datagrams that are not a query.
  std::uint64_t other_domain = 0;  ///< Queries for another domain, which are not answered.
  std::uint64_t suppressed = 0;    ///< Answers beyond the limits.
};

/// Makes a name service discoverable while it lives: on this host by a socket in the user's folder
/// and, with a LAN scope and an address other than loopback, by answering queries on a time-shared
/// thread "rtpm-discovery". Reports its actions on standard error.
/// @threads  create, keep and destroy on one thread; counts: any
class Announcement {
 public:
  /// @realtime set-up only
  /// @errors   those of FolderSocket::create(), LanSocket::open(), multicast_interfaces()
  [[nodiscard]] static expected<std::unique_ptr<Announcement>, SetupError> create(
      const Scope& scope, AnnouncedService service);
  Announcement(const Announcement&) = delete;
  Announcement& operator=(const Announcement&) = delete;
  ~Announcement();

  /// Re-creates the socket if a cleaner of files removed it. Call it periodically.
  void keep();
  [[nodiscard]] AnswerCounts counts() const noexcept;

 private:
  class Impl;
  explicit Announcement(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

}  // namespace rtpm::discovery
