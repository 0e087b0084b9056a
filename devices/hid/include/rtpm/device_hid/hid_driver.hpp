#pragma once

#include <memory>
#include <optional>
#include <string>

#include "rtpm/base/latest.hpp"
#include "rtpm/device_hid/profile.hpp"
#include "rtpm/device_hid/session.hpp"
#include "rtpm/device_hid/settings.hpp"
#include "rtpm/device_hid/transport.hpp"
#include "rtpm/device_io/io_thread.hpp"
#include "rtpm/driver/driver.hpp"
#include "rtpm/rt/semaphore.hpp"

namespace rtpm::device_hid {

/// A HID device. From activate() to deactivate() one thread reads reports and another writes, so
/// that a slow write delays no read. If no newer command arrives by the deadline, the writing
/// thread sets the outputs to their safe values.
class HidDriver final : public driver::Driver {
 public:
  /// How long configure() waits for the first report of a device that reports continuously.
  static constexpr Duration kFirstReportMax = std::chrono::seconds{1};

  /// Looks for the unit in order to describe it; it need not be plugged in.
  /// @param device_name  for example "pad0"; its frame is then "pad0/base"
  /// @errors   several units match; none is plugged in, and the kind is not given
  [[nodiscard]] static expected<std::unique_ptr<HidDriver>, SetupError> create(
      std::shared_ptr<HidSystem> system, Settings settings, std::string_view device_name);
  ~HidDriver() override;

  [[nodiscard]] driver::Descriptor describe() const override { return descriptor_; }
  [[nodiscard]] expected<void, SetupError> configure(const driver::DriverConfig& config) override;
  [[nodiscard]] expected<void, SetupError> activate() override;
  [[nodiscard]] driver::ExchangeStatus exchange(const driver::Command& command,
                                                driver::Sample& sample) noexcept override;
  void deactivate() noexcept override;

 private:
  /// The last result of the reading thread.
  struct Report {
    State state{};
    MonotonicTime measured_at = kNever;
    std::uint64_t corrupt_count = 0;
    bool is_late = false;
    bool is_gone = false;
  };
  /// A task for the writing thread.
  struct Order {
    Request request{};
    MonotonicTime valid_until = kNever;  ///< In the host's time.
  };
  /// The last result of the writing thread.
  struct Delivery {
    Request request{};
    bool is_refused = false;
    bool is_gone = false;
  };

  HidDriver(std::shared_ptr<HidSystem> system, Settings settings, std::unique_ptr<Profile> profile,
            driver::Descriptor descriptor);
  [[nodiscard]] expected<Unit, SetupError> find_unit();
  [[nodiscard]] expected<void, SetupError> start_session(const Unit& unit);
  [[nodiscard]] Request request_of(const driver::Command& command) const noexcept;
  void give_order(const driver::Command& command, const Request& request) noexcept;
  void report(bool is_gone) noexcept;
  [[nodiscard]] bool read_step();
  [[nodiscard]] bool write_step();
  void stop_threads() noexcept;

  std::shared_ptr<HidSystem> system_;
  Settings settings_;
  std::unique_ptr<Profile> profile_;
  driver::Descriptor descriptor_;
  Request safe_{};
  std::optional<Identity> identity_{};
  Duration period_{};
  std::unique_ptr<HidTransport> transport_{};
  std::optional<Reader> reader_{};
  std::optional<Writer> writer_{};
  State state_{};  ///< Continues across sessions because of its counters.
  Latest<Report> reports_{};
  Latest<Order> orders_{};
  Latest<Delivery> deliveries_{};
  rt::Semaphore has_order_{};
  Request last_request_{};
  std::uint64_t seen_corrupt_count_ = 0;
  bool is_active_ = false;
  device_io::IoThread reading_{};
  device_io::IoThread writing_{};
};

}  // namespace rtpm::device_hid
