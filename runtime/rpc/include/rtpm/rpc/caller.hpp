#pragma once

#include <memory>
#include <string_view>

#include "rtpm/access/subject.hpp"
#include "rtpm/base/role.hpp"

namespace rtpm::rpc {

/// Who calls a method, as far as it is proved, and what it may do elsewhere than at the object that
/// it calls: names, event types. Valid during the call only.
class Caller {
 public:
  Caller(const Caller&) = delete;
  Caller& operator=(const Caller&) = delete;

  [[nodiscard]] virtual const access::Subject& subject() const noexcept = 0;
  /// What its grants call it; empty: nothing.
  [[nodiscard]] virtual std::string_view name() const noexcept = 0;
  /// The greatest role that its grants allow for `path`, which need be no object of the server.
  /// @realtime alloc-free; takes a lock with priority inheritance, linear in the caller's grants
  [[nodiscard]] virtual Role role_on(std::string_view path) const noexcept = 0;
  /// The same for later: for what a method leaves behind that goes on for this caller. Good beyond
  /// the server's end. Whose grants are narrowed loses its sessions, and with them its streams.
  /// @realtime set-up only
  [[nodiscard]] virtual std::shared_ptr<const Caller> keep() const = 0;

  virtual ~Caller() = default;

 protected:
  Caller() = default;
};

}  // namespace rtpm::rpc
