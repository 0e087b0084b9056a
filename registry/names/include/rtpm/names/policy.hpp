#pragma once

#include <cstdint>
#include <string_view>

#include "rtpm/names/claim.hpp"
#include "rtpm/rpc/caller.hpp"
#include "rtpm/rpc/servant.hpp"

namespace rtpm::names {

/// An operation that a caller requests.
enum class Operation : std::uint8_t {
  kBind,  ///< Also covers rebind.
  kRenew,
  kUnbind,
  kResolve,  ///< Also covers describe.
  kList,     ///< Also covers find and watch.
  kReport,
};

/// The caller of an operation.
struct Caller {
  rpc::CallerHost host{};
  std::uint64_t session = 0;              ///< Equal for all requests of one caller.
  Owner owner{};                          ///< The owner that the caller claims to be; id 0 if none.
  const rpc::Caller* identity = nullptr;  ///< Null if callers are not authenticated.
};

/// Whether a caller may know of a name: its grants give it a role on the name, or the server does
/// not authenticate callers.
[[nodiscard]] inline bool may_see(const rpc::Caller* identity, std::string_view name) {
  return identity == nullptr || identity->role_on(name) >= Role::kObserve;
}

/// The rights of callers. Reading operations return only names that the caller may_see(),
/// regardless of the policy.
/// @threads  the registry's lanes, one at a time
class Policy {
 public:
  Policy() = default;
  Policy(const Policy&) = delete;
  Policy& operator=(const Policy&) = delete;
  virtual ~Policy() = default;
  /// `name`: a name or directory; empty for all names.
  [[nodiscard]] virtual bool allows(const Caller& caller, Operation operation,
                                    std::string_view name) const = 0;
};

/// Checks the caller's grants, if the server authenticates callers: changing a name requires the
/// role administer on it. The report requires a role on the registry's own path. The rules for
/// names still apply.
class GrantPolicy final : public Policy {
 public:
  [[nodiscard]] bool allows(const Caller& caller, Operation operation,
                            std::string_view name) const override;
};

}  // namespace rtpm::names
