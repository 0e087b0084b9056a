#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "rtpm/base/time.hpp"
#include "rtpm/device_falcon/ftdi.hpp"
#include "rtpm/device_falcon/protocol.hpp"
#include "rtpm/driver/geometry.hpp"

namespace rtpm::test {

/// The faults of a Falcon.
enum class FalconFault : std::uint8_t {
  kNone,
  kNoAnswer,       ///< Nothing comes, not even status bytes.
  kLate,           ///< Each answer comes FalconModel::kLateness later.
  kShort,          ///< The last byte of each answer is missing.
  kSplit,          ///< Each answer comes in two transfers.
  kGlued,          ///< An answer waits for the next one: both come in one transfer.
  kFlippedByte,    ///< One byte of each answer is wrong.
  kNoStartMark,    ///< The first byte of each answer is wrong.
  kNoEndMark,      ///< The last byte of each answer is wrong.
  kWrongEcho,      ///< The answer has the host's bytes, all changed.
  kStatusOnly,     ///< The chip sends its status, and no answers.
  kStall,          ///< The device refuses every transfer.
  kOverflow,       ///< Each answer is lost, being larger than the buffer.
  kNoDevice,       ///< Unplugged.
  kEncoderJump,    ///< The encoders read kJumpCounts more.
  kHomedBitLost,   ///< One leg has lost its reference.
  kStuckButton,    ///< A button is pressed for good.
  kTorqueIgnored,  ///< The motors do nothing.
};
inline constexpr FalconFault kLastFalconFault = FalconFault::kTorqueIgnored;

/// Steps of the protocol. Each counts its own events.
enum class FalconStep : std::uint8_t {
  kRequest,   ///< A vendor request.
  kGreeting,  ///< A greeting to the boot loader.
  kPrompt,    ///< 'A', in front of the firmware.
  kFirmware,  ///< A block of the firmware.
  kPacket,    ///< A packet to or from running firmware.
};
inline constexpr FalconStep kLastFalconStep = FalconStep::kPacket;
inline constexpr std::uint64_t kForGood = std::numeric_limits<std::uint64_t>::max();

/// One fault: at `count` events of a step, from the event `from` on, counted from 0.
struct FalconFaultPlan {
  FalconFault fault = FalconFault::kNone;
  FalconStep step = FalconStep::kPacket;
  std::uint64_t from = 0;
  std::uint64_t count = kForGood;
};

/// The eight bytes of a control transfer.
/// @source   USB 2.0, 9.3
struct UsbSetup {
  std::uint8_t type = 0;
  std::uint8_t request = 0;
  std::uint16_t value = 0;
  std::uint16_t index = 0;
  std::uint16_t length = 0;
};

/// How the model answers a transfer.
enum class UsbReply : std::uint8_t { kOk, kNothingYet, kStall, kOverflow, kNoDevice };
struct UsbAnswer {
  UsbReply reply = UsbReply::kOk;
  std::size_t size = 0;  ///< Bytes to the host.
};

/// The options of a model.
struct FalconModelConfig {
  std::string serial = "FALCON01";
  bool has_firmware = true;
  bool is_homed = true;
  /// The device's clock is faster by this much.
  double drift_ppm = 0;
  FalconFaultPlan plan{};
};

/// A Novint Falcon as its USB port shows it: descriptors, the FTDI chip, the boot loader, the
/// firmware's packets, and the grip in a hand that holds it softly. Only advance() moves time on.
/// After an unplugging the motors hold, since the real device's behaviour is unknown.
/// @threads  one at a time
class FalconModel {
 public:
  using Config = FalconModelConfig;
  static constexpr Duration kLateness = std::chrono::milliseconds{12};
  /// The jump is so small that the mechanism could reach the position.
  static constexpr std::int16_t kJumpCounts = 700;
  static constexpr std::size_t kFirmwareSize = 7500;
  static constexpr double kCountsPerNewtonMetre = 10'000;

  explicit FalconModel(Config config = {});

  /// A control transfer; `data` has UsbSetup::length bytes, to be filled or read.
  [[nodiscard]] UsbAnswer control(const UsbSetup& setup, std::span<std::byte> data);
  /// A transfer to endpoint 2.
  [[nodiscard]] UsbAnswer write(std::span<const std::byte> bytes);
  /// A transfer from endpoint 1; kNothingYet if the host must ask again later.
  [[nodiscard]] UsbAnswer read(std::span<std::byte> buffer);
  void advance(Duration time);
  [[nodiscard]] MonotonicTime now() const noexcept { return now_; }

  /// The firmware that the boot loader takes, which is made for tests and not a real device's.
  [[nodiscard]] static std::vector<std::byte> firmware();
  /// The device and configuration descriptors, as a USB host reads them.
  [[nodiscard]] static std::span<const std::byte> device_descriptor();
  [[nodiscard]] static std::span<const std::byte> configuration_descriptor();

  [[nodiscard]] const std::string& serial() const noexcept { return config_.serial; }
  /// The last command that the motors got.
  [[nodiscard]] const device_falcon::LegCounts& motor_counts() const noexcept { return motors_; }
  [[nodiscard]] bool has_force() const noexcept { return motors_ != device_falcon::LegCounts{}; }
  [[nodiscard]] std::uint8_t leds() const noexcept { return flags_ & 0b1110; }
  [[nodiscard]] std::uint64_t packet_count() const noexcept { return packet_count_; }
  [[nodiscard]] std::uint64_t event_count(FalconStep step) const noexcept {
    return event_counts_[static_cast<std::size_t>(step)];
  }
  [[nodiscard]] bool runs_firmware() const noexcept { return mode_ == Mode::kRunning; }
  /// The grip, in the mechanism's frame.
  [[nodiscard]] const driver::Vector3& position_m() const noexcept { return position_m_; }

  /// The hand's position of the grip, relative to the middle of the workspace.
  void hold_at(const driver::Vector3& hand_m) noexcept { hand_m_ = hand_m; }
  void press(std::uint8_t buttons) noexcept { buttons_ = buttons; }
  void set_homed(std::uint8_t homed) noexcept { homed_ = homed; }
  /// Ends the fault, or begins another, with the next event.
  void set_plan(const FalconFaultPlan& plan) noexcept;
  [[nodiscard]] bool is_plugged_in() const noexcept { return is_plugged_in_; }
  void unplug() noexcept { is_plugged_in_ = false; }
  /// Plugs it in again, at another address; its power was never off.
  void plug_in() noexcept;

 private:
  enum class Mode : std::uint8_t { kHeld, kBoot, kGreeted, kLoading, kLoaded, kRunning };
  struct Pending {
    MonotonicTime due;
    std::vector<std::byte> bytes;
    bool ends_transfer = false;
  };

  [[nodiscard]] bool begin_event(FalconStep step);
  [[nodiscard]] bool has(FalconFault fault) const noexcept;
  [[nodiscard]] FalconStep step_of_write() const noexcept;
  [[nodiscard]] UsbAnswer standard_request(const UsbSetup& setup, std::span<std::byte> data) const;
  [[nodiscard]] bool vendor_request(const UsbSetup& setup);
  void boot(std::span<const std::byte> bytes);
  void load(std::span<const std::byte> bytes);
  void run(std::span<const std::byte> bytes);
  void answer_packet(const device_falcon::MotorRequest& request);
  void answer(std::vector<std::byte> bytes, std::span<const std::byte> request);
  [[nodiscard]] MonotonicTime due_of(std::size_t size) const;
  void move(double span_s);

  Config config_;
  Mode mode_;
  bool is_plugged_in_ = true;
  /// The fault of the last event that counted.
  FalconFault present_fault_ = FalconFault::kNone;
  bool is_overflowing_ = false;
  std::array<std::uint64_t, static_cast<std::size_t>(kLastFalconStep) + 1> event_counts_{};
  MonotonicTime now_{std::chrono::seconds{100}};
  double lag_s_ = 0;
  bool is_dtr_high_ = true;
  std::uint16_t divisor_ = 0;
  Duration latency_ = std::chrono::milliseconds{16};
  MonotonicTime next_status_{};
  std::deque<Pending> pending_{};
  std::vector<std::byte> held_{};
  std::vector<std::byte> received_{};
  device_falcon::LegCounts motors_{};
  std::uint8_t flags_ = 0;
  std::uint64_t packet_count_ = 0;
  std::uint8_t buttons_ = 0;
  std::uint8_t homed_;
  driver::Vector3 hand_m_{};
  driver::Vector3 position_m_{0, 0, 0.125};
  driver::Vector3 velocity_m_per_s_{};
};

}  // namespace rtpm::test
