#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <vector>

#include "rtpm/device_evdev/transport.hpp"

namespace rtpm::test {

/// The faults of an input device.
enum class EvdevFault : std::uint8_t {
  kNone,
  kShortRead,    ///< Each read gives part of an event.
  kGarbage,      ///< Each read gives events of random numbers.
  kDropped,      ///< The kernel's buffer overflows before each read.
  kLostReport,   ///< No SYN_REPORT ends a report.
  kOutOfRange,   ///< Each axis is far beyond its range.
  kClockAhead,   ///< The events' times are an hour in the future.
  kClockBehind,  ///< The events' times are before the device was opened.
  kFlood,        ///< Each read gives as many events as fit.
  kUploadFails,  ///< EVIOCSFF fails with EIO.
  kNoSlots,      ///< EVIOCSFF fails with ENOSPC.
  kPlayFails,    ///< Writing an effect's start or stop fails with EIO.
  kEraseFails,   ///< EVIOCRMFF fails with EINVAL.
  kInterrupted,  ///< Each second write fails with EBUSY.
  kGone,         ///< Unplugged: everything fails with ENODEV.
};
inline constexpr EvdevFault kLastEvdevFault = EvdevFault::kGone;

/// A model of one input device and of the kernel's side of its node, with faults. Only the test
/// sets its time. It outlives its unplugging, and the transports that the driver opens.
/// @threads  any
class EvdevModel {
 public:
  using Capabilities = device_evdev::Capabilities;
  using Event = device_evdev::Event;
  using Levels = device_evdev::Levels;

  explicit EvdevModel(Capabilities capabilities);

  /// A game pad with rumble, as the kernel's driver xpad reports it.
  [[nodiscard]] static Capabilities pad();
  /// A steering wheel with motor, pedals and paddles.
  [[nodiscard]] static Capabilities wheel();
  /// A dial that turns without end and can be pushed.
  [[nodiscard]] static Capabilities dial();

  /// The user's actions. Nothing is reported before report().
  void move(std::uint16_t axis, std::int32_t value);
  void turn(std::uint16_t relative_axis, std::int32_t step);
  void press(std::uint16_t key, bool is_down);
  void report();

  void advance(Duration time);
  /// @param from  the number of the read and of the write, from 0, with which the fault begins
  void set_fault(EvdevFault fault, std::uint64_t from = 0);
  /// After unplug() and plug_in() it has another node.
  void unplug();
  void plug_in();
  /// Lets writes block until this is called again with false.
  void set_blocked(bool is_blocked);

  /// The actuators' current levels: the sum of the playing effects.
  [[nodiscard]] Levels levels() const;
  [[nodiscard]] bool is_still() const { return levels() == Levels{}; }
  /// The number of uploaded effects, and of those that the kernel had to erase because a program
  /// closed the node without doing so.
  [[nodiscard]] std::size_t effect_count() const;
  [[nodiscard]] std::size_t abandoned_count() const;
  /// Whether a program closed the node while an effect played.
  [[nodiscard]] bool was_left_playing() const;
  [[nodiscard]] std::uint64_t upload_count() const;
  [[nodiscard]] std::uint64_t new_effect_count() const;
  [[nodiscard]] double gain() const;
  [[nodiscard]] bool has_autocenter() const;
  [[nodiscard]] bool is_grabbed() const;
  [[nodiscard]] bool is_plugged_in() const;
  [[nodiscard]] std::size_t waiting_event_count() const;

  [[nodiscard]] device_evdev::Unit unit() const;
  void set_unit(const device_evdev::Unit& unit);
  /// A machine with this device alone.
  [[nodiscard]] device_evdev::Access access();

  // The kernel's side, for a transport.
  [[nodiscard]] bool open(bool is_grabbed);
  void close();
  [[nodiscard]] Capabilities capabilities() const;
  [[nodiscard]] device_evdev::ReadResult read(std::span<Event> events);
  [[nodiscard]] int upload(device_evdev::Effect& effect);
  [[nodiscard]] int erase(int id);
  [[nodiscard]] int play(int id, bool is_on);
  [[nodiscard]] int set_gain(double share);
  [[nodiscard]] int disable_autocenter();
  [[nodiscard]] MonotonicTime now() const;

 private:
  struct Uploaded {
    device_evdev::Effect effect{};
    bool is_playing = false;
    MonotonicTime started_at{};
  };
  using Lock = std::unique_lock<std::mutex>;

  [[nodiscard]] Levels levels_locked() const;
  [[nodiscard]] bool is_faulty_read(EvdevFault fault) const;
  [[nodiscard]] int begin_write(Lock& lock, EvdevFault fault, int error);
  void push(std::uint16_t type, std::uint16_t code, std::int32_t value);
  void push_state();
  void spoil_events();
  [[nodiscard]] std::uint32_t random();

  mutable std::mutex mutex_{};
  std::condition_variable changed_{};
  Capabilities capabilities_;
  device_evdev::Unit unit_{};
  std::map<std::uint16_t, std::int32_t> axes_{};
  std::set<std::uint16_t> pressed_{};
  std::deque<Event> events_{};
  std::map<int, Uploaded> effects_{};
  MonotonicTime now_{std::chrono::seconds{1000}};
  EvdevFault fault_ = EvdevFault::kNone;
  std::uint64_t faulty_from_ = 0;
  std::uint64_t read_count_ = 0;
  std::uint64_t write_count_ = 0;
  std::uint64_t upload_count_ = 0;
  int next_effect_id_ = 0;
  int node_number_ = 5;
  std::size_t abandoned_count_ = 0;
  bool was_left_playing_ = false;
  double gain_ = 0.25;
  std::uint32_t random_ = 1;
  bool has_autocenter_ = true;
  bool is_open_ = false;
  bool is_grabbed_ = false;
  bool is_plugged_in_ = true;
  bool is_blocked_ = false;
};

}  // namespace rtpm::test
