#pragma once

#include <array>
#include <memory>
#include <optional>
#include <string>

#include "rtpm/base/latest.hpp"
#include "rtpm/device_evdev/accumulator.hpp"
#include "rtpm/device_evdev/effects.hpp"
#include "rtpm/device_evdev/settings.hpp"
#include "rtpm/device_evdev/transport.hpp"
#include "rtpm/device_io/io_thread.hpp"
#include "rtpm/driver/driver.hpp"
#include "rtpm/rt/semaphore.hpp"

namespace rtpm::device_evdev {

/// An input device. Effects play only while exchange() is called: they end at the command's
/// deadline, and at the latest kHoldMax after the last exchange().
/// @threads  from activate() to deactivate() one thread reads events and another writes effects, so
///           that a slow write delays no event
class EvdevDriver : public driver::Driver {
 public:
  static constexpr Duration kHoldMax = std::chrono::milliseconds{250};
  /// Number of events read per period. The others wait in the kernel, which drops events when its
  /// buffer is full.
  static constexpr std::size_t kEventsPerPeriodMax = 1024;

  /// Reads the device's channels if it is plugged in.
  /// @realtime set-up only
  EvdevDriver(Access access, Settings settings, std::string frame);
  ~EvdevDriver() override;

  [[nodiscard]] driver::Descriptor describe() const override { return layout_.descriptor; }
  [[nodiscard]] expected<void, SetupError> configure(const driver::DriverConfig& config) override;
  [[nodiscard]] expected<void, SetupError> activate() override;
  [[nodiscard]] driver::ExchangeStatus exchange(const driver::Command& command,
                                                driver::Sample& sample) noexcept override;
  void deactivate() noexcept override;

 private:
  /// The last result of the reading thread.
  struct Report {
    State state{};
    std::uint64_t corrupt_count = 0;
    bool is_gone = false;
  };
  /// A request from exchange() to the writing thread.
  struct Request {
    Levels levels{};
    Duration hold{0};  ///< How long it stays valid without a newer request.
  };
  /// The last result of the writing thread.
  struct Applied {
    Levels levels{};
    EffectStatus status = EffectStatus::kOk;
  };

  void learn_channels();
  void take_channels(Layout layout);
  [[nodiscard]] expected<void, SetupError> start_threads();
  void stop() noexcept;
  [[nodiscard]] bool read_step() noexcept;
  [[nodiscard]] bool write_step() noexcept;
  void report(bool is_gone) noexcept;
  void limit_flood(std::size_t event_count) noexcept;
  [[nodiscard]] Request request_of(const driver::Command& command) const noexcept;
  void fill_applied(const driver::Command& command, const Applied& applied,
                    driver::Sample& sample) const noexcept;

  Access access_;
  Settings settings_;
  std::optional<Unit> known_{};
  Layout layout_{};
  Duration period_{};
  std::unique_ptr<Transport> transport_{};
  std::optional<Accumulator> accumulator_{};
  std::optional<EffectBank> effects_{};
  /// The state when deactivate() was last called.
  State before_{};
  bool is_active_ = false;
  std::uint64_t seen_corrupt_count_ = 0;
  std::uint64_t seen_lost_count_ = 0;
  std::uint64_t seen_report_count_ = 0;

  // Used only by the reading thread.
  std::array<Event, 64> events_{};
  std::uint64_t unreadable_count_ = 0;
  std::size_t flood_count_ = 0;
  MonotonicTime flood_since_{};
  // Used only by the writing thread.
  std::uint64_t seen_request_count_ = 0;
  MonotonicTime requested_at_{};

  Latest<Report> reports_{};
  Latest<Request> requests_{};
  Latest<Applied> applied_{};
  rt::Semaphore wake_writer_{};
  device_io::IoThread reader_{};
  device_io::IoThread writer_{};
};

}  // namespace rtpm::device_evdev
