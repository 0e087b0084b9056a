#pragma once

#include <array>
#include <memory>
#include <optional>
#include <utility>

#include "rtpm/rpc/caller.hpp"
#include "security/access_control.hpp"

namespace rtpm::rpc {

/// The caller of one call of a secured server, on the stack of the thread that runs it.
/// @realtime alloc-free
class CallerIdentity final : public Caller {
 public:
  CallerIdentity(const AccessControl& control, const CallOrigin& origin) noexcept
      : control_(control), origin_(origin) {}

  [[nodiscard]] const access::Subject& subject() const noexcept override { return origin_.subject; }
  [[nodiscard]] std::string_view name() const noexcept override {
    if (!name_) name_ = control_.name_of(origin_, name_room_);
    return *name_;
  }
  [[nodiscard]] Role role_on(std::string_view path) const noexcept override {
    return control_.permission(origin_, path).role;
  }
  [[nodiscard]] std::shared_ptr<const Caller> keep() const override;

 private:
  const AccessControl& control_;
  const CallOrigin& origin_;
  mutable std::optional<std::string_view> name_{};  ///< Looked up when it is asked for.
  mutable std::array<char, 64> name_room_;
};

/// A caller that outlives its call.
class KeptCaller final : public Caller {
 public:
  KeptCaller(std::shared_ptr<const AccessControl> control, const CallOrigin& origin)
      : control_(std::move(control)), origin_(origin), identity_(*control_, origin_) {}

  [[nodiscard]] const access::Subject& subject() const noexcept override {
    return identity_.subject();
  }
  [[nodiscard]] std::string_view name() const noexcept override { return identity_.name(); }
  [[nodiscard]] Role role_on(std::string_view path) const noexcept override {
    return identity_.role_on(path);
  }
  [[nodiscard]] std::shared_ptr<const Caller> keep() const override {
    return std::make_shared<const KeptCaller>(control_, origin_);
  }

 private:
  const std::shared_ptr<const AccessControl> control_;
  const CallOrigin origin_;
  const CallerIdentity identity_;
};

inline std::shared_ptr<const Caller> CallerIdentity::keep() const {
  return std::make_shared<const KeptCaller>(control_.shared_from_this(), origin_);
}

}  // namespace rtpm::rpc
