#pragma once

#include <atomic>
#include <cstdint>
#include <device.rtpm.hpp>
#include <optional>

#include "rtpm/base/hash.hpp"
#include "rtpm/base/priority.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/gvd/command_lease.hpp"
#include "rtpm/gvd/emergency.hpp"
#include "rtpm/gvd/error.hpp"
#include "rtpm/gvd/setpoint_limiter.hpp"
#include "rtpm/replay/pace.hpp"
#include "rtpm/replay/recorded.hpp"
#include "rtpm/safety/emergency_latch.hpp"

namespace rtpm::replay {

/// A device's behaviour after its last sample.
enum class End : std::uint8_t {
  kGone,  ///< It is lost, as if unplugged: lifecycle fault, kDeviceGone, and the lease ends.
  kHold,  ///< It keeps showing the last sample.
  kLoop,  ///< It begins again.
};

/// Receives the commands that a device accepted.
/// @threads  any lane
/// @realtime alloc-free
class CommandSink {
 public:
  CommandSink() = default;
  CommandSink(const CommandSink&) = delete;
  CommandSink& operator=(const CommandSink&) = delete;
  virtual ~CommandSink() = default;
  /// @param sample_sequence  sequence of the sample that the device showed then
  virtual void take(const device::Command& command, std::uint64_t sample_sequence) noexcept = 0;
};

/// Settings of a replayed device.
struct ReplayedDeviceConfig {
  /// Selects the sample of the present time for each read(). If null, each read() gets the next
  /// sample, so that a loop with one read per cycle sees each sample once, whatever its timing.
  const Pace* pace = nullptr;
  End end = End::kGone;
  gvd::LeaseConfig lease{};
  SipKey lease_key{};
  CommandSink* commands = nullptr;                 ///< May be null.
  gvd::EmergencyStops* emergency_stops = nullptr;  ///< The stops of its program; may be null.
};

/// A recorded device as an object again. Description and samples are the recorded ones, bit by bit.
/// Lease and commands follow the rules of a real device, and so do refusals; but a command, the
/// end of a fault, activate and deactivate change no sample. It renders no models.
/// @ownership refers to what its arguments refer to
/// @threads  attend() and lose() from one; the methods from any lane
/// @realtime alloc-free, but for describe(), set_models() and read_flight_record()
class ReplayedDevice final : public device::DeviceServant {
 public:
  /// @param recorded  has a sample and a description that is valid
  ReplayedDevice(const RecordedDevice& recorded, const ReplayedDeviceConfig& config);

  /// Ends an expired lease. Call it each millisecond.
  void attend(MonotonicTime now) noexcept;
  /// Stops the device: no force and no commands until rearm().
  void emergency_stop() noexcept { emergency_.stop(); }
  /// The device is lost from now on.
  void lose() noexcept { is_gone_.store(true, std::memory_order_release); }

  struct Counters {
    std::uint64_t read_count = 0;
    std::uint64_t command_count = 0;  ///< Commands accepted.
    std::uint64_t refused_count = 0;  ///< Commands refused.
  };
  [[nodiscard]] Counters counters() const noexcept;
  /// The number of samples shown, in steps.
  [[nodiscard]] std::uint64_t step_count() const noexcept {
    return step_count_.load(std::memory_order_acquire);
  }
  [[nodiscard]] bool is_stepped() const noexcept { return config_.pace == nullptr; }
  /// In steps: whether the last sample was shown, the first time.
  [[nodiscard]] bool is_stepped_through() const noexcept {
    return step_count() >= recorded_.samples.size();
  }
  [[nodiscard]] const RecordedDevice& recorded() const noexcept { return recorded_; }

  rpc::Result<void> describe(rpc::ReplyBuilder<device::Description>& reply,
                             const rpc::CallContext& context) override;
  rpc::Result<device::Sample> read(const rpc::CallContext& context) override;
  rpc::Result<device::Outcome> command(const device::Command& request,
                                       const rpc::CallContext& context) override;
  rpc::Result<device::Lease> acquire(const rpc::CallContext& context) override;
  rpc::Result<device::Outcome> renew(const device::Holder& request,
                                     const rpc::CallContext& context) override;
  rpc::Result<device::Outcome> release(const device::Holder& request,
                                       const rpc::CallContext& context) override;
  rpc::Result<device::Outcome> recover(const device::Holder& request,
                                       const rpc::CallContext& context) override;
  rpc::Result<device::Outcome> activate(const device::Holder& request,
                                        const rpc::CallContext& context) override;
  rpc::Result<device::Outcome> deactivate(const device::Holder& request,
                                          const rpc::CallContext& context) override;
  rpc::Result<device::Lease> take_over(const rpc::CallContext& context) override;
  rpc::Result<device::LeaseStanding> lease_state(const device::Holder& request,
                                                 const rpc::CallContext& context) override;
  rpc::Result<device::Outcome> emergency_stop(const device::Stop& request,
                                              const rpc::CallContext& context) override;
  rpc::Result<device::Outcome> rearm(const device::Holder& request,
                                     const rpc::CallContext& context) override;
  rpc::Result<void> set_models(const device::SetModelsRequest& request,
                               rpc::ReplyBuilder<device::SetModelsReply>& reply,
                               const rpc::CallContext& context) override;
  rpc::Result<void> read_flight_record(const device::FlightRecordRequest& request,
                                       rpc::ReplyBuilder<device::FlightRecordReply>& reply,
                                       const rpc::CallContext& context) override;

 private:
  /// The sample that a read at `now` gets, or would get; null if there is none yet.
  [[nodiscard]] const device::Sample* sample_at(MonotonicTime now) const noexcept;
  [[nodiscard]] const device::Sample* next_sample() noexcept;
  [[nodiscard]] const device::Sample* last_shown(MonotonicTime now) const noexcept;
  [[nodiscard]] gvd::DeviceOutcome submit(const device::Command& command,
                                          MonotonicTime now) noexcept;
  /// Whether this command is newer than the holder's newest one; if so, it becomes the newest.
  [[nodiscard]] bool is_newest(std::uint64_t lease, std::uint32_t sequence) noexcept;
  [[nodiscard]] bool is_active(MonotonicTime now) const noexcept;
  [[nodiscard]] device::Outcome use(const device::Holder& holder) noexcept;

  const RecordedDevice& recorded_;
  ReplayedDeviceConfig config_;
  device::DescriptionT description_{};
  gvd::SetpointLimiter limiter_;
  gvd::Lease lease_;
  gvd::EmergencyLatch emergency_{};
  std::atomic<bool> is_gone_{false};
  std::atomic<bool> is_deactivated_{false};
  /// The newest command's lease serial number and sequence; bit 63: a command exists.
  std::atomic<std::uint64_t> newest_command_{0};
  std::atomic<std::uint64_t> step_count_{0};
  std::atomic<std::uint64_t> read_count_{0};
  std::atomic<std::uint64_t> command_count_{0};
  std::atomic<std::uint64_t> refused_count_{0};
};

}  // namespace rtpm::replay
