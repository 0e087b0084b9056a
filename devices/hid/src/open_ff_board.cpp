#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "report.hpp"
#include "rtpm/device_hid/profiles.hpp"

namespace rtpm::device_hid {
namespace {

constexpr std::uint8_t kCommandReport = 0xa1;
constexpr std::size_t kCommandSize = 25;

enum class CommandType : std::uint8_t {
  kWrite = 0,
  kRequest = 1,
  kWriteAddress = 3,
  kNotFound = 13,
  kError = 15
};

struct Command {
  CommandType type{};
  std::uint16_t handler = 0;  ///< The class on the board that handles the command.
  std::uint32_t number = 0;
  std::int64_t value = 0;
  std::int64_t address = 0;
};

constexpr std::uint16_t kAxis = 0xa01;
constexpr std::uint32_t kAxisDegrees = 1;
constexpr std::uint16_t kEffects = 0xa03;
constexpr std::uint32_t kEffectsActive = 0;
constexpr std::uint32_t kEffectsReset = 1;
constexpr std::uint32_t kEffectsNew = 2;
constexpr std::uint32_t kEffectMagnitude = 4;
constexpr std::uint32_t kEffectState = 5;
constexpr std::int64_t kConstantForce = 1;
constexpr std::int64_t kMagnitudeMax = 32'767;
constexpr std::int64_t kEffectCountMax = 256;

constexpr Duration kAnswerMax = std::chrono::milliseconds{200};
constexpr int kAttemptCount = 3;

OutputReport report_of(const Command& command) noexcept {
  OutputReport report;
  report.size = kCommandSize;
  std::byte* const to = report.bytes.data();
  to[0] = std::byte{kCommandReport};
  to[1] = static_cast<std::byte>(command.type);
  store_le<std::uint16_t>(to + 2, command.handler);
  to[4] = std::byte{0};  // The first axis.
  store_le<std::uint32_t>(to + 5, command.number);
  store_le<std::uint64_t>(to + 9, static_cast<std::uint64_t>(command.value));
  store_le<std::uint64_t>(to + 17, static_cast<std::uint64_t>(command.address));
  return report;
}

std::optional<Command> command_of(ConstBytes report) noexcept {
  if (report.size() < kCommandSize || byte_at(report, 0) != kCommandReport) return std::nullopt;
  const std::byte* const from = report.data();
  return Command{static_cast<CommandType>(byte_at(report, 1)), load_le<std::uint16_t>(from + 2),
                 load_le<std::uint32_t>(from + 5),
                 static_cast<std::int64_t>(load_le<std::uint64_t>(from + 9)),
                 static_cast<std::int64_t>(load_le<std::uint64_t>(from + 17))};
}

/// Sends a command repeatedly until it is answered.
/// @return the value in the answer; nullopt if there was no answer or the board refused
std::optional<std::int64_t> ask(HidTransport& transport, const Command& command) {
  std::array<std::byte, kReportSizeMax> buffer{};
  for (int i = 0; i < kAttemptCount; ++i) {
    if (!transport.write(report_of(command).view())) continue;
    const MonotonicTime end = transport.now() + kAnswerMax;
    while (transport.now() < end) {
      const Received received = transport.read(buffer, end - transport.now());
      if (received.is_closed) return std::nullopt;
      const auto answer = command_of(ConstBytes(buffer).first(received.size));
      if (!answer || answer->handler != command.handler || answer->number != command.number) {
        continue;
      }
      const bool is_refused =
          answer->type == CommandType::kNotFound || answer->type == CommandType::kError;
      if (is_refused) return std::nullopt;
      return answer->value;
    }
  }
  return std::nullopt;
}

bool send(HidTransport& transport, const Command& command) {
  return transport.write(report_of(command).view());
}

constexpr std::array kAxisUsages{0x31, 0x32, 0x33, 0x34, 0x35, 0x36, 0x37};
constexpr std::array kAxisNames{"y", "z", "rx", "ry", "rz", "slider", "dial"};
constexpr std::uint32_t kWheelUsage = kDesktopPage + 0x30;

}  // namespace

driver::Descriptor OpenFfBoard::describe() const {
  driver::Descriptor descriptor;
  descriptor.device_class = driver::DeviceClass::kDial;
  descriptor.model = "OpenFFBoard";
  descriptor.joints = {{.name = "wheel", .unit = "rad", .effort_max = torque_max_}};
  for (std::size_t i = 0; i < driver::kButtonCountMax; ++i)
    descriptor.buttons.push_back("button_" + std::to_string(i + 1));
  for (std::size_t i = 0; i < kAxisNames.size(); ++i) {
    const bool is_slider = kAxisUsages[i] == 0x36;
    descriptor.analogs.push_back(
        {.name = kAxisNames[i], .unit = "1", .low = is_slider ? 0.0 : -1.0, .high = 1});
  }
  if (torque_max_ > 0) descriptor.modes = {driver::CommandMode::kJointEffort};
  descriptor.rate_hz = 1000;
  return descriptor;
}

/// The board repeats an unchanged report at least about every 0.1 s.
std::optional<Duration> OpenFfBoard::silence_max() const {
  return std::chrono::milliseconds{300};
}

expected<void, SetupError> OpenFfBoard::begin(HidTransport& transport, const Unit& unit) {
  const auto descriptor = parse_report_descriptor(unit.report_descriptor);
  const auto find = [&](std::uint32_t usage) -> std::optional<Field> {
    for (const Field& field : descriptor->inputs) {
      if (field.usage == usage && field.logical_low < field.logical_high) return field;
    }
    return std::nullopt;
  };
  if (descriptor) wheel_ = find(kWheelUsage);
  if (!descriptor || !wheel_) {
    return setup_error(unit.node + " is no force wheel", "its report descriptor has no X axis",
                       "select a main class with force feedback in the board's configurator");
  }
  layout_ = *descriptor;
  for (std::size_t i = 0; i < kAxisUsages.size(); ++i)
    axes_[i] = find(kDesktopPage + static_cast<std::uint32_t>(kAxisUsages[i]));
  for (std::size_t i = 0; i < buttons_.size(); ++i)
    buttons_[i] = find(kButtonPage + static_cast<std::uint32_t>(i) + 1);
  has_reference_ = false;
  const auto degrees = ask(transport, {CommandType::kRequest, kAxis, kAxisDegrees});
  constexpr std::int64_t kDegreesMax = 36'000;
  if (!degrees || *degrees <= 0 || *degrees > kDegreesMax) {
    return setup_error(unit.node + " does not answer", "its rotation range can't be read",
                       "update the board's firmware to 1.5 or newer");
  }
  range_rad_ = static_cast<double>(*degrees) * std::numbers::pi / 180;
  effect_ = -1;
  if (torque_max_ > 0) return begin_effect(transport);
  return {};
}

/// The reset ends effects left by a driver that was killed.
expected<void, SetupError> OpenFfBoard::begin_effect(HidTransport& transport) {
  std::optional<std::int64_t> effect;
  if (send(transport, {CommandType::kRequest, kEffects, kEffectsReset})) {
    effect = ask(transport, {CommandType::kWrite, kEffects, kEffectsNew, kConstantForce});
  }
  if (effect && *effect >= 0 && *effect < kEffectCountMax) {
    effect_ = *effect;
    if (send(transport, {CommandType::kWriteAddress, kEffects, kEffectMagnitude, 0, effect_}) &&
        send(transport, {CommandType::kWriteAddress, kEffects, kEffectState, 1, effect_}) &&
        send(transport, {CommandType::kWrite, kEffects, kEffectsActive, 1})) {
      return {};
    }
  }
  end(transport);
  return setup_error("OpenFFBoard makes no constant-force effect", "",
                     "update the board's firmware, or leave torque_newton_metre= out");
}

void OpenFfBoard::end(HidTransport& transport) noexcept {
  if (torque_max_ <= 0) return;
  static_cast<void>(send(transport, {CommandType::kRequest, kEffects, kEffectsReset}));
  effect_ = -1;
}

Verdict OpenFfBoard::take(ConstBytes report, MonotonicTime now, State& state) noexcept {
  if (report.empty() || !wheel_) return Verdict::kCorrupt;
  if (layout_.has_report_ids && byte_at(report, 0) != wheel_->report_id) return Verdict::kForeign;
  if (!has_size(report, layout_.input_sizes[wheel_->report_id])) return Verdict::kCorrupt;
  const auto wheel = value_of(*wheel_, report);
  if (!wheel) return Verdict::kCorrupt;
  state.joint = share_of(*wheel_, *wheel) * range_rad_ / 2;
  set_velocity(now, state);
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    const auto value = axes_[i] ? value_of(*axes_[i], report) : std::nullopt;
    if (value) state.analogs[i] = static_cast<float>(share_of(*axes_[i], *value));
  }
  std::uint32_t pressed = 0;
  for (std::size_t i = 0; i < buttons_.size(); ++i) {
    if (buttons_[i] && value_of(*buttons_[i], report).value_or(0) != 0) pressed |= 1U << i;
  }
  state.set_buttons(pressed);
  return Verdict::kNew;
}

/// Measures over at least kWindow, so that one encoder step within 1 ms does not appear as a high
/// speed.
void OpenFfBoard::set_velocity(MonotonicTime now, State& state) noexcept {
  constexpr Duration kWindow = std::chrono::milliseconds{8};
  const Duration elapsed = now - reference_time_;
  if (has_reference_ && elapsed < kWindow) return;
  if (has_reference_) {
    const double elapsed_s = std::chrono::duration<double>(elapsed).count();
    state.joint_velocity = (state.joint - reference_rad_) / elapsed_s;
  }
  has_reference_ = true;
  reference_time_ = now;
  reference_rad_ = state.joint;
}

OutputReport OpenFfBoard::encode(const Request& request) noexcept {
  if (effect_ < 0) return {};
  const double share =
      std::isfinite(request.effort) ? std::clamp(request.effort / torque_max_, -1.0, 1.0) : 0.0;
  const std::int64_t magnitude = std::llround(share * static_cast<double>(kMagnitudeMax));
  return report_of({CommandType::kWriteAddress, kEffects, kEffectMagnitude, magnitude, effect_});
}

}  // namespace rtpm::device_hid
