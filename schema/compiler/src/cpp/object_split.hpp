#pragma once

#include <string>
#include <string_view>

namespace rtpm::schema {

/// flatc's header of data types in two parts.
struct SplitHeader {
  std::string header{};  ///< Without what moved.
  std::string source{};  ///< What moved, to be compiled once.
};

/// Moves the bodies of flatc's object API (copies of `RequestT`, Pack(), UnPack()) out of its
/// header `name`: they are most of the time that a compiler takes to read it, and are used in few
/// places. What is not in flatc's known form stays where it is.
[[nodiscard]] SplitHeader split_objects(std::string_view text, std::string_view name);

}  // namespace rtpm::schema
