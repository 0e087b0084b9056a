#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "driver_process.hpp"
#include "facts.hpp"
#include "rtpm/driver_host/isolated.hpp"

namespace rtpm::driver_host {

/// See isolate().
class IsolatedDriver final : public driver::Driver {
 public:
  explicit IsolatedDriver(IsolationConfig config) : config_(std::move(config)) {}
  ~IsolatedDriver() override { IsolatedDriver::deactivate(); }

  /// Starts the process, and asks it for its driver's constant properties.
  [[nodiscard]] expected<void, SetupError> start();

  [[nodiscard]] driver::Descriptor describe() const override { return facts_.descriptor; }
  [[nodiscard]] expected<void, SetupError> configure(const driver::DriverConfig& config) override;
  [[nodiscard]] expected<void, SetupError> activate() override;
  [[nodiscard]] driver::ExchangeStatus exchange(const driver::Command& command,
                                                driver::Sample& sample) noexcept override;
  void deactivate() noexcept override;
  [[nodiscard]] std::vector<driver::ParameterSpec> parameters() const override {
    return facts_.parameters;
  }
  [[nodiscard]] expected<void, SetupError> set_parameters(
      std::span<driver::ParameterSetting> settings) override;
  [[nodiscard]] std::vector<driver::CalibrationInfo> calibrations() const override {
    return facts_.calibrations;
  }
  [[nodiscard]] std::unique_ptr<driver::Calibration> make_calibration(
      std::string_view name) override;

 private:
  [[nodiscard]] bool is_running() const noexcept { return process_ && !process_->has_ended(); }
  /// Replaces a process that has ended, and restores the parameters.
  [[nodiscard]] expected<void, SetupError> revive();
  [[nodiscard]] expected<std::vector<std::byte>, SetupError> call(FrameKind kind, ConstBytes bytes,
                                                                  Duration patience);
  [[nodiscard]] expected<std::vector<std::byte>, SetupError> send_parameters(
      const std::vector<driver::ParameterSetting>& settings);
  [[nodiscard]] std::optional<CycleReply> wait_for_reply(MonotonicTime deadline) noexcept;
  /// Kills the process if it still runs; reports and returns how it ended.
  std::string lose(const char* place);
  void make_safe() noexcept;
  void report(const std::string& text) const;

  IsolationConfig config_;
  std::shared_ptr<DriverProcess> process_{};
  Facts facts_{};
  std::vector<std::byte> fact_bytes_{};
  std::map<std::string, driver::ParameterValue> parameters_{};  ///< Parameters that were set.
  driver::DriverConfig driver_config_{};
  Duration patience_{};  ///< Time limit of exchange().
  bool is_active_ = false;
  std::uint64_t request_number_ = 0;  ///< The newest request.
  std::uint64_t reply_number_ = 0;    ///< The newest reply received.
};

}  // namespace rtpm::driver_host
