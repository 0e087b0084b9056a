#pragma once

#include <memory>
#include <string_view>

#include "rtpm/access/subject.hpp"
#include "rtpm/base/role.hpp"

namespace rtpm::rpc {

/// The caller of a method, as authenticated, and its rights beyond the called object: on names and
/// event types. Valid during the call only.
class Caller {
 public:
  Caller(const Caller&) = delete;
  Caller& operator=(const Caller&) = delete;

  [[nodiscard]] virtual const access::Subject& subject() const noexcept = 0;
  /// The caller's name in the grants; empty if they give none.
  [[nodiscard]] virtual std::string_view name() const noexcept = 0;
  /// The highest role that the grants allow on `path`, which need not be an object of the server.
  /// @realtime alloc-free; takes a lock with priority inheritance, linear in the caller's grants
  [[nodiscard]] virtual Role role_on(std::string_view path) const noexcept = 0;
  /// A copy for work that continues for this caller after the method returns. Outlives the server.
  /// When a caller's grants are narrowed, it loses its sessions and their streams.
  /// @realtime set-up only
  [[nodiscard]] virtual std::shared_ptr<const Caller> keep() const = 0;

  virtual ~Caller() = default;

 protected:
  Caller() = default;
};

}  // namespace rtpm::rpc
