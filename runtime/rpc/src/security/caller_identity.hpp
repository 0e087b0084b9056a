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
  mutable std::optional<std::string_view> name_{};  ///< Looked up on first use.
  mutable std::array<char, 64> name_room_;
};

inline std::shared_ptr<const Caller> CallerIdentity::keep() const {
  struct Kept {
    Kept(std::shared_ptr<const AccessControl> its_control, const CallOrigin& its_origin)
        : control(std::move(its_control)), origin(its_origin), identity(*control, origin) {}
    const std::shared_ptr<const AccessControl> control;
    const CallOrigin origin;
    const CallerIdentity identity;
  };
  const auto kept = std::make_shared<const Kept>(control_.shared_from_this(), origin_);
  return {kept, &kept->identity};
}

}  // namespace rtpm::rpc
