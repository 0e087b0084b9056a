#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "rtpm/test/process.hpp"

/// Code of others, packages from npm, for tests that rtpm_npm_peer() of CMake gives a peer's folder.
namespace rtpm::test {

/// Runs a command of the shell for at most two minutes.
inline Process::End run_shell(const std::string& command) {
  const auto end = Process({"/bin/sh", "-c", command}).wait(std::chrono::minutes{2});
  EXPECT_TRUE(end) << command;
  return end.value_or(Process::End{});
}

/// Installs the peer in the build folder, once; returns whether it is installed.
inline bool install_peer() {
  const std::string folder = RTPM_PEER;
  // The installation is completed in this process's own folder, because tests run at the same time.
  const std::string own = folder + "." + std::to_string(::getpid());
  if (!std::filesystem::exists(folder)) {
    static_cast<void>(run_shell("cp -r '" RTPM_PEER_SOURCE "' '" + own + "' && cd '" + own +
                                "' && npm install --silent --no-audit --no-fund && mv -T '" + own +
                                "' '" + folder + "'"));
    std::filesystem::remove_all(own);
  }
  return std::filesystem::exists(folder);
}

/// The JSON that a script of the peer prints; discarded if it prints none.
/// @param words  "read.mjs FILE"
inline nlohmann::json run_peer(const std::string& words) {
  const auto end = run_shell("cd '" RTPM_PEER "' && node " + words);
  EXPECT_EQ(end.exit_code, 0) << end.errors;
  return nlohmann::json::parse(end.output, nullptr, false);
}

}  // namespace rtpm::test
