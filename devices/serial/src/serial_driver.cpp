#include "rtpm/device_serial/serial_driver.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "rtpm/device_io/buttons.hpp"
#include "zero_calibration.hpp"

namespace rtpm::device_serial {

using driver::CommandMode;
using driver::ExchangeStatus;
using std::chrono::milliseconds;

namespace {

constexpr int kThreadPriority = 24'000;
constexpr double kScaleMax = 1e6;

/// A parameter with one element for each of the device's channels.
struct VectorParameter {
  const char* name;
  std::size_t size;
  double limit;
  double default_value;
  const char* description;
};

driver::ParameterSpec spec_of(const VectorParameter& parameter) {
  return {.name = parameter.name,
          .type = driver::ParameterType::kVector,
          .low = -parameter.limit,
          .high = parameter.limit,
          .vector_size = parameter.size,
          .default_value = std::vector<double>(parameter.size, parameter.default_value),
          .description = parameter.description};
}

float clamped(double value, double low, double high, double otherwise) noexcept {
  return static_cast<float>(std::isfinite(value) ? std::clamp(value, low, high) : otherwise);
}

/// A joint that turns endlessly has no range.
bool is_outside(const driver::Joint& joint, double position) noexcept {
  return joint.low < joint.high && (position < joint.low || position > joint.high);
}

driver::DeviceClass class_of(const BoardDescription& board) {
  using driver::DeviceClass;
  if (board.joints.empty())
    return board.analogs.empty() && board.buttons.empty() ? DeviceClass::kOutput
                                                          : DeviceClass::kInput;
  const driver::Joint& joint = board.joints.front();
  if (joint.low == joint.high) return DeviceClass::kDial;
  return joint.effort_max > 0 ? DeviceClass::kHaptic : DeviceClass::kInput;
}

}  // namespace

SerialDriver::SerialDriver(SerialConfig config)
    : config_(std::move(config)),
      analog_offset_(config_.board.analogs.size(), 0),
      analog_scale_(config_.board.analogs.size(), 1),
      joint_zero_(config_.board.joints.size(), 0) {}

SerialDriver::~SerialDriver() {
  SerialDriver::deactivate();
}

driver::Descriptor SerialDriver::describe() const {
  const BoardDescription& board = config_.board;
  driver::Descriptor descriptor;
  descriptor.device_class = class_of(board);
  descriptor.model = board.name;
  descriptor.serial = config_.serial;
  descriptor.frame = config_.frame;
  descriptor.buttons = board.buttons;
  descriptor.analogs = board.analogs;
  descriptor.joints = board.joints;
  descriptor.outputs = board.outputs;
  const bool has_motor =
      std::ranges::any_of(board.joints, [](const auto& joint) { return joint.effort_max > 0; });
  if (has_motor) descriptor.modes.push_back(CommandMode::kJointEffort);
  if (!board.outputs.empty()) descriptor.modes.push_back(CommandMode::kOutputs);
  descriptor.rate_hz = board.rate_hz;
  return descriptor;
}

std::string SerialDriver::place() const {
  if (!config_.port.port.empty()) return "the board at " + config_.port.port;
  return "the board " + config_.serial;
}

expected<void, SetupError> SerialDriver::configure(const driver::DriverConfig& config) {
  if (config.period <= Duration{0})
    return setup_error("the driver serial needs a period above zero", "", "set --rate");
  deactivate();
  auto transport = config_.open(config_.port);
  if (!transport) return unexpected{transport.error()};
  Session session(**transport, {config.period, config_.port.speed_baud,
                                nonce_at((*transport)->now()), config_.greeting_max});
  const auto board = session.greet();
  if (!board) return setup_error(place() + " can't be used", board.error());
  if (auto checked = check(*board); !checked) return checked;
  period_ = config.period;
  transport_ = std::move(*transport);
  session_.emplace(session);
  return {};
}

expected<void, SetupError> SerialDriver::check(const BoardDescription& board) const {
  const std::string& serial = config_.board.serial;
  if (!serial.empty() && board.serial != serial)
    return setup_error(place() + " is another one", "it is " + board.serial + ", not " + serial,
                       "plug that board in again, or restart rtpm-deviced");
  if (!board.has_channels_of(config_.board))
    return setup_error(place() + " has other channels than this device",
                       "they were read, or assumed, when rtpm-deviced started",
                       "restart rtpm-deviced while the board is plugged in");
  return {};
}

expected<void, SetupError> SerialDriver::activate() {
  if (!session_ || is_active_) return setup_error("the driver serial is not configured");
  last_ = {};
  session_->begin();
  while (session_->report().state_count == 0) {
    if (!session_->step({}, milliseconds{1}))
      return setup_error(place() + " does not answer", "",
                         "see whether it is still plugged in; it is asked again");
  }
  requests_.write({.number = request_number_});
  reports_.write(session_->report());
  const rt::ThreadConfig thread{
      .name = "serial", .priority = kThreadPriority, .realtime = config_.realtime};
  auto started = thread_.start(thread, [this] {
    const bool lives = session_->step(requests_.read().value_or(Request{}), period_);
    reports_.write(session_->report());
    return lives;
  });
  if (!started) return setup_error("the driver serial gets no thread", started.error());
  is_active_ = true;
  return {};
}

/// The request for a command, within the board's ranges; off in a mode that the board does not
/// have.
Request SerialDriver::request_of(const driver::Command& command) noexcept {
  Request request;
  request.number = ++request_number_;
  request.is_on =
      command.mode == CommandMode::kJointEffort || command.mode == CommandMode::kOutputs;
  request.time_left =
      command.deadline == kNever ? Session::kRequestMax : command.deadline - command.cycle_time;
  const BoardDescription& board = config_.board;
  for (std::size_t i = 0; i < board.joints.size(); ++i) {
    const double limit = board.joints[i].effort_max;
    const bool has_effort = command.mode == CommandMode::kJointEffort;
    request.efforts[i] = has_effort ? clamped(command.joints[i], -limit, limit, 0) : 0;
  }
  for (std::size_t i = 0; i < board.outputs.size(); ++i) {
    const driver::Output& output = board.outputs[i];
    request.outputs[i] = clamped(command.outputs[i], output.low, output.high, output.safe);
  }
  return request;
}

ExchangeStatus SerialDriver::exchange(const driver::Command& command,
                                      driver::Sample& sample) noexcept {
  if (!is_active_) return ExchangeStatus::kGone;
  requests_.write(request_of(command));
  transport_->wake();
  const auto report = reports_.read();
  if (!report) return ExchangeStatus::kLate;
  const Report before = std::exchange(last_, *report);
  if (report->is_gone) return ExchangeStatus::kGone;
  const bool has_corrupt = report->counters.corrupt != before.counters.corrupt;
  if (has_corrupt && report->state_count == before.state_count) {
    last_.button_edges = before.button_edges;
    return ExchangeStatus::kCorrupt;
  }
  if (report->is_late || report->state_count == 0) {
    last_.button_edges = before.button_edges;
    return ExchangeStatus::kLate;
  }
  device_io::take_buttons(sample, report->state.buttons, before.button_edges, report->button_edges);
  // A test's clock may be ahead of the cycle's clock.
  sample.host_time = std::max(sample.host_time, std::min(report->received_at, command.cycle_time));
  fill(sample, *report);
  if (has_corrupt) sample.faults.set(driver::Fault::kDeviceCorrupt);
  return ExchangeStatus::kOk;
}

void SerialDriver::fill(driver::Sample& sample, const Report& report) const noexcept {
  const BoardDescription& board = config_.board;
  const BoardState& state = report.state;
  sample.device_time = report.board_time;
  for (std::size_t i = 0; i < board.joints.size(); ++i) {
    const double limit = board.joints[i].effort_max;
    sample.joints[i] = state.positions[i] - joint_zero_[i];
    sample.joint_velocities[i] = state.velocities[i];
    sample.efforts_applied[i] = std::clamp<double>(state.efforts[i], -limit, limit);
    if (is_outside(board.joints[i], sample.joints[i]))
      sample.faults.set(driver::Fault::kOutsideWorkspace);
  }
  for (std::size_t i = 0; i < board.analogs.size(); ++i) {
    const double value = analog_offset_[i] + analog_scale_[i] * state.analogs[i];
    sample.analogs[i] = clamped(value, board.analogs[i].low, board.analogs[i].high, 0);
  }
  for (std::size_t i = 0; i < board.outputs.size(); ++i)
    sample.outputs_applied[i] =
        clamped(state.outputs[i], board.outputs[i].low, board.outputs[i].high, 0);
  if (state.is_saturated) sample.faults.set(driver::Fault::kDeviceSaturated);
}

void SerialDriver::deactivate() noexcept {
  thread_.stop();
  if (session_) session_->stop();
  is_active_ = false;
  session_.reset();
  transport_.reset();
}

std::vector<driver::ParameterSpec> SerialDriver::parameters() const {
  using driver::ParameterType;
  std::vector<driver::ParameterSpec> specs{
      {.name = "port",
       .type = ParameterType::kText,
       .default_value = config_.port.port,
       .description = "Port of the board; empty: found by the USB serial number.",
       .mutability = driver::Mutability::kInactive},
      {.name = "speed_baud",
       .type = ParameterType::kInteger,
       .low = static_cast<double>(kSpeedMinBaud),
       .high = static_cast<double>(kSpeedMaxBaud),
       .default_value = config_.port.speed_baud,
       .description = "Speed of the line, as in the board's firmware.",
       .mutability = driver::Mutability::kInactive}};
  const BoardDescription& board = config_.board;
  const std::array vectors{
      VectorParameter{"analog.offset", board.analogs.size(), kScaleMax, 0,
                      "Added to each analog, in its unit, after the scale."},
      VectorParameter{"analog.scale", board.analogs.size(), kScaleMax, 1,
                      "By which what the board reads of each analog is multiplied."},
      VectorParameter{"joint.zero", board.joints.size(), ZeroCalibration::kZeroMax, 0,
                      "What the board reads of each joint in its zero position."}};
  for (const VectorParameter& vector : vectors) {
    if (vector.size > 0) specs.push_back(spec_of(vector));
  }
  return specs;
}

expected<void, SetupError> SerialDriver::set_parameters(
    std::span<driver::ParameterSetting> settings) {
  for (const driver::ParameterSetting& setting : settings) {
    const auto take = [&](const char* name, auto& to) {
      if (setting.name == name) to = std::get<std::remove_cvref_t<decltype(to)>>(setting.value);
    };
    take("port", config_.port.port);
    take("speed_baud", config_.port.speed_baud);
    take("analog.offset", analog_offset_);
    take("analog.scale", analog_scale_);
    take("joint.zero", joint_zero_);
  }
  return {};
}

std::vector<driver::CalibrationInfo> SerialDriver::calibrations() const {
  if (config_.board.joints.empty()) return {};
  return {{"joint_zero", "Finds joint.zero: hold all joints in their zero position."}};
}

std::unique_ptr<driver::Calibration> SerialDriver::make_calibration(std::string_view name) {
  if (name != "joint_zero" || config_.board.joints.empty()) return nullptr;
  return std::make_unique<ZeroCalibration>(joint_zero_);
}

}  // namespace rtpm::device_serial
