#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "rtpm/base/latest.hpp"
#include "rtpm/device_io/io_thread.hpp"
#include "rtpm/device_serial/session.hpp"
#include "rtpm/device_serial/transport.hpp"
#include "rtpm/driver/driver.hpp"

namespace rtpm::device_serial {

/// Configures a board's driver.
struct SerialConfig {
  OpenTransport open;   ///< Opens the port.
  PortSettings port{};  ///< Used until the parameters select another port.
  /// The expected board. If it has a serial number, only that board is accepted.
  BoardDescription board{};
  std::string serial{};  ///< The serial number in the descriptor; not empty.
  std::string frame{};
  Duration greeting_max = kGreetingMax;  ///< How long configure() waits for the board.
  rt::RealtimeMode realtime = rt::RealtimeMode::kPrefer;  ///< The mode of the driver's thread.
};

/// A microcontroller board that speaks the frames of FRAMES.md. Without a command its efforts are
/// zero and its outputs safe.
/// @threads  its own thread talks to the board, from activate() to deactivate()
class SerialDriver final : public driver::Driver {
 public:
  static constexpr std::int64_t kSpeedMinBaud = 9600;
  static constexpr std::int64_t kSpeedMaxBaud = 4'000'000;

  explicit SerialDriver(SerialConfig config);
  ~SerialDriver() override;

  [[nodiscard]] driver::Descriptor describe() const override;
  [[nodiscard]] expected<void, SetupError> configure(const driver::DriverConfig& config) override;
  [[nodiscard]] expected<void, SetupError> activate() override;
  [[nodiscard]] driver::ExchangeStatus exchange(const driver::Command& command,
                                                driver::Sample& sample) noexcept override;
  void deactivate() noexcept override;

  [[nodiscard]] std::vector<driver::ParameterSpec> parameters() const override;
  [[nodiscard]] expected<void, SetupError> set_parameters(
      std::span<driver::ParameterSetting> settings) override;
  [[nodiscard]] std::vector<driver::CalibrationInfo> calibrations() const override;
  [[nodiscard]] std::unique_ptr<driver::Calibration> make_calibration(
      std::string_view name) override;

  /// The counters of the current session, or of the last one.
  [[nodiscard]] LineCounters counters() const { return last_.counters; }

 private:
  [[nodiscard]] expected<void, SetupError> check(const BoardDescription& board) const;
  [[nodiscard]] std::string place() const;
  [[nodiscard]] Request request_of(const driver::Command& command) noexcept;
  void fill(driver::Sample& sample, const Report& report) const noexcept;

  SerialConfig config_;
  Duration period_{};
  std::unique_ptr<Transport> transport_{};
  std::optional<Session> session_{};
  Latest<Report> reports_{};
  Latest<Request> requests_{};
  Report last_{};  ///< The report that exchange() saw last.
  std::uint64_t request_number_ = 0;
  bool is_active_ = false;

  // The parameters, with kAnalogCountMax or kJointCountMax elements.
  std::vector<double> analog_offset_{};
  std::vector<double> analog_scale_{};
  std::vector<double> joint_zero_{};

  device_io::IoThread thread_{};
};

}  // namespace rtpm::device_serial
