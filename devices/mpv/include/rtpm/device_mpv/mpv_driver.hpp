#pragma once

#include <memory>
#include <optional>
#include <string>

#include "rtpm/base/latest.hpp"
#include "rtpm/device_io/io_thread.hpp"
#include "rtpm/device_mpv/session.hpp"
#include "rtpm/device_mpv/transport.hpp"
#include "rtpm/driver/driver.hpp"

namespace rtpm::device_mpv {

/// A media player with the channels of player_descriptor(). Without a command it pauses the player,
/// even a player that it did not start.
/// @threads  its own thread talks to the player, from activate() to deactivate()
class MpvDriver final : public driver::Driver {
 public:
  /// How long configure() waits for the first report of a player, and then for a file to be loaded.
  static constexpr Duration kStartMax = std::chrono::seconds{5};
  static constexpr Duration kLoadMax = std::chrono::seconds{2};

  /// @param serial  the descriptor's serial number; not empty
  MpvDriver(OpenTransport open, std::string serial, std::string frame);
  ~MpvDriver() override;

  [[nodiscard]] driver::Descriptor describe() const override;
  [[nodiscard]] expected<void, SetupError> configure(const driver::DriverConfig& config) override;
  [[nodiscard]] expected<void, SetupError> activate() override;
  [[nodiscard]] driver::ExchangeStatus exchange(const driver::Command& command,
                                                driver::Sample& sample) noexcept override;
  void deactivate() noexcept override;

 private:
  /// The last result of the thread.
  struct Report {
    PlayerState state{};
    std::uint64_t corrupt_count = 0;
    bool is_late = false;
    bool is_gone = false;
  };

  [[nodiscard]] bool await_report();
  void report(bool is_gone) noexcept;
  [[nodiscard]] bool step() noexcept;

  OpenTransport open_;
  std::string serial_;
  std::string frame_;
  Duration period_{};
  std::unique_ptr<Transport> transport_{};
  std::optional<Session> session_{};
  Latest<Report> reports_{};
  Latest<PlayerRequest> requests_{};
  std::uint64_t seen_corrupt_count_ = 0;
  bool is_active_ = false;
  device_io::IoThread thread_{};
};

}  // namespace rtpm::device_mpv
