#pragma once

#include <functional>
#include <set>
#include <string>

#include "rtpm/predicate/predicate.hpp"

namespace rtpm::names {

struct Record;

/// Which names a watch is about; all conditions that are given must hold.
struct WatchFilter {
  std::string directory{};                     ///< Empty: any.
  std::set<std::string, std::less<>> names{};  ///< Empty: any.
  std::string interface {};                    ///< Empty: any.
  predicate::Predicate predicate;

  [[nodiscard]] bool accepts(const Record& record) const;
};

}  // namespace rtpm::names
