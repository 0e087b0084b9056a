#pragma once

#include <deque>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "hid_model.hpp"
#include "rtpm/device_hid/transport.hpp"

namespace rtpm::test {

/// Faults of a HID device, or of the connection to it.
enum class HidFault : std::uint8_t {
  kNone,
  kShort,          ///< The last byte of each report is missing.
  kLong,           ///< Each report has one byte too many.
  kSplit,          ///< Each report arrives in two parts.
  kGlued,          ///< Two reports arrive as one.
  kFlipped,        ///< A bit in the middle of each report is wrong.
  kGarbage,        ///< Random bytes replace each report.
  kStale,          ///< The last report repeats for ever.
  kSilent,         ///< Reports stop.
  kUnplugged,      ///< All accesses fail.
  kRefuses,        ///< Output and feature reports are refused.
  kFlipsFeatures,  ///< A bit of each feature report is wrong.
  kStuckButton,    ///< The first button stays pressed.
};
inline constexpr HidFault kLastHidFault = HidFault::kStuckButton;

/// A port with a device model plugged in. Its time advances only while a report is awaited.
/// @threads  any
class ScriptedHidPort {
 public:
  explicit ScriptedHidPort(std::shared_ptr<HidModel> model) : model_(std::move(model)) {}

  /// @param from_step  the index of the report, in either direction, at which the fault begins
  void set_fault(HidFault fault, std::uint64_t from_step = 0);
  [[nodiscard]] std::uint64_t step_count() const;
  /// Calls `use` with the model while nothing else uses it.
  template <class Use>
  auto with_model(Use&& use) const {
    const std::lock_guard lock(mutex_);
    return use(*model_);
  }

  [[nodiscard]] device_hid::Received read(MutableBytes buffer, Duration patience);
  [[nodiscard]] bool write(ConstBytes report);
  [[nodiscard]] std::size_t read_feature(MutableBytes report);
  [[nodiscard]] MonotonicTime now() const;
  /// Blocks the next writes until release_writes().
  void hold_writes();
  void release_writes();

 private:
  [[nodiscard]] bool has(HidFault fault) const {
    return step_count_ > from_step_ && fault_ == fault;
  }
  void spoil(HidReport report);

  mutable std::mutex mutex_{};
  std::mutex write_mutex_{};
  std::shared_ptr<HidModel> model_;
  HidFault fault_ = HidFault::kNone;
  std::uint64_t from_step_ = 0;
  std::uint64_t step_count_ = 0;
  MonotonicTime now_{std::chrono::seconds{500}};
  std::deque<HidReport> spoilt_{};
  HidReport last_{};
};

/// A machine with ScriptedHid ports.
/// @threads  one at a time
class ScriptedHidSystem final : public device_hid::HidSystem {
 public:
  struct Plugged {
    device_hid::Unit unit{};
    std::shared_ptr<ScriptedHidPort> port{};
    bool is_forbidden = false;
  };
  /// @return the port
  std::shared_ptr<ScriptedHidPort> plug(std::shared_ptr<HidModel> model, const std::string& serial,
                                        const std::string& port, const std::string& node);
  [[nodiscard]] std::vector<device_hid::Unit> units() override;
  [[nodiscard]] expected<std::unique_ptr<device_hid::HidTransport>, SetupError> open(
      const device_hid::Unit& unit) override;

  std::vector<Plugged> plugged{};
};

/// A system with one device in it.
[[nodiscard]] std::shared_ptr<ScriptedHidSystem> system_with(std::shared_ptr<HidModel> model);

/// A model of each kind, in the order of device_hid::kKinds; over Bluetooth where available.
[[nodiscard]] std::shared_ptr<HidModel> make_model(std::size_t kind, bool is_bluetooth = false);

}  // namespace rtpm::test
