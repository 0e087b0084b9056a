#pragma once

#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "programs.hpp"

namespace rtpm::system_test {

using Json = nlohmann::json;

/// The devices of the laboratory.
inline constexpr std::array kDevices{"lab/arm0", "lab/gaze0", "lab/biometric0", "lab/knob0"};

/// A source folder of Lichtblick, from RTPM_LICHTBLICK; empty if there is none.
[[nodiscard]] std::string lichtblick_folder();

/// A simulated laboratory (arm, gaze tracker, biometric sensor, knob) in which a force loop touches a
/// wall by the arm, and the programs that show it.
class ViewedLaboratory : public testing::Test {
 protected:
  void SetUp() override;
  void TearDown() override;
  /// Records `seconds`, of which the force loop runs about the first three quarters; the file's path,
  /// empty if the test failed.
  [[nodiscard]] std::string record(int seconds);
  /// Starts a console; its WebSocket's URL, empty if the test failed.
  [[nodiscard]] std::string start_console();

  /// A channel as a viewer sees it: "topic", "encoding", "schema", "refusal" where the viewer refuses
  /// it, "messages" with "log_time_ns" and "value".
  using Channels = std::map<std::string, Json>;
  /// Runs a script of the folder peer, and takes its list of channels.
  [[nodiscard]] static Channels view(const std::string& words);

 private:
  std::string folder_{};
  std::optional<Daemon> registry_{};
  std::optional<Daemon> devices_{};
  std::optional<test::Process> servo_{};  ///< Its wall is a model in the arm's own loop.
  std::optional<test::Process> console_{};
};

/// A number of JSON, which is a text beyond 2^53.
[[nodiscard]] std::uint64_t whole(const Json& number);

/// Asserts that no channel was refused, and that each has messages.
void expect_opened(const std::map<std::string, Json>& channels);
/// Asserts that poses, transforms and forces are those of the samples with the same time.
/// @param sample_leaf  the end of the samples' topics
void expect_drawn_as_sampled(const std::map<std::string, Json>& channels,
                             const std::string& sample_leaf);

/// Asserts that the scenes of the arm show its wall until the force loop ended.
void expect_wall_until_end(const std::map<std::string, Json>& channels);

/// Asserts that the panels of the layout that RTPM ships show something of these channels.
/// @param sample_leaf  as above; paths with the other end are of the other source
void expect_laid_out(const std::map<std::string, Json>& channels, const std::string& sample_leaf);

}  // namespace rtpm::system_test
