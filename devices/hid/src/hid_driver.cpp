#include "rtpm/device_hid/hid_driver.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "rtpm/rt/clock.hpp"

namespace rtpm::device_hid {
namespace {

/// Interval at which the writing thread checks whether it must stop or repeat a request.
constexpr Duration kWriterPause = std::chrono::milliseconds{100};
constexpr Duration kReaderPatienceMax = std::chrono::milliseconds{20};

std::string serial_of(const Unit* unit, std::string_view device_name) {
  if (unit != nullptr && !unit->serial.empty()) return unit->serial;
  if (unit != nullptr && !unit->port.empty()) return "port-" + unit->port;
  return "hid-" + std::string(device_name);
}

/// Force must not wait for time-shared work; a cap or stick needs no such priority.
rt::ThreadConfig thread_config(const char* name, const driver::Descriptor& descriptor) {
  rt::ThreadConfig config{.name = name};
  if (!descriptor.joints.empty()) config.priority = Priority{24'000};
  return config;
}

}  // namespace

HidDriver::HidDriver(std::shared_ptr<HidSystem> system, Settings settings,
                     std::unique_ptr<Profile> profile, driver::Descriptor descriptor)
    : system_(std::move(system)),
      settings_(std::move(settings)),
      profile_(std::move(profile)),
      descriptor_(std::move(descriptor)) {
  for (std::size_t i = 0; i < descriptor_.outputs.size(); ++i)
    safe_.outputs[i] = static_cast<float>(descriptor_.outputs[i].safe);
}

HidDriver::~HidDriver() {
  HidDriver::deactivate();
}

expected<std::unique_ptr<HidDriver>, SetupError> HidDriver::create(
    std::shared_ptr<HidSystem> system, Settings settings, std::string_view device_name) {
  const std::vector<Unit> units = system->units();
  const auto unit = choose(units, settings, nullptr);
  if (!unit) return unexpected{unit.error()};
  const auto kind = *unit != nullptr ? kind_for(settings, **unit) : settings.kind;
  if (!kind) {
    return setup_error("no HID device that fits is plugged in", "",
                       "plug it in, or give kind= to wait for it");
  }
  auto profile = make_profile(*kind, *unit, settings.torque_newton_metre);
  driver::Descriptor descriptor = profile->describe();
  descriptor.serial = serial_of(*unit, device_name);
  descriptor.frame = std::string(device_name) + "/base";
  settings.kind = kind;
  std::unique_ptr<HidDriver> made(new HidDriver(std::move(system), std::move(settings),
                                                std::move(profile), std::move(descriptor)));
  if (*unit != nullptr) made->identity_ = identity_of(**unit);
  return made;
}

expected<Unit, SetupError> HidDriver::find_unit() {
  const std::vector<Unit> units = system_->units();
  const auto unit = choose(units, settings_, identity_ ? &*identity_ : nullptr);
  if (!unit) return unexpected{unit.error()};
  if (*unit == nullptr) {
    std::string name = descriptor_.model;
    if (identity_ && !identity_->serial.empty()) name += " with serial number " + identity_->serial;
    return setup_error(name + " is not plugged in", "", "plug it in and switch it on");
  }
  return **unit;
}

expected<void, SetupError> HidDriver::configure(const driver::DriverConfig& config) {
  if (config.period <= Duration{0}) {
    return setup_error("a HID device's driver needs a period above zero", "", "set --rate");
  }
  deactivate();
  const auto unit = find_unit();
  if (!unit) return unexpected{unit.error()};
  auto transport = system_->open(*unit);
  if (!transport) return unexpected{transport.error()};
  transport_ = std::move(*transport);
  period_ = config.period;
  if (auto started = start_session(*unit); !started) {
    deactivate();
    return started;
  }
  identity_ = identity_of(*unit);
  return {};
}

expected<void, SetupError> HidDriver::start_session(const Unit& unit) {
  if (auto begun = profile_->begin(*transport_, unit); !begun) return begun;
  writer_.emplace(*transport_, *profile_, safe_);
  writer_->make_safe();
  // A button that was pressed when the last session ended may have been released since.
  state_.release();
  reader_.emplace(*transport_, *profile_, state_);
  if (!profile_->silence_max()) return {};
  const MonotonicTime end = transport_->now() + kFirstReportMax;
  while (reader_->report_count() == 0 && transport_->now() < end) {
    if (!reader_->step(kReaderPatienceMax)) break;
  }
  if (reader_->report_count() > 0) return {};
  return setup_error(descriptor_.model + " at " + unit.node + " sends no report", "",
                     "unplug it, or switch it off, and on again");
}

expected<void, SetupError> HidDriver::activate() {
  if (!reader_ || is_active_) return setup_error("a HID device's driver is not configured");
  seen_corrupt_count_ = reader_->corrupt_count();
  last_request_ = safe_;
  orders_.write({safe_, rt::now()});
  deliveries_.write({safe_, false, false});
  report(false);
  auto started =
      reading_.start(thread_config("hid-read", descriptor_), [this] { return read_step(); });
  if (started && !descriptor_.modes.empty()) {
    started =
        writing_.start(thread_config("hid-write", descriptor_), [this] { return write_step(); });
  }
  if (!started) {
    stop_threads();
    return started;
  }
  is_active_ = true;
  return {};
}

void HidDriver::report(bool is_gone) noexcept {
  reports_.write({state_, reader_->measured_at().value_or(kNever), reader_->corrupt_count(),
                  reader_->is_late(), is_gone});
}

bool HidDriver::read_step() {
  const bool is_alive = reader_->step(kReaderPatienceMax);
  report(!is_alive);
  return is_alive;
}

bool HidDriver::write_step() {
  const Order order = orders_.read().value_or(Order{safe_, kNever});
  const MonotonicTime now = rt::now();
  const bool is_valid = now < order.valid_until;
  writer_->step(is_valid ? order.request : safe_, now);
  deliveries_.write({writer_->delivered(), writer_->is_refused(), writer_->is_gone()});
  if (writer_->is_gone()) return false;
  const MonotonicTime wake = now + (writer_->is_refused() ? Writer::kRetryPeriod : kWriterPause);
  static_cast<void>(has_order_.wait_until(is_valid ? std::min(wake, order.valid_until) : wake));
  return true;
}

Request HidDriver::request_of(const driver::Command& command) const noexcept {
  if (command.mode == driver::CommandMode::kOff ||
      static_cast<std::uint8_t>(command.mode) >= driver::kCommandModeCount) {
    return safe_;
  }
  Request request = safe_;
  for (std::size_t i = 0; i < descriptor_.outputs.size(); ++i) {
    const driver::Output& output = descriptor_.outputs[i];
    if (!std::isfinite(command.outputs[i])) continue;
    request.outputs[i] = std::clamp(command.outputs[i], static_cast<float>(output.low),
                                    static_cast<float>(output.high));
  }
  if (command.mode == driver::CommandMode::kJointEffort && !descriptor_.joints.empty() &&
      std::isfinite(command.joints[0])) {
    const double effort_max = descriptor_.joints[0].effort_max;
    request.effort = std::clamp(command.joints[0], -effort_max, effort_max);
  }
  return request;
}

void HidDriver::give_order(const driver::Command& command, const Request& request) noexcept {
  // The command's times may be in simulated time; its hold is in real time.
  MonotonicTime valid_until = kNever;
  if (command.deadline != kNever) {
    valid_until = rt::now() + std::max(command.deadline - command.cycle_time, Duration{0});
  }
  orders_.write({request, valid_until});
  if (request != std::exchange(last_request_, request)) has_order_.post();
}

driver::ExchangeStatus HidDriver::exchange(const driver::Command& command,
                                           driver::Sample& sample) noexcept {
  if (!is_active_) return driver::ExchangeStatus::kGone;
  const Request request = request_of(command);
  give_order(command, request);
  const auto report = reports_.read();
  const auto delivery = deliveries_.read();
  if (!report || !delivery) return driver::ExchangeStatus::kLate;
  if (report->is_gone || delivery->is_gone) return driver::ExchangeStatus::kGone;
  if (std::exchange(seen_corrupt_count_, report->corrupt_count) != report->corrupt_count) {
    return driver::ExchangeStatus::kCorrupt;
  }
  if (report->is_late) return driver::ExchangeStatus::kLate;
  sample.host_time = std::min(report->measured_at, command.cycle_time);
  sample.device_time = report->state.device_time;
  sample.analogs = report->state.analogs;
  sample.buttons = report->state.buttons;
  sample.button_edges = report->state.button_edges;
  sample.joints[0] = report->state.joint;
  sample.joint_velocities[0] = report->state.joint_velocity;
  sample.outputs_applied = delivery->request.outputs;
  sample.efforts_applied[0] = delivery->request.effort;
  const bool is_cut =
      command.mode == driver::CommandMode::kJointEffort && request.effort != command.joints[0];
  if (delivery->is_refused || is_cut) sample.faults.set(driver::Fault::kDeviceSaturated);
  return driver::ExchangeStatus::kOk;
}

void HidDriver::stop_threads() noexcept {
  reading_.request_stop();
  writing_.request_stop();
  has_order_.post();
  writing_.stop();
  reading_.stop();
}

void HidDriver::deactivate() noexcept {
  stop_threads();
  is_active_ = false;
  if (transport_) {
    if (writer_) writer_->make_safe();
    profile_->end(*transport_);
  }
  reader_.reset();
  writer_.reset();
  transport_.reset();
}

}  // namespace rtpm::device_hid
