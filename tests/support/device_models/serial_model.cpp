#include "serial_model.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "../../../devices/serial/firmware/rtpm_board/rtpm_frames.h"
#include "rtpm/base/hash.hpp"
#include "rtpm/device_serial/frames.hpp"

namespace rtpm::test {

using std::chrono::milliseconds;

const char* to_string(SerialFault fault) noexcept {
  static constexpr std::array kNames{
      "None",      "Silent",         "Deaf",      "Garbage",      "Noise",         "Split",
      "Glued",     "FlippedBit",     "Truncated", "WrongVersion", "WrongChecksum", "WrongLength",
      "WrongSize", "NotFinite",      "Duplicate", "Stale",        "Lost",          "Late",
      "Reset",     "ResetUnnoticed", "Stuck",     "HalfStuck",    "Unplugged"};
  static_assert(kNames.size() == static_cast<std::size_t>(kLastSerialFault) + 1);
  return kNames[static_cast<std::size_t>(fault)];
}

/// The sketch's board: a paddle, two analogs, a button and a lamp.
class SerialModel::Paddle final : public rtpm_board::Board {
 public:
  explicit Paddle(SerialModel& model) : Board(1, 1), model_(model) {}
  ~Paddle() = default;

  [[nodiscard]] float applied() const { return applied_; }
  [[nodiscard]] float lamp() const { return lamp_; }

 private:
  static constexpr float kEffortMax = 0.125F;

  void describe(rtpm_board::Writer& writer) override {
    writer.text("RTPM paddle");
    writer.text(model_.serial_.c_str());
    writer.u8(1);
    writer.text(model_.joint_name_.c_str());
    writer.u8(0);
    for (const float number : {-0.75F, 0.75F, kEffortMax})
      writer.number(number);
    writer.u8(2);
    for (const char* name : {"grip", "light"}) {
      writer.text(name);
      writer.text("1");
      writer.number(0);
      writer.number(1);
    }
    writer.u8(1);
    writer.text("button");
    writer.u8(1);
    writer.text("lamp");
    writer.text("1");
    for (const float number : {0.0F, 1.0F, 0.0F})
      writer.number(number);
  }
  [[nodiscard]] std::uint16_t rate_hz() const override { return 500; }
  void apply() override {
    applied_ = std::clamp(effort(0), -kEffortMax, kEffortMax);
    lamp_ = std::clamp(output(0), 0.0F, 1.0F);
    model_.greatest_effort_ = std::max(model_.greatest_effort_, std::abs(applied_));
  }
  [[nodiscard]] bool is_saturated() const override { return applied_ != effort(0); }
  void measure(rtpm_board::Writer& writer) override {
    const auto time_us =
        std::chrono::duration_cast<std::chrono::microseconds>(model_.now_.time_since_epoch());
    writer.u32(static_cast<std::uint32_t>(time_us.count()));
    writer.u16(model_.is_pressed_ ? 1 : 0);
    for (const float number : {model_.position_rad_, 0.0F, applied_, 0.25F, 0.5F, lamp_})
      writer.number(number);
  }
  [[nodiscard]] float safe_output(std::uint8_t) const override { return 0; }
  void send(const std::uint8_t* bytes, std::size_t size) override {
    model_.send(std::as_bytes(std::span(bytes, size)));
  }

  SerialModel& model_;
  float applied_ = 0;
  float lamp_ = 0;
};

SerialModel::SerialModel(SerialFault fault, std::uint64_t faulty_from)
    : fault_(fault), faulty_from_(faulty_from), paddle_(std::make_unique<Paddle>(*this)) {}
SerialModel::~SerialModel() = default;

bool SerialModel::is_faulty() const noexcept {
  // A port has its fault before it takes the frame, a board once it has the frame.
  const bool is_ports = fault_ == SerialFault::kStuck || fault_ == SerialFault::kUnplugged;
  return fault_ != SerialFault::kNone &&
         (is_ports ? host_frame_count_ >= faulty_from_ : host_frame_count_ > faulty_from_);
}

bool SerialModel::is_unplugged() const {
  return fault_ == SerialFault::kUnplugged && is_faulty();
}

void SerialModel::open(MonotonicTime now, bool resets) {
  now_ = std::max(now_, now);
  arriving_.clear();
  if (resets) reset(true);
}

/// A board that restarts applies no effort and knows no session.
void SerialModel::reset(bool is_announced) {
  paddle_ = std::make_unique<Paddle>(*this);
  arriving_.clear();
  boots_until_ = now_ + boot_time_;
  is_booting_ = true;
  is_announced_ = is_announced;
}

void SerialModel::advance(MonotonicTime now) {
  now_ = std::max(now_, now);
  if (is_booting_ && now_ >= boots_until_) {
    is_booting_ = false;
    if (is_announced_) paddle_->announce();
  }
  const auto now_ms = std::chrono::duration_cast<milliseconds>(now_.time_since_epoch());
  paddle_->watch(static_cast<std::uint32_t>(now_ms.count()));
}

std::size_t SerialModel::capacity() const {
  if (is_faulty() && fault_ == SerialFault::kStuck) return 0;
  if (is_faulty() && fault_ == SerialFault::kHalfStuck) return 3;
  return std::numeric_limits<std::size_t>::max();
}

std::size_t SerialModel::take(ConstBytes bytes, MonotonicTime now) {
  advance(now);
  bytes = bytes.first(std::min(bytes.size(), capacity()));
  const auto now_ms = std::chrono::duration_cast<milliseconds>(now_.time_since_epoch());
  for (const std::byte byte : bytes) {
    if (byte == std::byte{0}) ++host_frame_count_;
    const bool is_reset = fault_ == SerialFault::kReset || fault_ == SerialFault::kResetUnnoticed;
    if (is_faulty() && is_reset && !std::exchange(has_reset_, true))
      reset(fault_ == SerialFault::kReset);
    const bool is_deaf = is_faulty() && fault_ == SerialFault::kDeaf;
    if (!is_booting_ && !is_deaf)
      paddle_->take(std::to_integer<std::uint8_t>(byte),
                    static_cast<std::uint32_t>(now_ms.count()));
  }
  return bytes.size();
}

std::vector<std::byte> SerialModel::garbage() {
  std::vector<std::byte> bytes(40);
  for (std::byte& byte : bytes)
    byte = static_cast<std::byte>(random_());
  bytes.push_back(std::byte{0});
  return bytes;
}

void SerialModel::queue(std::vector<std::byte> bytes, Duration lateness) {
  arriving_.push_back({now_ + lateness, std::move(bytes)});
}

namespace {

/// The changed frame, with a checksum that fits unless `breaks_checksum`.
template <class Change>
std::vector<std::byte> changed(const std::vector<std::byte>& wire, Change&& change,
                               bool breaks_checksum = false) {
  using namespace device_serial;
  std::array<std::byte, kFrameSizeMax> buffer{};
  const auto frame = decode(ConstBytes(wire).first(wire.size() - 1), buffer);
  if (!frame) return wire;
  std::vector<std::byte> bytes(
      buffer.begin(),
      buffer.begin() + static_cast<std::ptrdiff_t>(kHeaderSize + frame->payload.size()));
  change(bytes);
  std::array<std::byte, 4> checksum{};
  store_le(checksum.data(), crc32(bytes) ^ (breaks_checksum ? 0x100U : 0U));
  bytes.insert(bytes.end(), checksum.begin(), checksum.end());
  // COBS, for frames of fewer than 254 bytes.
  std::vector<std::byte> stuffed{std::byte{0}};
  std::size_t code_at = 0;
  for (const std::byte byte : bytes) {
    if (byte != std::byte{0}) stuffed.push_back(byte);
    if (byte == std::byte{0}) {
      stuffed[code_at] = static_cast<std::byte>(stuffed.size() - code_at);
      code_at = stuffed.size();
      stuffed.push_back(std::byte{0});
    }
  }
  stuffed[code_at] = static_cast<std::byte>(stuffed.size() - code_at);
  stuffed.push_back(std::byte{0});
  return stuffed;
}

void set_not_finite(std::vector<std::byte>& frame) {
  constexpr std::size_t kFirstNumber = device_serial::kHeaderSize + 10;
  const bool is_state = frame[1] == std::byte{4};
  if (is_state) store_le(frame.data() + kFirstNumber, std::uint32_t{0x7fc00000});
}

}  // namespace

void SerialModel::send(ConstBytes wire) {
  std::vector<std::byte> bytes(wire.begin(), wire.end());
  ++board_frame_count_;
  const std::vector<std::byte> former = std::exchange(former_, bytes);
  switch (is_faulty() ? fault_ : SerialFault::kNone) {
    case SerialFault::kSilent:
      return;
    case SerialFault::kGarbage:
      return queue(garbage());
    case SerialFault::kNoise:
      queue(garbage());
      break;
    case SerialFault::kGlued:
      held_.insert(held_.end(), bytes.begin(), bytes.end());
      if (++held_count_ % 3 == 0) queue(std::exchange(held_, {}));
      return;
    case SerialFault::kFlippedBit:
      bytes[random_() % (bytes.size() - 1)] ^= static_cast<std::byte>(1U << (random_() % 8));
      break;
    case SerialFault::kTruncated:
      if (board_frame_count_ % 2 == 0) bytes.resize(bytes.size() / 2);
      break;
    case SerialFault::kWrongVersion:
      bytes = changed(bytes, [](auto& frame) { frame[0] = std::byte{2}; });
      break;
    case SerialFault::kWrongChecksum:
      bytes = changed(
          bytes, [](auto&) {}, true);
      break;
    case SerialFault::kWrongLength:
      bytes = changed(bytes, [](auto& frame) { frame[4] ^= std::byte{1}; });
      break;
    case SerialFault::kWrongSize:
      bytes = changed(bytes, [](auto& frame) {
        frame.pop_back();
        store_le(frame.data() + 4,
                 static_cast<std::uint16_t>(frame.size() - device_serial::kHeaderSize));
      });
      break;
    case SerialFault::kNotFinite:
      bytes = changed(bytes, set_not_finite);
      break;
    case SerialFault::kDuplicate:
      queue(bytes);
      break;
    case SerialFault::kStale:
      queue(std::move(bytes));
      return queue(former);
    case SerialFault::kLost:
      if (board_frame_count_ % 2 == 0) return;
      break;
    case SerialFault::kLate:
      return queue(std::move(bytes), kLateness);
    default:
      break;
  }
  queue(std::move(bytes));
}

MonotonicTime SerialModel::next_give() const {
  const MonotonicTime arrives = arriving_.empty() ? kNever : arriving_.front().due;
  return std::min(arrives, is_booting_ ? boots_until_ : kNever);
}

std::size_t SerialModel::give(MutableBytes buffer, MonotonicTime now) {
  advance(now);
  if (arriving_.empty() || arriving_.front().due > now_) return 0;
  std::vector<std::byte>& bytes = arriving_.front().bytes;
  const bool is_split = is_faulty() && fault_ == SerialFault::kSplit;
  const std::size_t size =
      std::min({bytes.size(), buffer.size(), is_split ? std::size_t{1} : buffer.size()});
  std::copy_n(bytes.begin(), size, buffer.begin());
  bytes.erase(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(size));
  if (bytes.empty()) arriving_.pop_front();
  return size;
}

void SerialModel::set_fault(SerialFault fault) {
  fault_ = fault;
}
void SerialModel::set_fault_now(SerialFault fault) {
  fault_ = fault;
  faulty_from_ = 0;
  has_reset_ = false;
}
void SerialModel::set_position(float rad) {
  position_rad_ = rad;
}
void SerialModel::press(bool is_pressed) {
  is_pressed_ = is_pressed;
}
void SerialModel::set_serial(std::string serial) {
  serial_ = std::move(serial);
}
void SerialModel::set_joint_name(std::string name) {
  joint_name_ = std::move(name);
}
float SerialModel::effort() const {
  return paddle_->applied();
}
float SerialModel::lamp() const {
  return paddle_->lamp();
}
float SerialModel::greatest_effort() const {
  return greatest_effort_;
}
std::uint64_t SerialModel::host_frame_count() const {
  return host_frame_count_;
}

device_serial::Transferred ScriptedSerialPort::send(ConstBytes bytes) {
  if (model_.is_unplugged()) return {0, true};
  const std::size_t size = model_.take(bytes, now_);
  return {size, model_.is_unplugged()};
}

device_serial::Transferred ScriptedSerialPort::receive(MutableBytes buffer, Duration patience) {
  if (model_.is_unplugged()) {
    model_.advance(now_ += patience);
    return {0, true};
  }
  const std::size_t size = model_.give(buffer, now_);
  if (size > 0) return {size, false};
  // Time advances in steps of the board's own loop, so that its watchdog acts in time.
  const Duration step = std::min<Duration>(patience, milliseconds{1});
  now_ = std::max(now_ + Duration{1}, std::min(now_ + step, model_.next_give()));
  model_.advance(now_);
  return {};
}

device_serial::OpenTransport open_model(std::shared_ptr<SerialModel> model, bool resets) {
  return [model = std::move(model), resets](const device_serial::PortSettings&)
             -> expected<std::unique_ptr<device_serial::Transport>, SetupError> {
    if (model->is_unplugged()) return setup_error("the model is not plugged in");
    return std::make_unique<ScriptedSerialPort>(*model, resets);
  };
}

}  // namespace rtpm::test
