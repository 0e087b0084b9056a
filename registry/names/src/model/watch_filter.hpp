#pragma once

#include <functional>
#include <memory>
#include <set>
#include <string>

#include "rtpm/predicate/predicate.hpp"
#include "rtpm/rpc/caller.hpp"

namespace rtpm::names {

struct Record;

/// The names that a watch selects; they meet all conditions that are given.
struct WatchFilter {
  std::string directory{};                     ///< Any if empty.
  std::set<std::string, std::less<>> names{};  ///< Any if empty.
  std::string interface {};                    ///< Any if empty.
  predicate::Predicate predicate;
  /// Its grants must let it see the name; null disables the check.
  std::shared_ptr<const rpc::Caller> caller{};

  [[nodiscard]] bool accepts(const Record& record) const;
};

}  // namespace rtpm::names
