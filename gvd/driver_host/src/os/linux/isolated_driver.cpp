#include "isolated_driver.hpp"

#include <algorithm>
#include <utility>

#include "archive.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::driver_host {
namespace {

using driver::ExchangeStatus;
using driver::ParameterSetting;

constexpr Duration kCallPatience = std::chrono::seconds{1};
constexpr Duration kStuckPatience = std::chrono::milliseconds{100};
/// Interval at which a long wait for a reply checks whether the process has ended.
constexpr Duration kLookPeriod = std::chrono::milliseconds{5};
constexpr Duration kStepPatience = std::chrono::seconds{5};

const char* place_of(FrameKind kind) noexcept {
  switch (kind) {
    case FrameKind::kConfigure:
      return "configure()";
    case FrameKind::kActivate:
      return "activate()";
    case FrameKind::kDeactivate:
      return "deactivate()";
    case FrameKind::kSetParameters:
      return "set_parameters()";
    case FrameKind::kMakeCalibration:
      return "make_calibration()";
    default:
      return "its start";
  }
}

SetupError error_of(ConstBytes bytes) {
  SetupError error;
  Reader read(bytes);
  read(error);
  if (read.is_whole()) return error;
  return {.what = "the driver's process sent an error that is unreadable"};
}

unexpected<SetupError> unreadable() {
  return setup_error("the driver's process sent an answer that is unreadable",
                     "its driver may have overwritten its memory", "ask the driver's author");
}

/// A run of a calibration in the driver's process.
class IsolatedCalibration final : public driver::Calibration {
 public:
  IsolatedCalibration(std::shared_ptr<DriverProcess> process, std::uint64_t id)
      : process_(std::move(process)), id_(id) {}
  ~IsolatedCalibration() override {
    Writer write;
    write(id_);
    static_cast<void>(
        process_->call_calibration(FrameKind::kRelease, write.bytes(), rt::now() + kCallPatience));
  }

  [[nodiscard]] driver::CalibrationState step(const driver::Sample& sample,
                                              std::optional<std::string_view> answer) override {
    Writer write;
    write(id_, sample, answer ? std::optional(std::string(*answer)) : std::nullopt);
    const auto frame =
        process_->call_calibration(FrameKind::kStep, write.bytes(), rt::now() + kStepPatience);
    if (!frame) {
      return driver::CalibrationFailed{
          "the driver's process has ended, or did not return from step(); begin again"};
    }
    driver::CalibrationState state;
    Reader read(frame->bytes);
    read(state);
    if (frame->kind == FrameKind::kDone && read.is_whole()) return state;
    return driver::CalibrationFailed{"the driver's process sent an answer that is unreadable"};
  }

 private:
  std::shared_ptr<DriverProcess> process_;
  std::uint64_t id_;
};

}  // namespace

expected<std::unique_ptr<driver::Driver>, SetupError> isolate(IsolationConfig config) {
  auto driver = std::make_unique<IsolatedDriver>(std::move(config));
  if (auto started = driver->start(); !started) return unexpected{std::move(started.error())};
  return driver;
}

expected<void, SetupError> IsolatedDriver::start() {
  auto process = DriverProcess::start(config_.command);
  if (!process) return unexpected{std::move(process.error())};
  process_ = std::move(*process);
  request_number_ = 0;
  reply_number_ = 0;
  const auto frame = process_->receive_facts(rt::now() + config_.set_up_patience);
  if (!frame) {
    const std::string end = lose("its start");
    return setup_error("the driver's process did not make its driver", end,
                       "run it without a process of its own to see more");
  }
  if (frame->kind == FrameKind::kFailed) {
    process_.reset();
    return unexpected{error_of(frame->bytes)};
  }
  Facts facts;
  Reader read(frame->bytes);
  read(facts.descriptor, facts.parameters, facts.calibrations);
  if (!read.is_whole()) return unreadable();
  if (fact_bytes_.empty()) {
    facts_ = std::move(facts);
    fact_bytes_ = frame->bytes;
  }
  if (frame->bytes == fact_bytes_) return {};
  process_.reset();
  return setup_error("the driver describes another device than before its process ended", "",
                     "restart the device's server");
}

expected<void, SetupError> IsolatedDriver::revive() {
  if (is_running()) return {};
  process_.reset();
  if (auto started = start(); !started) return started;
  if (parameters_.empty()) return {};
  std::vector<ParameterSetting> settings;
  for (const auto& [name, value] : parameters_)
    settings.push_back({name, value});
  if (auto sent = send_parameters(settings); !sent) return unexpected{std::move(sent.error())};
  return {};
}

expected<std::vector<std::byte>, SetupError> IsolatedDriver::call(FrameKind kind, ConstBytes bytes,
                                                                  Duration patience) {
  if (!is_running()) {
    return setup_error("the driver's process has ended", "", "wait until the device is back");
  }
  auto frame = process_->call(kind, bytes, rt::now() + patience);
  if (!frame) {
    return setup_error(std::string("the driver failed in ") + place_of(kind), lose(place_of(kind)),
                       "ask the driver's author");
  }
  if (frame->kind == FrameKind::kFailed) return unexpected{error_of(frame->bytes)};
  return std::move(frame->bytes);
}

std::string IsolatedDriver::lose(const char* place) {
  const std::string number = std::to_string(process_->number());
  std::string end = "its process " + number + " did not answer and was killed";
  // A process closes its sockets slightly before it ends, so its exit status comes later.
  if (process_->wait_for_end(kStuckPatience)) {
    end = "its process " + number + " ended by " + process_->end_text();
  } else {
    process_->kill();
  }
  process_.reset();
  report("the driver failed in " + std::string(place) + ": " + end);
  return end;
}

void IsolatedDriver::report(const std::string& text) const {
  if (config_.listener != nullptr) config_.listener->report(text);
}

expected<void, SetupError> IsolatedDriver::configure(const driver::DriverConfig& config) {
  if (auto revived = revive(); !revived) return revived;
  driver_config_ = config;
  patience_ = config_.exchange_patience.value_or(config.period / 2);
  Writer write;
  write(config.period);
  if (auto done = call(FrameKind::kConfigure, write.bytes(), config_.set_up_patience); !done) {
    return unexpected{std::move(done.error())};
  }
  return {};
}

expected<void, SetupError> IsolatedDriver::activate() {
  if (auto done = call(FrameKind::kActivate, {}, config_.set_up_patience); !done) {
    return unexpected{std::move(done.error())};
  }
  is_active_ = true;
  // Earlier replies belong to a previous session.
  reply_number_ = request_number_;
  return {};
}

std::optional<CycleReply> IsolatedDriver::wait_for_reply(MonotonicTime deadline) noexcept {
  CycleMemory& memory = process_->memory();
  for (;;) {
    const auto reply = memory.replies.read();
    if (reply && reply->number == request_number_) return reply;
    // Reads the clock each time: the driver's process may ring at any time, or not at all.
    const MonotonicTime now = rt::now();
    if (now >= deadline) return reply;
    if (!memory.has_reply.wait_until(std::min(deadline, now + kLookPeriod)) &&
        process_->has_ended()) {
      return memory.replies.read();
    }
  }
}

ExchangeStatus IsolatedDriver::exchange(const driver::Command& command,
                                        driver::Sample& sample) noexcept {
  if (!is_active_ || process_ == nullptr) return ExchangeStatus::kGone;
  CycleMemory& memory = process_->memory();
  memory.requests.write({++request_number_, command, sample});
  memory.has_request.ring();
  const auto reply = wait_for_reply(rt::now() + patience_);
  if (!reply || reply->number <= reply_number_ || reply->number > request_number_) {
    return process_->has_ended() ? ExchangeStatus::kGone : ExchangeStatus::kLate;
  }
  reply_number_ = reply->number;
  if (reply->status > static_cast<std::uint8_t>(ExchangeStatus::kGone)) {
    return ExchangeStatus::kCorrupt;
  }
  const auto status = static_cast<ExchangeStatus>(reply->status);
  if (status == ExchangeStatus::kOk) sample = reply->sample;
  return status;
}

void IsolatedDriver::deactivate() noexcept {
  if (process_ == nullptr) return;
  const bool was_active = std::exchange(is_active_, false);
  const bool is_stuck = was_active && reply_number_ != request_number_;
  if (!process_->has_ended()) {
    const Duration patience = is_stuck ? kStuckPatience : kCallPatience;
    if (process_->call(FrameKind::kDeactivate, {}, rt::now() + patience)) return;
  }
  static_cast<void>(lose(was_active ? "exchange()" : "deactivate()"));
  if (was_active) make_safe();
}

/// The device may still apply the last command; configure() and deactivate() end that.
void IsolatedDriver::make_safe() noexcept {
  const Duration patience = std::exchange(config_.set_up_patience, kCallPatience);
  Writer write;
  write(driver_config_.period);
  const auto revived = revive();
  if (revived && call(FrameKind::kConfigure, write.bytes(), kCallPatience)) {
    static_cast<void>(call(FrameKind::kDeactivate, {}, kCallPatience));
  }
  config_.set_up_patience = patience;
}

expected<std::vector<std::byte>, SetupError> IsolatedDriver::send_parameters(
    const std::vector<ParameterSetting>& settings) {
  Writer write;
  write(settings);
  return call(FrameKind::kSetParameters, write.bytes(), kCallPatience);
}

expected<void, SetupError> IsolatedDriver::set_parameters(std::span<ParameterSetting> settings) {
  if (auto revived = revive(); !revived) return revived;
  const std::vector<ParameterSetting> wanted(settings.begin(), settings.end());
  const auto bytes = send_parameters(wanted);
  if (!bytes) return unexpected{bytes.error()};
  std::vector<ParameterSetting> taken;
  Reader read(*bytes);
  read(taken);
  if (!read.is_whole() || taken.size() != settings.size()) return unreadable();
  std::ranges::copy(taken, settings.begin());
  for (const ParameterSetting& setting : taken)
    parameters_[setting.name] = setting.value;
  return {};
}

std::unique_ptr<driver::Calibration> IsolatedDriver::make_calibration(std::string_view name) {
  Writer write;
  write(std::string(name));
  const auto bytes = call(FrameKind::kMakeCalibration, write.bytes(), kCallPatience);
  std::uint64_t id = 0;
  if (bytes) {
    Reader read(*bytes);
    read(id);
    if (!read.is_whole()) id = 0;
  }
  if (id == 0) return nullptr;
  return std::make_unique<IsolatedCalibration>(process_, id);
}

}  // namespace rtpm::driver_host
