#pragma once

#include <chrono>
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

/// A name that stays bound as long as this lives. A time-shared thread named "rtpm-lease" renews
/// the lease at a third of it, and binds again when the registry lost the name: because it
/// restarted, or because nobody reached it for a lease. At its end it takes the name away.
/// Ownership: refers to its node, which must outlive it.
/// Threads: create and end from one thread; is_bound() from any.
class Registration {
 public:
  /// Takes one sentence when the name is lost (no registry, somebody else has the name) and one
  /// when it is back; called from the thread "rtpm-lease".
  using Report = std::function<void(std::string_view sentence)>;

  /// Binds `name` to the object at `url` and begins to renew.
  /// `interface` is the object's, "lab.Arm"; `lease` at least 100 ms, at most 1 h: how long the
  /// name outlives a program that is killed. `report` none: to standard error. If another start of
  /// a server has the name, waits once until its lease would end, at most 5 s: one that was killed
  /// is gone then.   Set-up only; blocks. Errors: no registry answers; a living server has the name
  /// (the text says where); a malformed name, URL or interface; a limit of the registry.
  [[nodiscard]] static expected<std::unique_ptr<Registration>, rpc::SetupError> create(
      rpc::Node& node, std::string registry_url, std::string name, std::string url,
      std::string interface, Duration lease = std::chrono::seconds{2}, Report report = {});

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
