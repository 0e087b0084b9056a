#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>

#include "rtpm/base/expected.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/names/defaults.hpp"
#include "rtpm/rpc/error.hpp"
#include "rtpm/rpc/node.hpp"

namespace rtpm::names {

/// Whether a registration may begin by taking its name from another server that lives.
enum class Takeover : std::uint8_t {
  kRefused,
  kAllowed,  ///< The registry reports it. Later, when another takes the name, it does not fight
             ///< back.
};

/// A name that stays bound as long as this lives. A time-shared thread named "rtpm-lease" renews
/// the lease at a third of it (at first of what the registry grants, see Granted), and binds again
/// when the registry lost the name: because it restarted, or because nobody reached it for a lease.
/// At its end it takes the name away.
///
/// A server that was killed gets its name back: at once where it serves at its old address again,
/// being a later start of the same owner (see owner_of()); else when its old lease has ended, which
/// with the default lease is within 2 s, and for which create() waits.
/// @ownership refers to its node, which must outlive it
/// @threads  create and end from one thread; is_bound() from any
class Registration {
 public:
  static constexpr Duration kDefaultLease = std::chrono::seconds{2};

  /// Takes one sentence when the name is lost (no registry, somebody else has the name) and one
  /// when it is back; called from the thread "rtpm-lease".
  using Report = std::function<void(std::string_view sentence)>;

  /// Binds `name` to the object at `url` and begins to renew.
  /// `interface` is the object's, "lab.Arm"; `lease` at least 100 ms, at most 1 h: how long the
  /// name outlives a program that is killed. `report` none: to standard error. If another server
  /// has the name, takes it where `takeover` says so; else waits once until that one's lease would
  /// end, at most 5 s: one that was killed is gone then.
  /// @realtime set-up only; blocks
  /// @errors   no registry answers; a living server has the name (the text says where); a malformed
  ///           name, URL or interface; a limit of the registry
  [[nodiscard]] static expected<std::unique_ptr<Registration>, rpc::SetupError> create(
      rpc::Node& node, std::string registry_url, std::string name, std::string url,
      std::string interface, Duration lease = kDefaultLease, Report report = {},
      Takeover takeover = Takeover::kRefused);

  Registration(const Registration&) = delete;
  Registration& operator=(const Registration&) = delete;
  /// Takes the name away, if the registry answers within 200 ms; else the lease ends by itself. A
  /// renewal that is under way is waited for, a third of the lease and 1 s at most.
  ~Registration();

  /// Whether the registry had the name when it was last asked.
  [[nodiscard]] bool is_bound() const noexcept;

 private:
  class Impl;
  explicit Registration(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

}  // namespace rtpm::names
