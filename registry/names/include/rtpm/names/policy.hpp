#pragma once

#include <cstdint>
#include <string_view>

#include "rtpm/names/claim.hpp"
#include "rtpm/rpc/servant.hpp"

namespace rtpm::names {

/// What a caller asks of a registry.
enum class Operation : std::uint8_t {
  kBind,  ///< Also a rebind.
  kRenew,
  kUnbind,
  kResolve,  ///< Also describe.
  kList,     ///< Also find and watch.
  kReport,
};

/// The caller of an operation.
struct Caller {
  rpc::CallerHost host{};
  std::uint64_t session = 0;  ///< The same number, the same caller.
  Owner owner{};              ///< That it claims to be; id 0: none.
};

/// Who may do what. Identities and roles come in here.
/// @threads  the registry's lanes, one at a time
class Policy {
 public:
  Policy() = default;
  Policy(const Policy&) = delete;
  Policy& operator=(const Policy&) = delete;
  virtual ~Policy() = default;
  /// `name`: or directory; empty: all.
  [[nodiscard]] virtual bool allows(const Caller& caller, Operation operation,
                                    std::string_view name) const = 0;
};

/// Allows every operation; the rules of names still hold.
class OpenPolicy final : public Policy {
 public:
  [[nodiscard]] bool allows(const Caller&, Operation, std::string_view) const override {
    return true;
  }
};

}  // namespace rtpm::names
