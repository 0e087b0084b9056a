#pragma once

#include <functional>
#include <memory>
#include <set>
#include <string>

#include "rtpm/predicate/predicate.hpp"
#include "rtpm/rpc/caller.hpp"

namespace rtpm::names {

struct Record;

/// Selects the names of a watch: those that meet all given conditions.
struct WatchFilter {
  std::string directory{};                     ///< Any if empty.
  std::set<std::string, std::less<>> names{};  ///< Any if empty.
  std::string interface {};                    ///< Any if empty.
  predicate::Predicate predicate;
  /// The caller must be allowed to see the name; null disables the check.
  std::shared_ptr<const rpc::Caller> caller{};

  [[nodiscard]] bool accepts(const Record& record) const;
};

}  // namespace rtpm::names
