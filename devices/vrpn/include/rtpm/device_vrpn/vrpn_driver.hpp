#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "rtpm/base/latest.hpp"
#include "rtpm/device_io/io_thread.hpp"
#include "rtpm/device_vrpn/client.hpp"
#include "rtpm/driver/driver.hpp"

namespace rtpm::device_vrpn {

/// One sensor of a tracker of a VRPN server, as a device of class tracker. It measures only; a
/// sample's time is when the report arrived, as VRPN's own stamps are of another clock.
/// @threads  its own thread reads the connection, from activate() to deactivate()
class VrpnDriver final : public driver::Driver {
 public:
  /// How long configure() waits for the connection, and then for the first report.
  static constexpr Duration kStartMax = std::chrono::seconds{2};
  /// Times without a report after which the tracker is late, and then gone.
  static constexpr Duration kLateAfter = std::chrono::milliseconds{200};
  static constexpr Duration kGoneAfter = std::chrono::seconds{2};

  /// @param serial  the descriptor's serial number; not empty
  VrpnDriver(Settings settings, std::string serial, std::string frame);
  ~VrpnDriver() override;

  [[nodiscard]] driver::Descriptor describe() const override;
  [[nodiscard]] expected<void, SetupError> configure(const driver::DriverConfig& config) override;
  [[nodiscard]] expected<void, SetupError> activate() override;
  [[nodiscard]] driver::ExchangeStatus exchange(const driver::Command& command,
                                                driver::Sample& sample) noexcept override;
  void deactivate() noexcept override;

 private:
  struct Report {
    Reading reading{};
    bool is_gone = false;
  };

  [[nodiscard]] bool step() noexcept;

  Settings settings_;
  std::string serial_;
  std::string frame_;
  Client client_;
  Latest<Report> reports_{};
  bool is_active_ = false;
  device_io::IoThread thread_{};
};

}  // namespace rtpm::device_vrpn
