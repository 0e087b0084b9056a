#include "rtpm/names/policy.hpp"

#include "rtpm/names/defaults.hpp"

namespace rtpm::names {

bool GrantPolicy::allows(const Caller& caller, Operation operation, std::string_view name) const {
  if (caller.identity == nullptr) return true;
  switch (operation) {
    case Operation::kBind:
    case Operation::kRenew:
    case Operation::kUnbind:
      return caller.identity->role_on(name) >= Role::kAdminister;
    case Operation::kReport:
      return may_see(caller.identity, kRegistryPath);
    case Operation::kResolve:
    case Operation::kList:
      break;
  }
  return true;
}

}  // namespace rtpm::names
