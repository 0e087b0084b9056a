#pragma once

#include <memory>
#include <mutex>
#include <string>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/discovery/announcement.hpp"
#include "rtpm/discovery/scope.hpp"
#include "rtpm/names/claim.hpp"
#include "rtpm/rpc/servant.hpp"
#include "rtpm/rpc/server.hpp"

namespace rtpm::names {

/// The name service of a program that serves its names itself: an in-memory registry, in which only
/// this program binds, on its own server with one blocking, time-shared lane. The program's
/// registrations share it; it is discoverable while one of them uses it.
/// @threads  any
class OwnNames {
 public:
  /// This program's name service at the host of `url`, or at the loopback address if this host does
  /// not have that address.
  /// @param security  the clients that it accepts; used if the service does not exist yet
  /// @realtime set-up only
  /// @errors   those of rpc::Server::create() and discovery::Announcement::create()
  [[nodiscard]] static expected<std::shared_ptr<OwnNames>, SetupError> at_host_of(
      const discovery::Scope& scope, const std::string& url, const rpc::ServerSecurity& security);

  OwnNames(const OwnNames&) = delete;
  OwnNames& operator=(const OwnNames&) = delete;
  ~OwnNames();

  [[nodiscard]] std::string url() const;
  /// See discovery::Announcement::keep().
  void keep();

 private:
  OwnNames() = default;
  [[nodiscard]] expected<void, SetupError> begin(const discovery::Scope& scope, std::string host,
                                                 const rpc::ServerSecurity& security);

  std::unique_ptr<rpc::Servant> names_{};
  std::unique_ptr<rpc::Server> server_{};
  std::mutex keeping_{};
  std::unique_ptr<discovery::Announcement> announcement_{};
};

}  // namespace rtpm::names
