#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/device_serial/board.hpp"
#include "rtpm/device_serial/transport.hpp"

namespace rtpm::test {

/// The faults of a board or its line.
enum class SerialFault : std::uint8_t {
  kNone,
  kSilent,          ///< The board hears, but none of its bytes arrive.
  kDeaf,            ///< The board does not hear, so that it does not answer.
  kGarbage,         ///< Random bytes arrive in place of each frame.
  kNoise,           ///< Random bytes, and a delimiter, arrive in front of each frame.
  kSplit,           ///< Bytes arrive one at a time.
  kGlued,           ///< Frames arrive three at a time.
  kFlippedBit,      ///< One bit of each frame is flipped.
  kTruncated,       ///< Every other frame is cut in half, its delimiter missing.
  kWrongVersion,    ///< Frames are of version 2.
  kWrongChecksum,   ///< Frames have a wrong checksum.
  kWrongLength,     ///< Frames state a wrong length.
  kWrongSize,       ///< Payloads are a byte too short.
  kNotFinite,       ///< The first number of each payload is not a number.
  kDuplicate,       ///< Each frame arrives twice.
  kStale,           ///< Each frame is followed by an older one.
  kLost,            ///< Every other frame is missing.
  kLate,            ///< Each frame arrives kLateness later.
  kReset,           ///< The board starts again, once, and boots for kBootTime.
  kResetUnnoticed,  ///< The board resets, and its announcement is lost.
  kStuck,           ///< The port accepts no more bytes.
  kHalfStuck,       ///< The port takes three bytes at a time.
  kUnplugged,       ///< The port closes.
};
inline constexpr SerialFault kLastSerialFault = SerialFault::kUnplugged;
[[nodiscard]] const char* to_string(SerialFault fault) noexcept;

/// A board with a paddle, like the firmware in devices/serial, and a line with a fault. The board's
/// side of the frames is the firmware's own. It has no clock: every call states the time.
/// @threads  one at a time
class SerialModel {
 public:
  static constexpr Duration kBootTime = std::chrono::milliseconds{1500};
  static constexpr Duration kLateness = std::chrono::milliseconds{60};
  static constexpr const char* kSerial = "PADDLE-1";

  /// @param faulty_from  number of the frame from the host, from 0, with which the fault begins
  explicit SerialModel(SerialFault fault = SerialFault::kNone, std::uint64_t faulty_from = 0);
  ~SerialModel();

  /// Opens the port, which resets a board that resets on opening.
  void open(MonotonicTime now, bool resets);
  /// The number of bytes that the port accepts at once.
  [[nodiscard]] std::size_t capacity() const;
  /// Takes bytes from the host.
  /// @return how many the port accepts
  std::size_t take(ConstBytes bytes, MonotonicTime now);
  /// The bytes for the host that have arrived by now.
  std::size_t give(MutableBytes buffer, MonotonicTime now);
  /// The time when give() next returns bytes; kNever if something must happen first.
  [[nodiscard]] MonotonicTime next_give() const;
  /// Runs the board's loop until now.
  void advance(MonotonicTime now);
  [[nodiscard]] bool is_unplugged() const;
  [[nodiscard]] MonotonicTime now() const { return now_; }

  void set_fault(SerialFault fault);
  /// The fault begins now.
  void set_fault_now(SerialFault fault);
  void set_boot_time(Duration time) { boot_time_ = time; }
  /// Turns the paddle by hand.
  void set_position(float rad);
  void press(bool is_pressed);
  /// Sets the serial number in the next description.
  void set_serial(std::string serial);
  void set_joint_name(std::string name);

  /// The effort that the motor really applies.
  [[nodiscard]] float effort() const;
  [[nodiscard]] float lamp() const;
  /// The greatest magnitude that effort() ever had.
  [[nodiscard]] float greatest_effort() const;
  /// Frames that the host sent.
  [[nodiscard]] std::uint64_t host_frame_count() const;

 private:
  class Paddle;
  struct Arriving {
    MonotonicTime due;
    std::vector<std::byte> bytes;
  };
  [[nodiscard]] bool is_faulty() const noexcept;
  void send(ConstBytes wire);
  void reset(bool is_announced);
  void queue(std::vector<std::byte> bytes, Duration lateness = {});
  [[nodiscard]] std::vector<std::byte> garbage();

  SerialFault fault_;
  std::uint64_t faulty_from_;
  std::uint64_t host_frame_count_ = 0;
  bool has_reset_ = false;
  bool is_announced_ = true;
  MonotonicTime now_{std::chrono::seconds{1}};
  Duration boot_time_ = kBootTime;
  MonotonicTime boots_until_{};
  bool is_booting_ = false;
  std::string serial_ = kSerial;
  std::string joint_name_ = "paddle";
  std::deque<Arriving> arriving_{};
  std::vector<std::byte> held_{};  ///< The bytes that kGlued holds back.
  std::size_t held_count_ = 0;
  std::vector<std::byte> former_{};  ///< The older frame that kStale repeats.
  std::uint64_t board_frame_count_ = 0;
  std::mt19937_64 random_{1};
  float position_rad_ = 0.1F;
  bool is_pressed_ = false;
  float greatest_effort_ = 0;
  std::unique_ptr<Paddle> paddle_;
};

/// A port to a model on a simulated time line, which only receive() advances.
class ScriptedSerialPort final : public device_serial::Transport {
 public:
  /// @param resets  whether opening it resets the board
  explicit ScriptedSerialPort(SerialModel& model, bool resets = false)
      : model_(model), now_(model.now()) {
    model_.open(now_, resets);
  }

  [[nodiscard]] device_serial::Transferred send(ConstBytes bytes) override;
  [[nodiscard]] device_serial::Transferred receive(MutableBytes buffer, Duration patience) override;
  void wake() noexcept override {}
  [[nodiscard]] MonotonicTime now() const override { return now_; }

 private:
  SerialModel& model_;
  MonotonicTime now_;
};

/// Opens ScriptedPorts to the model, one after the other.
[[nodiscard]] device_serial::OpenTransport open_model(std::shared_ptr<SerialModel> model,
                                                      bool resets = false);

}  // namespace rtpm::test
