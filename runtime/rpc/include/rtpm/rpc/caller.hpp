#pragma once

#include <memory>
#include <string_view>

#include "rtpm/access/subject.hpp"
#include "rtpm/base/role.hpp"

namespace rtpm::rpc {

/// The caller of a method, as far as it is proved, and its rights elsewhere than at the object that
/// it calls: on names and event types. Valid during the call only.
class Caller {
 public:
  Caller(const Caller&) = delete;
  Caller& operator=(const Caller&) = delete;

  [[nodiscard]] virtual const access::Subject& subject() const noexcept = 0;
  /// The name that its grants give it; empty if they give none.
  [[nodiscard]] virtual std::string_view name() const noexcept = 0;
  /// The greatest role that its grants allow for `path`, which need not be an object of the server.
  /// @realtime alloc-free; takes a lock with priority inheritance, linear in the caller's grants
  [[nodiscard]] virtual Role role_on(std::string_view path) const noexcept = 0;
  /// A copy for work that goes on for this caller after the method. Valid beyond the server's end.
  /// A caller whose grants are narrowed loses its sessions, and with them its streams.
  /// @realtime set-up only
  [[nodiscard]] virtual std::shared_ptr<const Caller> keep() const = 0;

  virtual ~Caller() = default;

 protected:
  Caller() = default;
};

}  // namespace rtpm::rpc
