#pragma once

#include <vector>

#include "source_tree.hpp"

namespace rtpm::tidy {

/// Finds identifiers and file names that use a home-made word where the field has a term. Comments
/// and texts are not read.
[[nodiscard]] std::vector<Fault> find_home_made_words(const std::vector<SourceFile>& files);

/// Finds sentences of comments that begin with "What", "Of" or "Who": they name no subject.
[[nodiscard]] std::vector<Fault> find_comments_without_subject(
    const std::vector<SourceFile>& files);

}  // namespace rtpm::tidy
