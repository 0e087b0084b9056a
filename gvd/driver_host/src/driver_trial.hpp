#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "rtpm/driver_host/check.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::driver_host {

/// The run of one check: the driver, its newest sample, and the breaches found.
class DriverTrial {
 public:
  static constexpr std::size_t kFaultCountMax = 10;

  DriverTrial(DriverMaker& maker, Duration cycle_period, CheckPace pace)
      : period(cycle_period),
        maker_(maker),
        pace_(pace),
        now_(pace == CheckPace::kReal ? rt::now() : MonotonicTime{std::chrono::seconds{1000}}) {
    renew();
  }

  /// Replaces the driver by a new one.
  bool renew();
  /// Configures and activates the driver.
  bool start();
  driver::ExchangeStatus exchange(const driver::Setpoint& setpoint);
  driver::ExchangeStatus exchange(driver::CommandMode mode, const driver::Wrench& wrench = {});
  /// Records `fault` if `holds` is false, and returns `holds`.
  bool expect(bool holds, const std::string& fault);
  /// Records an exchange() that is not kOk.
  bool expect_ok(driver::ExchangeStatus status);
  /// Lets time pass without an exchange().
  void pass(Duration time) { now_ += time; }
  [[nodiscard]] MonotonicTime now() const noexcept { return now_; }
  [[nodiscard]] std::vector<std::string> take_faults() { return std::move(faults_); }
  [[nodiscard]] bool is_simulated() const noexcept { return pace_ == CheckPace::kSimulated; }
  [[nodiscard]] bool is_over() const noexcept { return faults_.size() >= kFaultCountMax; }

  const Duration period;
  std::unique_ptr<driver::Driver> driver{};
  driver::Sample sample{};

 private:
  DriverMaker& maker_;
  CheckPace pace_;
  MonotonicTime now_;
  std::uint64_t sequence_ = 0;
  std::vector<std::string> faults_{};
};

// Defined in configuration_checks.cpp.
void describes_each_parameter(DriverTrial& trial);
void takes_parameters_in_every_state(DriverTrial& trial);
void calibrations_end_with_values_or_words(DriverTrial& trial);
void calibrations_outlive_their_driver(DriverTrial& trial);

}  // namespace rtpm::driver_host
