#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "rtpm/driver/driver.hpp"

namespace rtpm::test {

/// Runs a driver in cycles of a millisecond, and its calibrations through its interface.
class Cycles {
 public:
  /// Configures and activates `driver`.
  explicit Cycles(driver::Driver& driver) : driver_(driver) {
    EXPECT_TRUE(driver.configure({.period = std::chrono::milliseconds{1}}));
    EXPECT_TRUE(driver.activate());
  }

  const driver::Sample& run(int cycle_count, const driver::Setpoint& setpoint = {}) {
    for (int i = 0; i < cycle_count; ++i) {
      driver::Command command;
      static_cast<driver::Setpoint&>(command) = setpoint;
      command.cycle_time = now_ += std::chrono::milliseconds{1};
      sample_.faults = {};
      EXPECT_EQ(driver_.exchange(command, sample_), driver::ExchangeStatus::kOk);
    }
    return sample_;
  }

  /// The operator's action at a prompt, before the answer: moves the device, or looks somewhere.
  using Act = std::function<void(int prompt)>;
  struct End {
    driver::CalibrationState state{};
    int prompt_count = 0;
  };
  /// Plays the calibration `name` to its end, or until `prompt_max` prompts have appeared; gives
  /// each prompt its first answer.
  End calibrate(std::string_view name, const Act& act = {}, int prompt_max = 100) {
    const auto calibration = driver_.make_calibration(name);
    EXPECT_NE(calibration, nullptr);
    End end;
    std::optional<std::string> answer;
    for (int i = 0; i < 10'000; ++i) {
      end.state = calibration->step(run(1), std::exchange(answer, std::nullopt));
      if (const auto* prompt = std::get_if<driver::CalibrationPrompt>(&end.state)) {
        if (++end.prompt_count == prompt_max) return end;
        if (act) {
          calibrating_ = calibration.get();
          act(end.prompt_count);
        }
        answer = prompt->answers.at(0);
      } else if (!std::holds_alternative<driver::CalibrationRunning>(end.state)) {
        return end;
      }
    }
    ADD_FAILURE() << "the calibration does not end";
    return end;
  }
  /// Moves the device within an Act, so that the calibration sees the samples.
  void move(int cycle_count, const driver::Setpoint& setpoint) {
    for (int i = 0; i < cycle_count; ++i) {
      static_cast<void>(calibrating_->step(run(1, setpoint), std::nullopt));
    }
  }

 private:
  driver::Driver& driver_;
  driver::Sample sample_{};
  MonotonicTime now_{std::chrono::seconds{100}};
  driver::Calibration* calibrating_ = nullptr;
};

/// The result of a finished calibration; the test fails if it is not finished.
inline std::vector<driver::ParameterSetting> result_of(const Cycles::End& end) {
  if (const auto* done = std::get_if<driver::CalibrationDone>(&end.state)) return done->settings;
  const auto* failed = std::get_if<driver::CalibrationFailed>(&end.state);
  ADD_FAILURE() << "no result: " << (failed != nullptr ? failed->reason : "not over");
  return {};
}

/// Checks that a calibration failed with a message that contains `part`.
inline void expect_failure(const Cycles::End& end, std::string_view part) {
  const auto* failed = std::get_if<driver::CalibrationFailed>(&end.state);
  ASSERT_NE(failed, nullptr) << "it did not fail";
  EXPECT_NE(failed->reason.find(part), std::string::npos) << failed->reason;
}

}  // namespace rtpm::test
