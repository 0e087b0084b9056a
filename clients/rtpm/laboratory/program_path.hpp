#pragma once

#include <string>
#include <vector>

#include "rtpm/base/expected.hpp"

namespace rtpm::laboratory {

/// The folders that are searched for programs.
struct ProgramFolders {
  std::string own{};                ///< The folder of `rtpm`.
  std::vector<std::string> path{};  ///< The folders of PATH.

  /// This process's folders.
  [[nodiscard]] static ProgramFolders of_this_process();

  /// Finds an executable: beside `rtpm`, otherwise in PATH. A name with a slash is a file's path,
  /// relative to `folder`.
  /// @errors   the places that were searched, as a clause
  [[nodiscard]] expected<std::string, std::string> find(const std::string& name,
                                                        const std::string& folder) const;
};

/// The path of `name` among RTPM's installed files; empty if it is not installed.
[[nodiscard]] std::string shipped_file(const ProgramFolders& folders, const std::string& name);

}  // namespace rtpm::laboratory
