#pragma once

#include <gtest/gtest.h>

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/test/process.hpp"
#include "rtpm/test/text.hpp"

/// RTPM's own programs, as tests of the whole system start them.
namespace rtpm::system_test {

using test::expect_text;

/// Long enough for a machine that is busy with other tests; no wait lasts that long if all is well.
inline constexpr Duration kPatience = std::chrono::seconds{30};

/// A variable with the folder of programs for other systems that take the place of this one's, as
/// `./dev figure3` makes it.
inline constexpr const char* kOtherSystems = "RTPM_FIGURE3";

[[nodiscard]] std::string path_of(std::string_view program);

/// A program that has announced its address.
struct Daemon {
  test::Process process;
  std::string url;
  [[nodiscard]] std::uint16_t port() const;
};

/// Starts `program` and waits until it serves. If that fails, the test fails, and so must its
/// caller. `before` is a command that runs it, for example in another network namespace.
[[nodiscard]] std::optional<Daemon> start_daemon(std::string_view program,
                                                 std::vector<std::string> arguments,
                                                 const std::vector<std::string>& before = {});

/// As above, by a whole command.
[[nodiscard]] std::optional<Daemon> start_daemon(std::vector<std::string> command);

/// Runs `program` to its end; the test fails if it does not end.
[[nodiscard]] test::Process::End run_program(std::string_view program,
                                             std::vector<std::string> arguments);

/// Checks that a program ended with `exit_code` and one sentence on standard error, which contains
/// all of `words`.
void expect_one_sentence(const test::Process::End& end, int exit_code,
                         const std::vector<std::string_view>& words);

/// A registry, and programs that use it.
class WithRegistry : public testing::Test {
 protected:
  void SetUp() override;

  /// Starts a daemon like start_daemon(); its port is free unless `options` have one.
  [[nodiscard]] std::optional<Daemon> start_server(std::string_view program,
                                                   std::vector<std::string> options = {}) const;
  /// Runs the tool `rtpm` to its end.
  [[nodiscard]] test::Process::End rtpm(std::vector<std::string> arguments) const;

  std::optional<Daemon> registry_{};
};

/// A registry and a device server with the simulated arm, bound as lab/arm0.
class Laboratory : public WithRegistry {
 protected:
  void SetUp() override;

  [[nodiscard]] test::Process::End run_servo(std::vector<std::string> arguments) const;
  /// Like run_servo(), again and again until it succeeds or patience is over; returns the last
  /// result.
  [[nodiscard]] test::Process::End run_servo_until_it_succeeds() const;
  /// Starts a force loop of `seconds` and returns when it runs. If that fails, the test fails, and
  /// so must its caller.
  [[nodiscard]] std::optional<test::Process> start_servo(int seconds) const;

  std::optional<Daemon> device_{};
};

}  // namespace rtpm::system_test
