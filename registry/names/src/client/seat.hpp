#pragma once

#include <mutex>
#include <string>
#include <vector>

#include "client/service.hpp"
#include "rtpm/names/directory.hpp"
#include "rtpm/names/property.hpp"

namespace rtpm::names {

/// The binding that a registration offers.
struct Offer {
  std::string name{};
  std::string url{};
  std::string interface {};
  Owner owner{};
  Duration lease{};
  std::vector<Property> properties{};
};

/// A name's binding at one name service.
/// @threads  renew() and lease(): one thread; the rest: any
class Seat {
 public:
  /// The time limit of a bind.
  static constexpr Duration kDeadline = std::chrono::seconds{1};

  Seat(rpc::Node& node, const std::string& service_url);

  [[nodiscard]] expected<void, DirectoryError> bind(const Offer& offer,
                                                    bool allows_takeover = false);
  /// Renews the lease; binds again if the service no longer has the name.
  [[nodiscard]] expected<void, DirectoryError> renew(const Offer& offer);
  /// Unbinds within 200 ms; otherwise the lease expires.
  void unbind(const Offer& offer);
  /// The lease that the service grants for a renewal at `now`.
  [[nodiscard]] Duration lease(MonotonicTime now, Duration wanted);
  [[nodiscard]] const std::string& url() const noexcept { return service_.url(); }

 private:
  rpc::Node& node_;
  Service service_;
  std::mutex mutex_;  ///< Not for real-time threads. Guards the members below.
  Duration first_lease_{};
  MonotonicTime bound_{};
  std::uint64_t revision_ = 0;  ///< Revision of the bind at `bound_`.
};

}  // namespace rtpm::names
