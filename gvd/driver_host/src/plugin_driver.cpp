#include "plugin_driver.hpp"

#include <utility>

#include "guarded.hpp"

namespace rtpm::driver_host {
namespace {

using driver::Calibration;
using driver::CalibrationState;

/// One run of a plug-in's calibration. An exception of the plug-in ends the run without a result.
class PluginCalibration final : public Calibration {
 public:
  PluginCalibration(std::string note, std::shared_ptr<const Library> library,
                    std::unique_ptr<Calibration> calibration) noexcept
      : note_(std::move(note)),
        library_(std::move(library)),
        calibration_(std::move(calibration)) {}

  [[nodiscard]] CalibrationState step(const driver::Sample& sample,
                                      std::optional<std::string_view> answer) override {
    const rt::CrashNote note(note_.c_str());
    const rt::CrashNote place("step()");
    return guarded_by([&] { return calibration_->step(sample, answer); },
                      [](const std::string& why) -> CalibrationState {
                        return driver::CalibrationFailed{"the driver failed in step(): " + why +
                                                         "; ask its author"};
                      });
  }

 private:
  std::string note_;
  std::shared_ptr<const Library> library_;  // Outlives its calibration.
  std::unique_ptr<Calibration> calibration_;
};

/// A calibration that could not be made.
class FailedCalibration final : public Calibration {
 public:
  explicit FailedCalibration(std::string reason) noexcept : reason_(std::move(reason)) {}
  [[nodiscard]] CalibrationState step(const driver::Sample&,
                                      std::optional<std::string_view>) override {
    return driver::CalibrationFailed{reason_};
  }

 private:
  std::string reason_;
};

}  // namespace

PluginDriver::PluginDriver(std::string file, std::string note,
                           std::shared_ptr<const Library> library, std::unique_ptr<Driver> driver,
                           Facts facts) noexcept
    : file_(std::move(file)),
      note_(std::move(note)),
      library_(std::move(library)),
      driver_(std::move(driver)),
      facts_(std::move(facts)) {}

PluginDriver::~PluginDriver() {
  const rt::CrashNote note(note_.c_str());
  const rt::CrashNote place("its destructor");
  driver_.reset();
}

template <class Call>
auto PluginDriver::guarded_call(const char* place, Call&& call) {
  const rt::CrashNote note(note_.c_str());
  const rt::CrashNote inner(place);
  return guarded(file_, place, std::forward<Call>(call));
}

expected<void, SetupError> PluginDriver::configure(const driver::DriverConfig& config) {
  return guarded_call("configure()", [&] { return driver_->configure(config); });
}

expected<void, SetupError> PluginDriver::activate() {
  return guarded_call("activate()", [&] { return driver_->activate(); });
}

expected<void, SetupError> PluginDriver::set_parameters(
    std::span<driver::ParameterSetting> settings) {
  return guarded_call("set_parameters()", [&] { return driver_->set_parameters(settings); });
}

std::unique_ptr<Calibration> PluginDriver::make_calibration(std::string_view name) {
  const rt::CrashNote note(note_.c_str());
  const rt::CrashNote place("make_calibration()");
  return guarded_by(
      [&]() -> std::unique_ptr<Calibration> {
        auto made = driver_->make_calibration(name);
        if (made == nullptr) return nullptr;
        return std::make_unique<PluginCalibration>(note_, library_, std::move(made));
      },
      [](const std::string& why) -> std::unique_ptr<Calibration> {
        return std::make_unique<FailedCalibration>(
            "the driver failed in make_calibration(): " + why + "; ask its author");
      });
}

}  // namespace rtpm::driver_host
