#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "source_tree.hpp"

/// Checks that the code and the tests follow the pages spec/hprotocol.md, spec/events.md and
/// spec/security.md: each rule with MUST is cited by its anchor where the code obeys it and where a
/// test shows that.
///
/// A citation is the anchor in a comment, such as `// hp-X-1: why`. In the code it counts in
/// protocol/, runtime/, registry/ and clients/mqtt/; as a test in tests/, and in the `rules` of a
/// vector in spec/vectors, since the tests run each vector.
namespace rtpm::spec {

using tidy::Fault;
using tidy::SourceFile;

/// One rule of the page.
struct Rule {
  std::string anchor;  ///< "hp-", "ev-" or "sec-", and the numbers of its section and rule.
  std::size_t line_index = 0;
  bool is_must = false;  ///< Has MUST or MUST NOT, and not only SHOULD or MAY.
};

/// The rules of the page, in its order.
[[nodiscard]] std::vector<Rule> rules_of(std::string_view page);

/// Finds the mismatches of the page, the code, the tests and the exemptions:
///   a MUST outside a rule with an anchor, an anchor that occurs twice;
///   a rule with MUST that no code or no test cites and that is not exempt;
///   a citation of an anchor that the page does not have;
///   an exemption without a reason, or that is not needed.
/// `files` has the pages under their paths, and the exemptions as spec/exemptions.txt: lines
/// `anchor code: reason` or `anchor test: reason`, empty lines, and comments from `#`.
[[nodiscard]] std::vector<Fault> find_uncovered(const std::vector<SourceFile>& files);

}  // namespace rtpm::spec
