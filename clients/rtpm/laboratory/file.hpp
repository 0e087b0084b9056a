#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "laboratory/document.hpp"
#include "laboratory/plan.hpp"
#include "laboratory/program_path.hpp"
#include "rtpm/base/setup_error.hpp"

namespace rtpm::laboratory {

inline constexpr std::size_t kFileSizeMax = std::size_t{1024} * 1024;
inline constexpr std::size_t kProgramCountMax = 64;

/// The surroundings of a laboratory's file.
struct FileContext {
  ProgramFolders folders{};
  std::map<std::string, std::string> variables{};  ///< Replace those in the file.
};

/// Parses the text of the file at `path`; relative paths in it refer to that file's folder.
/// @errors   every mistake, in the order of the file
/// @realtime set-up only
[[nodiscard]] expected<Plan, std::vector<Mistake>> parse_plan(std::string_view text,
                                                              const std::string& path,
                                                              const FileContext& context);

/// Reads a file and parses it with parse_plan().
/// @errors   "cell.toml:3:8: …", one for each mistake; the file can't be read
[[nodiscard]] expected<Plan, std::vector<SetupError>> read_plan(const std::string& path,
                                                                const FileContext& context);

/// Whether a laboratory or a program may have this name: letters, digits, '-', '_' and '.'; a
/// letter or digit first; at most 32 characters.
[[nodiscard]] bool is_name(std::string_view name);

}  // namespace rtpm::laboratory
