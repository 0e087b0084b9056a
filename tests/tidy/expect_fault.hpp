#pragma once

#include <gtest/gtest.h>

#include <string_view>
#include <vector>

#include "source_tree.hpp"

namespace rtpm::tidy {

inline void expect_no_fault(const std::vector<Fault>& faults) {
  for (const Fault& fault : faults)
    ADD_FAILURE() << fault;
}

/// Fails the test unless one of `faults` begins with `begin` and contains `word`.
inline void expect_fault(const std::vector<Fault>& faults, std::string_view begin,
                         std::string_view word) {
  for (const Fault& fault : faults) {
    if (fault.starts_with(begin) && fault.find(word) != std::string::npos) return;
  }
  ADD_FAILURE() << "no fault begins with '" << begin << "' and says '" << word << "', of "
                << faults.size() << (faults.empty() ? "" : "; the first: " + faults.front());
}

}  // namespace rtpm::tidy
