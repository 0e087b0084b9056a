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
  std::string directory{};                     ///< Empty: any.
  std::set<std::string, std::less<>> names{};  ///< Empty: any.
  std::string interface {};                    ///< Empty: any.
  predicate::Predicate predicate;
  /// Its grants must let it see the name; null: no check.
  std::shared_ptr<const rpc::Caller> caller{};

  [[nodiscard]] bool accepts(const Record& record) const;
};

}  // namespace rtpm::names
