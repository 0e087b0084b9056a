#pragma once

#include <string>
#include <vector>

#include "rtpm/base/expected.hpp"

namespace rtpm::laboratory {

/// Where programs are looked for.
struct ProgramFolders {
  std::string own{};                ///< Where `rtpm` is.
  std::vector<std::string> path{};  ///< Those of PATH.

  /// Those of this process.
  [[nodiscard]] static ProgramFolders of_this_process();

  /// The executable of that name: beside `rtpm`, else in PATH. A name with a slash is a file's,
  /// relative to `folder`.
  /// @errors   where it was looked for, as a clause
  [[nodiscard]] expected<std::string, std::string> find(const std::string& name,
                                                        const std::string& folder) const;
};

/// The file `name` among those that come with RTPM; empty: it is not installed.
[[nodiscard]] std::string shipped_file(const ProgramFolders& folders, const std::string& name);

}  // namespace rtpm::laboratory
