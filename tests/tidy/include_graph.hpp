#pragma once

#include <vector>

#include "source_tree.hpp"

namespace rtpm::tidy {

/// Finds every include in `files` that the layers forbid: one of a part above or beside, one of a
/// library that belongs to other parts, one of the operating system outside the parts that may know
/// it, one of another part's private header, and one of a sub-folder above in the same part.
[[nodiscard]] std::vector<Fault> find_forbidden_includes(const std::vector<SourceFile>& files);

}  // namespace rtpm::tidy
