#include "falcon_model.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "rtpm/device_falcon/kinematics.hpp"

namespace rtpm::test {
namespace {

using device_falcon::FtdiRequest;
using device_falcon::kFtdiStatusSize;
using device_falcon::kPacketSize;
using device_falcon::kUsbPacketSize;
using driver::Vector3;

constexpr double kCentreZMetres = 0.125;
constexpr double kGripKilogram = 0.3;
constexpr double kHandNewtonPerMetre = 300;
constexpr double kHandNewtonSecondPerMetre = 15;
/// The stops of the mechanism, about its centre.
constexpr double kReachMetres = 0.036;
constexpr double kStepSeconds = 0.0005;
constexpr double kChipHertz = 3'000'000;
constexpr int kBitsPerByte = 10;

constexpr std::array kGreeting{std::byte{0x0a}, std::byte{0x43}, std::byte{0x0d}};
constexpr std::array kGreetingReply{std::byte{0x0a}, std::byte{0x44}, std::byte{0x2c},
                                    std::byte{0x0d}};
constexpr std::byte kPrompt{0x41};

template <class... Values>
constexpr std::array<std::byte, sizeof...(Values)> bytes_of(Values... values) {
  return {static_cast<std::byte>(values)...};
}

/// USB 2.0, full speed, one configuration.
constexpr auto kDeviceDescriptor =
    bytes_of(18, 1, 0x00, 0x02, 0, 0, 0, 8, 0x03, 0x04, 0x48, 0xcb, 0x00, 0x06, 1, 2, 3, 1);
/// One interface of the vendor's class with the endpoints 0x81 and 0x02.
constexpr auto kConfigurationDescriptor = bytes_of(9, 2, 32, 0, 1, 1, 0, 0x80, 45,      //
                                                   9, 4, 0, 0, 2, 0xff, 0xff, 0xff, 2,  //
                                                   7, 5, 0x81, 2, 64, 0, 0,             //
                                                   7, 5, 0x02, 2, 64, 0, 0);

std::vector<std::byte> string_descriptor(std::string_view text) {
  std::vector<std::byte> bytes{static_cast<std::byte>(2 + 2 * text.size()), std::byte{3}};
  for (const char letter : text) {
    bytes.push_back(static_cast<std::byte>(letter));
    bytes.push_back(std::byte{0});
  }
  return bytes;
}

double seconds(Duration time) {
  return std::chrono::duration<double>(time).count();
}
Duration from_seconds(double time_s) {
  return std::chrono::duration_cast<Duration>(std::chrono::duration<double>(time_s));
}

}  // namespace

FalconModel::FalconModel(Config config)
    : config_(std::move(config)),
      mode_(config_.has_firmware ? Mode::kRunning : Mode::kHeld),
      homed_(config_.is_homed ? 0b111 : 0) {}

std::vector<std::byte> FalconModel::firmware() {
  std::vector<std::byte> bytes;
  std::uint32_t state = 1;
  for (std::size_t i = 0; i < kFirmwareSize; ++i) {
    state = state * 1'664'525 + 1'013'904'223;
    bytes.push_back(static_cast<std::byte>(state >> 24));
  }
  return bytes;
}

std::span<const std::byte> FalconModel::device_descriptor() {
  return kDeviceDescriptor;
}
std::span<const std::byte> FalconModel::configuration_descriptor() {
  return kConfigurationDescriptor;
}

void FalconModel::set_plan(const FalconFaultPlan& plan) noexcept {
  config_.plan = plan;
  event_counts_ = {};
  present_fault_ = FalconFault::kNone;
}

void FalconModel::plug_in() noexcept {
  is_plugged_in_ = true;
  present_fault_ = FalconFault::kNone;
  pending_.clear();
}

/// Counts the event; false if the device is absent or refuses it.
bool FalconModel::begin_event(FalconStep step) {
  const std::uint64_t number = event_counts_[static_cast<std::size_t>(step)]++;
  const FalconFaultPlan& plan = config_.plan;
  const bool is_faulty =
      plan.step == step && number >= plan.from && number - plan.from < plan.count;
  present_fault_ = is_faulty ? plan.fault : FalconFault::kNone;
  if (has(FalconFault::kNoDevice)) unplug();
  return is_plugged_in_ && !has(FalconFault::kStall);
}

bool FalconModel::has(FalconFault fault) const noexcept {
  return present_fault_ == fault;
}

UsbAnswer FalconModel::control(const UsbSetup& setup, std::span<std::byte> data) {
  if (!is_plugged_in_) return {UsbReply::kNoDevice};
  if (setup.type != device_falcon::kVendorRequestType) return standard_request(setup, data);
  if (!begin_event(FalconStep::kRequest)) {
    return {is_plugged_in_ ? UsbReply::kStall : UsbReply::kNoDevice};
  }
  if (has(FalconFault::kNoAnswer)) return {UsbReply::kNothingYet};
  return {vendor_request(setup) ? UsbReply::kOk : UsbReply::kStall};
}

UsbAnswer FalconModel::standard_request(const UsbSetup& setup, std::span<std::byte> data) const {
  constexpr std::uint8_t kGetDescriptor = 6;
  constexpr std::uint8_t kToHost = 0x80;
  if ((setup.type & kToHost) == 0) return {};  // The model ignores what the host sets.
  if (setup.request != kGetDescriptor) {
    std::ranges::fill(data, std::byte{0});
    return {UsbReply::kOk, data.size()};
  }
  std::vector<std::byte> bytes;
  const int index = setup.value & 0xff;
  switch (setup.value >> 8) {
    case 1:
      bytes.assign(kDeviceDescriptor.begin(), kDeviceDescriptor.end());
      break;
    case 2:
      bytes.assign(kConfigurationDescriptor.begin(), kConfigurationDescriptor.end());
      break;
    case 3:
      bytes = index == 0 ? std::vector{std::byte{4}, std::byte{3}, std::byte{9}, std::byte{4}}
                         : string_descriptor(index == 1   ? "NOVINT"
                                             : index == 2 ? "FALCON HAPTIC"
                                                          : config_.serial);
      break;
    default:
      return {UsbReply::kStall};
  }
  const std::size_t size = std::min(bytes.size(), data.size());
  std::copy_n(bytes.begin(), size, data.begin());
  return {UsbReply::kOk, size};
}

/// Handles a vendor request; false if the chip does not know it.
bool FalconModel::vendor_request(const UsbSetup& setup) {
  switch (static_cast<FtdiRequest>(setup.request)) {
    case FtdiRequest::kReset:
      if (setup.value == device_falcon::kPurgeReceived) pending_.clear();
      return setup.value <= 2;
    case FtdiRequest::kModemControl:
      // The edge resets the processor into its boot loader; the firmware is lost.
      if (setup.value == device_falcon::kDtrHigh && !is_dtr_high_) {
        mode_ = Mode::kBoot;
        received_.clear();
      }
      if ((setup.value & 0x0100) != 0) is_dtr_high_ = (setup.value & 1) != 0;
      return true;
    case FtdiRequest::kBaudRate:
      divisor_ = setup.value;
      if (mode_ == Mode::kLoaded && divisor_ == device_falcon::kRunDivisor) {
        mode_ = Mode::kRunning;
        received_.clear();
      }
      return true;
    case FtdiRequest::kLatencyTimer:
      latency_ = std::chrono::milliseconds{std::max<std::uint16_t>(setup.value, 1)};
      return setup.value <= 255;
    case FtdiRequest::kFlowControl:
    case FtdiRequest::kDataBits:
      return true;
  }
  return false;
}

FalconStep FalconModel::step_of_write() const noexcept {
  if (mode_ == Mode::kLoading) return FalconStep::kFirmware;
  if (mode_ == Mode::kGreeted && divisor_ == device_falcon::kLoadDivisor) {
    return FalconStep::kPrompt;
  }
  return divisor_ == device_falcon::kBootDivisor ? FalconStep::kGreeting : FalconStep::kPacket;
}

UsbAnswer FalconModel::write(std::span<const std::byte> bytes) {
  if (!is_plugged_in_) return {UsbReply::kNoDevice};
  if (!begin_event(step_of_write())) {
    return {is_plugged_in_ ? UsbReply::kStall : UsbReply::kNoDevice};
  }
  switch (mode_) {
    case Mode::kBoot:
    case Mode::kGreeted:
      boot(bytes);
      break;
    case Mode::kLoading:
      load(bytes);
      break;
    case Mode::kRunning:
      if (divisor_ == device_falcon::kRunDivisor) run(bytes);
      break;
    case Mode::kHeld:
    case Mode::kLoaded:
      break;
  }
  return {};
}

void FalconModel::boot(std::span<const std::byte> bytes) {
  if (divisor_ == device_falcon::kBootDivisor && std::ranges::equal(bytes, kGreeting)) {
    mode_ = Mode::kGreeted;
    answer({kGreetingReply.begin(), kGreetingReply.end()}, bytes);
  } else if (mode_ == Mode::kGreeted && divisor_ == device_falcon::kLoadDivisor && !is_dtr_high_ &&
             bytes.size() == 1 && bytes[0] == kPrompt) {
    mode_ = Mode::kLoading;
    received_.clear();
    answer({kPrompt}, bytes);
  }
}

void FalconModel::load(std::span<const std::byte> bytes) {
  if (divisor_ != device_falcon::kLoadDivisor) return;
  received_.insert(received_.end(), bytes.begin(), bytes.end());
  if (received_.size() == kFirmwareSize && received_ == firmware()) mode_ = Mode::kLoaded;
  answer({bytes.begin(), bytes.end()}, bytes);
}

/// The firmware takes packets out of the stream, however it is split.
void FalconModel::run(std::span<const std::byte> bytes) {
  for (const std::byte byte : bytes) {
    if (byte == std::byte{'<'}) received_.clear();
    received_.push_back(byte);
    if (received_.size() < kPacketSize) continue;
    const auto request = device_falcon::decode_request(std::span(received_).first<kPacketSize>());
    received_.clear();
    if (request) answer_packet(*request);
  }
}

void FalconModel::answer_packet(const device_falcon::MotorRequest& request) {
  ++packet_count_;
  motors_ = request.counts;
  flags_ = request.flags;
  device_falcon::EncoderReport report{.buttons = buttons_, .homed = homed_};
  if (const auto angles = device_falcon::inverse(position_m_)) {
    const auto counts = device_falcon::encoder_counts(angles->upper);
    for (std::size_t leg = 0; leg < counts.size(); ++leg) {
      report.counts[leg] = static_cast<std::int16_t>(std::lround(counts[leg]));
    }
  }
  if (has(FalconFault::kEncoderJump)) {
    report.counts[0] = static_cast<std::int16_t>(report.counts[0] + kJumpCounts);
  }
  if (has(FalconFault::kHomedBitLost)) report.homed &= 0b101;
  if (has(FalconFault::kStuckButton)) report.buttons |= 0b0100;
  const device_falcon::Packet packet = encode(report);
  const device_falcon::Packet sent = encode(request);
  answer({packet.begin(), packet.end()}, sent);
}

/// Puts an answer into the chip's buffer, damaged as the fault says.
void FalconModel::answer(std::vector<std::byte> bytes, std::span<const std::byte> request) {
  Pending pending{.due = due_of(bytes.size()), .bytes = std::move(bytes)};
  std::vector<std::byte>& damaged = pending.bytes;
  const auto change = [](std::byte& byte) { byte ^= std::byte{0xff}; };
  switch (present_fault_) {
    case FalconFault::kNoAnswer:
    case FalconFault::kStatusOnly:
      return;
    case FalconFault::kOverflow:
      is_overflowing_ = true;
      return;
    case FalconFault::kLate:
      pending.due += kLateness;
      break;
    case FalconFault::kShort:
      damaged.pop_back();
      break;
    case FalconFault::kFlippedByte:
      change(damaged[damaged.size() / 2]);
      break;
    case FalconFault::kNoStartMark:
      change(damaged.front());
      break;
    case FalconFault::kNoEndMark:
      change(damaged.back());
      break;
    case FalconFault::kWrongEcho:
      damaged.assign(request.begin(), request.end());
      std::ranges::for_each(damaged, change);
      break;
    case FalconFault::kSplit: {
      const auto middle = damaged.begin() + static_cast<std::ptrdiff_t>(damaged.size() / 2);
      pending_.push_back({pending.due, {damaged.begin(), middle}, true});
      damaged.erase(damaged.begin(), middle);
      break;
    }
    case FalconFault::kGlued:
      held_.insert(held_.end(), damaged.begin(), damaged.end());
      if (held_.size() < 2 * damaged.size()) return;
      damaged = std::exchange(held_, {});
      break;
    default:
      break;
  }
  pending_.push_back(std::move(pending));
}

/// The bytes take time on the wire both ways; fewer than fill a USB packet wait for the chip's
/// latency timer.
MonotonicTime FalconModel::due_of(std::size_t size) const {
  // The high bits are eighths, which do not matter here.
  const double byte_s = kBitsPerByte * std::max(divisor_ & 0x3fff, 1) / kChipHertz;
  const MonotonicTime ready = now_ + from_seconds(2 * byte_s * static_cast<double>(size));
  if (size >= kUsbPacketSize - kFtdiStatusSize) return ready;
  const Duration tick = from_seconds(seconds(latency_) / (1 + config_.drift_ppm * 1e-6));
  return MonotonicTime{tick * (ready.time_since_epoch() / tick + 1)};
}

UsbAnswer FalconModel::read(std::span<std::byte> buffer) {
  if (!is_plugged_in_) return {UsbReply::kNoDevice};
  if (has(FalconFault::kStall)) return {UsbReply::kStall};
  if (std::exchange(is_overflowing_, false)) return {UsbReply::kOverflow};
  if (has(FalconFault::kNoAnswer)) return {UsbReply::kNothingYet};
  std::vector<std::byte> payload;
  while (!pending_.empty() && pending_.front().due <= now_) {
    const bool ends_transfer = pending_.front().ends_transfer;
    payload.insert(payload.end(), pending_.front().bytes.begin(), pending_.front().bytes.end());
    pending_.pop_front();
    if (ends_transfer) break;
  }
  if (payload.empty() && now_ < next_status_) return {UsbReply::kNothingYet};
  next_status_ = now_ + latency_;
  std::size_t size = 0;
  std::size_t taken = 0;
  do {
    if (size + kUsbPacketSize > buffer.size()) return {UsbReply::kOverflow};
    buffer[size++] = std::byte{0x01};
    buffer[size++] = std::byte{0x60};
    const std::size_t part = std::min(payload.size() - taken, kUsbPacketSize - kFtdiStatusSize);
    std::copy_n(payload.begin() + static_cast<std::ptrdiff_t>(taken), part,
                buffer.begin() + static_cast<std::ptrdiff_t>(size));
    size += part;
    taken += part;
  } while (taken < payload.size());
  return {UsbReply::kOk, size};
}

void FalconModel::advance(Duration time) {
  now_ += time;
  if (mode_ != Mode::kRunning) return;
  lag_s_ += seconds(time) * (1 + config_.drift_ppm * 1e-6);
  for (; lag_s_ >= kStepSeconds; lag_s_ -= kStepSeconds)
    move(kStepSeconds);
}

void FalconModel::move(double span_s) {
  Vector3 motors_newton{};
  if (!has(FalconFault::kTorqueIgnored)) {
    motors_newton = device_falcon::force_of(motors_, position_m_, kCountsPerNewtonMetre);
  }
  const auto move_axis = [&](double& at, double& velocity, double hand, double motor_newton) {
    const double newton =
        motor_newton + kHandNewtonPerMetre * (hand - at) - kHandNewtonSecondPerMetre * velocity;
    velocity += newton / kGripKilogram * span_s;
    at += velocity * span_s;
    if (std::abs(at) <= kReachMetres) return;
    at = std::clamp(at, -kReachMetres, kReachMetres);
    velocity = 0;
  };
  Vector3 at{position_m_.x, position_m_.y, position_m_.z - kCentreZMetres};
  move_axis(at.x, velocity_m_per_s_.x, hand_m_.x, motors_newton.x);
  move_axis(at.y, velocity_m_per_s_.y, hand_m_.y, motors_newton.y);
  move_axis(at.z, velocity_m_per_s_.z, hand_m_.z, motors_newton.z);
  position_m_ = {at.x, at.y, at.z + kCentreZMetres};
}

}  // namespace rtpm::test
