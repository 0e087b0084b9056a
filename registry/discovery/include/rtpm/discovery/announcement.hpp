#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/discovery/scope.hpp"

namespace rtpm::discovery {

/// A name service that others are to find.
struct AnnouncedService {
  bool is_registry = false;
  /// The numeric addresses that it serves. One of them is announced: the first IPv4 one that the
  /// scope's interfaces have; else the first IPv4 one of a network; else the first.
  std::vector<std::string> hosts{};
  std::uint16_t port = 0;
};

/// What became of the datagrams that came from the LAN. What is malformed or suppressed is said on
/// standard error, too, a line every 10 s at most.
struct AnswerCounts {
  std::uint64_t answered = 0;
  std::uint64_t malformed = 0;     ///< No query.
  std::uint64_t other_domain = 0;  ///< Of another domain: no answer.
  std::uint64_t suppressed = 0;    ///< Beyond the limits of answers.
};

/// Lets a name service be found, for as long as this lives: on this host by a socket in the user's
/// folder, and, with a scope of the LAN and an address other than loopback, by answers to queries,
/// on a time-shared thread "rtpm-discovery". What it does is said on standard error.
/// @threads  create, keep and end from one thread; counts from any
class Announcement {
 public:
  /// @realtime set-up only
  /// @errors   as FolderSocket::create(), LanSocket::open(), multicast_interfaces()
  [[nodiscard]] static expected<std::unique_ptr<Announcement>, SetupError> create(
      const Scope& scope, AnnouncedService service);
  Announcement(const Announcement&) = delete;
  Announcement& operator=(const Announcement&) = delete;
  ~Announcement();

  /// Makes the socket again if a cleaner of files removed it. To be called now and then.
  void keep();
  [[nodiscard]] AnswerCounts counts() const noexcept;

 private:
  class Impl;
  explicit Announcement(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

}  // namespace rtpm::discovery
