// A plug-in whose exchange() does what the command's first output says. It counts its cycles as
// edges of a button, shows its parameter as an analog, and logs its calls to the file that its
// argument names.
#include <unistd.h>

#include <cstdlib>
#include <fstream>
#include <string>

#include "rtpm/driver/plugin.hpp"

namespace {

using namespace rtpm::driver;

constexpr float kCrash = 1;
constexpr float kHang = 2;
constexpr float kAbort = 3;
constexpr float kLate = 4;

class Question final : public Calibration {
 public:
  [[nodiscard]] CalibrationState step(const Sample& sample,
                                      std::optional<std::string_view> answer) override {
    if (!answer) return CalibrationPrompt{.progress = 0.5, .text = "turn it", .answers = {"ready"}};
    if (*answer == "crash") std::abort();
    return CalibrationDone{.settings = {{.name = "gain", .value = 3.0}},
                           .summary = "at " + std::to_string(sample.sequence)};
  }
};

class Puppet final : public Driver {
 public:
  explicit Puppet(std::string_view file) : file_(file) {}
  ~Puppet() override { write("destroyed"); }

  [[nodiscard]] Descriptor describe() const override {
    Descriptor descriptor;
    descriptor.device_class = DeviceClass::kHaptic;
    descriptor.model = "puppet";
    descriptor.serial = "p-1";
    descriptor.frame = "puppet/base";
    descriptor.axes = {{.name = "x", .is_sensed = true, .is_actuated = true}};
    descriptor.buttons = {"cycles"};
    descriptor.analogs = {{.name = "gain", .unit = "1", .low = 0, .high = 5}};
    descriptor.modes = {CommandMode::kForce};
    descriptor.limits.force_newton_max = 4;
    return descriptor;
  }
  [[nodiscard]] rtpm::expected<void, rtpm::SetupError> configure(
      const DriverConfig& config) override {
    if (config.period <= rtpm::Duration{0}) {
      return rtpm::setup_error("no period", "it is zero", "set one");
    }
    write("configured");
    return {};
  }
  [[nodiscard]] rtpm::expected<void, rtpm::SetupError> activate() override {
    mode_ = CommandMode::kOff;
    return {};
  }
  [[nodiscard]] ExchangeStatus exchange(const Command& command, Sample& sample) noexcept override {
    const float told = command.mode == CommandMode::kOutputs ? command.outputs[0] : 0;
    if (told == kCrash) crash();
    if (told == kAbort) std::abort();
    while (told == kHang)
      pause();
    if (told == kLate) return ExchangeStatus::kLate;
    if (command.mode != mode_) write(command.mode == CommandMode::kForce ? "force" : "off");
    mode_ = command.mode;
    sample.host_time = command.cycle_time;
    ++sample.button_edges[0];
    sample.buttons ^= 1U;
    sample.analogs[0] = static_cast<float>(gain_);
    return ExchangeStatus::kOk;
  }
  void deactivate() noexcept override { write("deactivated"); }
  [[nodiscard]] std::vector<ParameterSpec> parameters() const override {
    return {
        {.name = "gain", .low = 0, .high = 5, .default_value = 1.0, .description = "Its gain."}};
  }
  [[nodiscard]] rtpm::expected<void, rtpm::SetupError> set_parameters(
      std::span<ParameterSetting> settings) override {
    for (ParameterSetting& setting : settings) {
      gain_ = static_cast<int>(std::get<double>(setting.value));
      setting.value = static_cast<double>(gain_);
    }
    return {};
  }
  [[nodiscard]] std::vector<CalibrationInfo> calibrations() const override {
    return {{.name = "zero", .description = "Finds it."}};
  }
  [[nodiscard]] std::unique_ptr<Calibration> make_calibration(std::string_view name) override {
    if (name == "zero") return std::make_unique<Question>();
    return nullptr;
  }

 private:
  void write(const char* word) const {
    if (!file_.empty()) std::ofstream(file_, std::ios::app) << word << '\n';
  }
  [[gnu::noinline]] static void crash() noexcept {
    int* volatile nowhere = nullptr;
    *nowhere = 1;
  }

  std::string file_;
  CommandMode mode_ = CommandMode::kOff;
  int gain_ = 1;
};

rtpm::expected<std::unique_ptr<Driver>, rtpm::SetupError> make(std::string_view arguments) {
  if (arguments == "error") return rtpm::setup_error("no puppet", "it broke", "buy one");
  if (arguments == "crash") std::abort();
  return std::make_unique<Puppet>(arguments);
}

}  // namespace

RTPM_DRIVER_PLUGIN(&make);
