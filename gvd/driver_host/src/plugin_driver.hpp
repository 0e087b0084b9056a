#pragma once

#include <memory>
#include <string>
#include <vector>

#include "facts.hpp"
#include "os/library.hpp"
#include "rtpm/driver/driver.hpp"
#include "rtpm/rt/crash.hpp"

namespace rtpm::driver_host {

/// Passes calls on to a plug-in's driver, and turns its exceptions into errors. The driver's
/// constant properties were read once, when it was loaded.
/// @ownership keeps its library loaded, as each of its calibrations does
class PluginDriver final : public driver::Driver {
 public:
  /// @param note  for rt::CrashNote
  PluginDriver(std::string file, std::string note, std::shared_ptr<const Library> library,
               std::unique_ptr<Driver> driver, Facts facts) noexcept;
  ~PluginDriver() override;

  [[nodiscard]] driver::Descriptor describe() const override { return facts_.descriptor; }
  [[nodiscard]] expected<void, SetupError> configure(const driver::DriverConfig& config) override;
  [[nodiscard]] expected<void, SetupError> activate() override;
  [[nodiscard]] driver::ExchangeStatus exchange(const driver::Command& command,
                                                driver::Sample& sample) noexcept override {
    const rt::CrashNote note(note_.c_str());
    const rt::CrashNote place("exchange()");
    return driver_->exchange(command, sample);
  }
  void deactivate() noexcept override {
    const rt::CrashNote note(note_.c_str());
    const rt::CrashNote place("deactivate()");
    driver_->deactivate();
  }
  [[nodiscard]] std::vector<driver::ParameterSpec> parameters() const override {
    return facts_.parameters;
  }
  [[nodiscard]] expected<void, SetupError> set_parameters(
      std::span<driver::ParameterSetting> settings) override;
  [[nodiscard]] std::vector<driver::CalibrationInfo> calibrations() const override {
    return facts_.calibrations;
  }
  [[nodiscard]] std::unique_ptr<driver::Calibration> make_calibration(
      std::string_view name) override;

 private:
  /// Calls into the plug-in, turns an exception into an error, and leaves a note for crash reports.
  template <class Call>
  [[nodiscard]] auto guarded_call(const char* place, Call&& call);

  std::string file_;
  std::string note_;
  std::shared_ptr<const Library> library_;  // Outlives its driver.
  std::unique_ptr<Driver> driver_;
  Facts facts_;
};

}  // namespace rtpm::driver_host
