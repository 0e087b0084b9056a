#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "rtpm/base/latest.hpp"
#include "rtpm/device_falcon/session.hpp"
#include "rtpm/device_falcon/transport.hpp"
#include "rtpm/device_io/io_thread.hpp"
#include "rtpm/driver/driver.hpp"

namespace rtpm::device_falcon {

/// A unit's identity, firmware and thread.
struct FalconConfig {
  std::string serial;                 ///< The descriptor's serial number; not empty.
  std::string frame = "falcon/base";  ///< The descriptor's frame.
  /// The contents of the user's firmware file; empty if the unit already runs its firmware.
  std::vector<std::byte> firmware{};
  rt::ThreadConfig thread{.name = "falcon", .priority = Priority{24'000}};
};

/// A Novint Falcon: three axes with force, four buttons. Positions are relative to the centre of
/// the workspace. Before the operator has homed it by pulling the grip out and pushing it in, it
/// has no position and no force.
/// @threads  its own thread talks to the unit, from activate() to deactivate()
class FalconDriver final : public driver::Driver {
 public:
  static constexpr double kForceMaxNewton = 8;
  static constexpr double kRadiusMetres = 0.04;
  static constexpr double kCountsPerNewtonMetre = 10'000;
  /// If there is no report for this long, the thread hangs or gets no CPU time.
  static constexpr Duration kStuckAfter = std::chrono::seconds{1};

  FalconDriver(FalconConfig config, OpenTransport open);
  ~FalconDriver() override;

  [[nodiscard]] driver::Descriptor describe() const override;
  [[nodiscard]] expected<void, SetupError> configure(const driver::DriverConfig& config) override;
  [[nodiscard]] expected<void, SetupError> activate() override;
  [[nodiscard]] driver::ExchangeStatus exchange(const driver::Command& command,
                                                driver::Sample& sample) noexcept override;
  void deactivate() noexcept override;
  [[nodiscard]] std::vector<driver::ParameterSpec> parameters() const override;
  [[nodiscard]] expected<void, SetupError> set_parameters(
      std::span<driver::ParameterSetting> settings) override;

 private:
  /// The last result of the thread.
  struct Report {
    FalconState state{};
    MonotonicTime reported_at{};
    bool is_late = false;
    bool is_gone = false;
  };

  [[nodiscard]] bool step() noexcept;
  void report(bool is_gone) noexcept;
  [[nodiscard]] MotorForce force_for(const driver::Command& command,
                                     const FalconState& state) const noexcept;
  void fill(driver::Sample& sample, const FalconState& state, const MotorForce& force) noexcept;

  FalconConfig config_;
  OpenTransport open_;
  double counts_per_newton_metre_ = kCountsPerNewtonMetre;
  std::unique_ptr<Transport> transport_{};
  std::optional<Session> session_{};
  device_io::IoThread thread_{};
  bool is_active_ = false;
  Latest<Report> reports_{};
  Latest<ForceRequest> requests_{};
  std::uint64_t request_number_ = 0;
  std::uint64_t seen_corrupt_count_ = 0;
  std::array<std::uint16_t, kButtonCount> seen_edges_{};
};

}  // namespace rtpm::device_falcon
