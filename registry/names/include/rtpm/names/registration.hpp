#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/names/defaults.hpp"
#include "rtpm/names/property.hpp"
#include "rtpm/rpc/error.hpp"
#include "rtpm/rpc/node.hpp"

namespace rtpm::names {

/// Whether a registration may take its name from a live server.
enum class Takeover : std::uint8_t {
  kRefused,
  kAllowed,  ///< Only in create(), not when the name is lost later.
};

/// Keeps a name bound while it lives. A time-shared thread "rtpm-lease" renews after a third of the
/// granted lease, and binds again if the registry restarted or was unreachable for longer than the
/// lease.
///
/// Without a registry's URL it looks for this host's registry at each renewal. While none runs, or
/// the one that runs is not trusted or is full, the program serves its names itself; on the LAN it
/// always does. When a registry appears, the name moves there within a third of its lease, and the
/// program serves it for one more second.
///
/// After a crash, a server at its old address regains its name at once (see owner_of()). At another
/// address, create() waits for the old lease to end, by default 2 s.
/// @ownership refers to its node, which must outlive it
/// @threads  create and destroy on one thread; is_bound(): any
class Registration {
 public:
  static constexpr Duration kDefaultLease = std::chrono::seconds{2};

  /// Receives a sentence when the name is lost and when it is bound again, on the thread
  /// "rtpm-lease".
  using Report = std::function<void(std::string_view sentence)>;

  /// Binds `name` to the object at `url`, where Directory would look for it, and starts renewing.
  /// If another server holds the name, takes it with Takeover::kAllowed; otherwise waits once, at
  /// most 5 s, for its lease to end. `interface` is qualified, such as "lab.Arm"; `lease` is 100 ms
  /// to 1 h; an empty `report` writes to standard error. If a registry is full or cannot change its
  /// storage, that is not an error: it is reported and retried.
  /// @realtime set-up only; blocks
  /// @errors   with a registry's URL, it does not answer; a live server holds the name (the text
  ///           tells where); a malformed name, URL or interface
  [[nodiscard]] static expected<std::unique_ptr<Registration>, SetupError> create(
      rpc::Node& node, std::string where, std::string name, std::string url, std::string interface,
      Duration lease = kDefaultLease, Report report = {}, Takeover takeover = Takeover::kRefused,
      std::vector<Property> properties = {});

  Registration(const Registration&) = delete;
  Registration& operator=(const Registration&) = delete;
  /// Unbinds the name if the registry answers within 200 ms; otherwise the lease expires. Waits for
  /// a renewal in progress, at most a third of the lease and 1 s.
  ~Registration();

  /// Replaces the properties, for this and later binds; blocks at most 1 s.
  /// @threads  any
  /// @errors   a malformed property, a limit of the registry: the previous ones stay in force; the
  ///           registry does not answer: then the next bind sets them
  [[nodiscard]] expected<void, SetupError> set_properties(std::vector<Property> properties);

  /// Whether the name was bound at the last renewal.
  [[nodiscard]] bool is_bound() const noexcept;

 private:
  class Impl;
  explicit Registration(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

}  // namespace rtpm::names
