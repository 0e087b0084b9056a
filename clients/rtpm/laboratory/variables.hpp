#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "laboratory/plan.hpp"
#include "rtpm/base/expected.hpp"

namespace rtpm::laboratory {

/// The names that `${…}` may use in a laboratory's file.
struct Scope {
  std::map<std::string, std::string> variables{};
  std::vector<std::string> programs{};  ///< ${NAME.url}, in the order of the file.
};

/// `text` with its variables replaced: ${NAME}, ${environment.NAME}, ${PROGRAM.url}. $$ is one $.
/// @errors   the mistake, as a clause
[[nodiscard]] expected<Text, std::string> expand(std::string_view text, const Scope& scope);

}  // namespace rtpm::laboratory
