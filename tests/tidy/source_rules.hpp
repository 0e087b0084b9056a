#pragma once

#include <string_view>
#include <vector>

#include "source_tree.hpp"

namespace rtpm::tidy {

/// A file that may break a rule, with the reason; one that no longer breaks it is itself a fault.
struct Exemption {
  std::string_view rule;
  std::string_view path;
  std::string_view reason;
};

/// The exemptions that the tree has today.
[[nodiscard]] const std::vector<Exemption>& exemptions();

/// Finds words that are forbidden at their place: those that block, throw or print on real-time
/// paths, deferred work, paths of one machine.
[[nodiscard]] std::vector<Fault> find_banned_words(const std::vector<SourceFile>& files,
                                                   const std::vector<Exemption>& excused);

/// Finds headers without `#pragma once` or with `using namespace`, files that grew past 800 lines,
/// sources that no CMakeLists.txt names, and folders that none adds.
[[nodiscard]] std::vector<Fault> find_misshapen_files(const std::vector<SourceFile>& files);

/// Finds tests whose body asserts nothing.
[[nodiscard]] std::vector<Fault> find_empty_tests(const std::vector<SourceFile>& files);

}  // namespace rtpm::tidy
