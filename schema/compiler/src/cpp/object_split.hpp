#pragma once

#include <string>
#include <string_view>

namespace rtpm::schema {

struct SplitHeader {
  std::string header{};
  std::string source{};  ///< The moved bodies, to be compiled once.
};

/// Moves the bodies of the object API (copies of `RequestT`, Pack(), UnPack()) out of flatc's
/// header: compiling them takes most of the header's time, and few sources use them. Leaves unknown
/// code in place.
/// @param name  the header's name, for the source's #include
[[nodiscard]] SplitHeader split_objects(std::string_view text, std::string_view name);

}  // namespace rtpm::schema
