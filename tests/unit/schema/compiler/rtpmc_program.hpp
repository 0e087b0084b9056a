#pragma once

#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include "scratch_folder.hpp"

/// Runs rtpmc as a program.
namespace rtpm::schema::test {

struct Outcome {
  int exit_code = -1;
  std::string output{};
  std::string errors{};
};

[[nodiscard]] inline std::string quoted(const std::string& text) {
  return '\'' + text + '\'';
}

/// Runs rtpmc in `folder` with `arguments`, which a shell parses.
[[nodiscard]] inline Outcome run(const ScratchFolder& folder, const std::string& arguments) {
  const std::string output = (folder.path() / "stdout.txt").string();
  const std::string errors = (folder.path() / "stderr.txt").string();
  const int status =
      std::system(("cd " + quoted(folder.path().string()) + " && " + quoted(RTPM_RTPMC) + ' ' +
                   arguments + " > " + quoted(output) + " 2> " + quoted(errors))
                      .c_str());
  Outcome result{WIFEXITED(status) ? WEXITSTATUS(status) : -1, read_file(output),
                 read_file(errors)};
  std::filesystem::remove(output);
  std::filesystem::remove(errors);
  return result;
}

[[nodiscard]] inline std::string idl_flag() {
  return "-I " + quoted(RTPM_IDL_FOLDER) + ' ';
}

[[nodiscard]] inline std::vector<std::string> names_in(const std::filesystem::path& folder) {
  std::vector<std::string> names;
  if (!std::filesystem::exists(folder)) return names;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    names.push_back(entry.path().filename().string());
  }
  return names;
}

/// Compiles arm.fbs to arm.bfbs with flatc.
inline void make_binary(const ScratchFolder& folder,
                        const std::string& flags = "--bfbs-filenames .") {
  const std::string command = "cd " + quoted(folder.path().string()) + " && " + quoted(RTPM_FLATC) +
                              " -b --schema --bfbs-comments --bfbs-builtins " + flags + " -I " +
                              quoted(RTPM_IDL_FOLDER) + " arm.fbs";
  ASSERT_EQ(std::system(command.c_str()), 0);
}

}  // namespace rtpm::schema::test
