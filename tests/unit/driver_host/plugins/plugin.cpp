// A plug-in that misbehaves at the step its argument names, such as "activate" or "activate:int".
#include "rtpm/driver/plugin.hpp"

#include <stdexcept>
#include <string>

namespace {

using namespace rtpm::driver;

class Misbehaviour {
 public:
  explicit Misbehaviour(std::string_view arguments) : where_(arguments) {}
  void at(const std::string& place) const {
    if (where_ == place) throw std::runtime_error("the gripper is stuck");
    if (where_ == place + ":int") throw 42;
  }
  [[nodiscard]] bool is(std::string_view word) const { return where_ == word; }

 private:
  std::string where_;
};

class Dialogue final : public Calibration {
 public:
  explicit Dialogue(Misbehaviour misbehaviour) : misbehaviour_(std::move(misbehaviour)) {}
  [[nodiscard]] CalibrationState step(const Sample&, std::optional<std::string_view>) override {
    misbehaviour_.at("step");
    return CalibrationDone{.settings = {{.name = "offset", .value = 0.25}}, .summary = "done"};
  }

 private:
  Misbehaviour misbehaviour_;
};

class Gripper final : public Driver {
 public:
  explicit Gripper(Misbehaviour misbehaviour) : misbehaviour_(std::move(misbehaviour)) {}

  [[nodiscard]] Descriptor describe() const override {
    misbehaviour_.at("describe");
    Descriptor descriptor;
    descriptor.model = "gripper";
    descriptor.serial = "g-1";
    descriptor.frame = "gripper/base";
    return descriptor;
  }
  [[nodiscard]] rtpm::expected<void, rtpm::SetupError> configure(const DriverConfig&) override {
    misbehaviour_.at("configure");
    return {};
  }
  [[nodiscard]] rtpm::expected<void, rtpm::SetupError> activate() override {
    misbehaviour_.at("activate");
    return {};
  }
  [[nodiscard]] ExchangeStatus exchange(const Command& command, Sample& sample) noexcept override {
    sample.host_time = command.cycle_time;
    sample.buttons = 5;
    return ExchangeStatus::kOk;
  }
  void deactivate() noexcept override {}
  [[nodiscard]] std::vector<ParameterSpec> parameters() const override {
    misbehaviour_.at("parameters");
    return {{.name = "offset",
             .type = ParameterType::kReal,
             .low = 0,
             .high = 1,
             .default_value = 0.0}};
  }
  [[nodiscard]] rtpm::expected<void, rtpm::SetupError> set_parameters(
      std::span<ParameterSetting>) override {
    misbehaviour_.at("set_parameters");
    return {};
  }
  [[nodiscard]] std::vector<CalibrationInfo> calibrations() const override {
    misbehaviour_.at("calibrations");
    return {{.name = "zero", .description = "Finds the offset."}};
  }
  [[nodiscard]] std::unique_ptr<Calibration> make_calibration(std::string_view name) override {
    misbehaviour_.at("make_calibration");
    if (name != "zero") return nullptr;
    return std::make_unique<Dialogue>(misbehaviour_);
  }

 private:
  Misbehaviour misbehaviour_;
};

rtpm::expected<std::unique_ptr<Driver>, rtpm::SetupError> make_gripper(std::string_view arguments) {
  const Misbehaviour misbehaviour(arguments);
  misbehaviour.at("create");
  if (misbehaviour.is("error")) return rtpm::setup_error("no gripper", "", "buy one");
  if (misbehaviour.is("null")) return std::unique_ptr<Driver>();
  return std::make_unique<Gripper>(misbehaviour);
}

}  // namespace

RTPM_DRIVER_PLUGIN(&make_gripper);
