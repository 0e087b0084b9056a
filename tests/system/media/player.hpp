#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <optional>
#include <string>

#include "rtpm/device_mpv/protocol.hpp"
#include "rtpm/device_mpv/transport.hpp"
#include "rtpm/test/process.hpp"

/// The real mpv, and its own report of its position.
namespace rtpm::system_test {

/// The path of mpv; empty if it is not installed.
[[nodiscard]] std::string mpv_path();

/// The test's own connection to mpv.
class Observer {
 public:
  explicit Observer(std::unique_ptr<device_mpv::Transport> transport)
      : transport_(std::move(transport)) {}

  /// mpv's answer; the test fails without one.
  device_mpv::Reply ask(std::string_view command, std::initializer_list<device_mpv::Word> words);
  /// The position of the picture that mpv shows; nullopt while it seeks.
  [[nodiscard]] std::optional<double> shown_s();
  /// Waits until mpv shows `position_s`; false if it never does.
  [[nodiscard]] bool await_shown(double position_s);

 private:
  std::unique_ptr<device_mpv::Transport> transport_;
  device_mpv::LineCutter cutter_{};
  std::int64_t id_ = 0;
};

/// A clip, and an mpv that plays it and listens at a socket; skipped without mpv.
class WithMpv : public testing::Test {
 protected:
  static constexpr double kFrameSeconds = 0.04;

  void SetUp() override;
  void TearDown() override;
  void start_mpv();
  [[nodiscard]] Observer observe() const;

  std::string clip_{};
  std::string socket_{};
  std::optional<test::Process> mpv_{};
};

}  // namespace rtpm::system_test
