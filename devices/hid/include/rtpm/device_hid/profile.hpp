#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/device_hid/transport.hpp"
#include "rtpm/driver/descriptor.hpp"
#include "rtpm/driver/sample.hpp"

namespace rtpm::device_hid {

/// The newest state of a device.
/// @ownership plain value, trivially copyable
struct State {
  std::array<float, driver::kAnalogCountMax> analogs{};
  double joint = 0;           ///< Position of a device with one joint, in its unit.
  double joint_velocity = 0;  ///< In that unit per second.
  std::uint32_t buttons = 0;
  std::array<std::uint16_t, driver::kButtonCountMax> button_edges{};
  Duration device_time{0};

  /// Presses and releases the changed buttons, and counts their edges.
  void set_buttons(std::uint32_t pressed) noexcept;
  /// Releases the buttons and everything else, as their state is unknown; the counters stay.
  void release() noexcept;
};

/// A client's request to a device, within its descriptor.
/// @ownership plain value, trivially copyable
struct Request {
  std::array<float, driver::kOutputCountMax> outputs{};
  double effort = 0;  ///< Effort of a device with one joint, in N m.
  friend bool operator==(const Request&, const Request&) noexcept = default;
};

/// The verdict on a report.
enum class Verdict : std::uint8_t {
  kNew,      ///< Understood.
  kStale,    ///< The former report again, by its counter: no sign of life.
  kForeign,  ///< Says nothing about the channels, such as a battery's.
  kCorrupt,  ///< Too short, too long, a wrong checksum: nothing was taken.
};

/// One output report, its number first.
/// @ownership plain value
struct OutputReport {
  std::array<std::byte, 80> bytes{};
  std::size_t size = 0;  ///< 0 if there is no report.
  [[nodiscard]] ConstBytes view() const noexcept { return ConstBytes(bytes).first(size); }
};

/// One kind of device: its channels and the reports that carry them.
/// @threads  take() by one thread, encode() by one that may be another, which it does not disturb;
///           the other members while neither is called
class Profile {
 public:
  Profile() = default;
  Profile(const Profile&) = delete;
  Profile& operator=(const Profile&) = delete;
  virtual ~Profile() = default;

  /// Constant; serial and frame are empty.
  [[nodiscard]] virtual driver::Descriptor describe() const = 0;
  /// Identifies the unit, and sends it everything that it needs before its first report.
  /// @realtime set-up only
  /// @errors   it is of another kind, or does not answer
  [[nodiscard]] virtual expected<void, SetupError> begin(HidTransport& transport,
                                                         const Unit& unit) = 0;
  /// Takes one report of the device. Foreign data: any bytes have a verdict.
  /// @realtime alloc-free
  [[nodiscard]] virtual Verdict take(ConstBytes report, MonotonicTime now,
                                     State& state) noexcept = 0;
  /// The report that puts `request` into effect.
  /// @realtime alloc-free
  [[nodiscard]] virtual OutputReport encode(const Request& request) noexcept;
  /// Ends what begin() began; the outputs are at their safe values already.
  /// @realtime set-up only
  virtual void end(HidTransport&) noexcept {}
  /// Controls of the unit beside its channels, for people; empty if there are none, or unknown.
  [[nodiscard]] virtual std::string left_out() const { return {}; }
  /// Longest silence of a healthy device; nullopt if the device reports only changes.
  [[nodiscard]] virtual std::optional<Duration> silence_max() const { return std::nullopt; }
};

/// The kinds of device.
enum class Kind : std::uint8_t { kSpaceMouse, kGamePad, kDualShock4, kDualSense, kOpenFfBoard };
inline constexpr std::array kKinds{Kind::kSpaceMouse, Kind::kGamePad, Kind::kDualShock4,
                                   Kind::kDualSense, Kind::kOpenFfBoard};
/// "spacemouse", "gamepad", "dualshock4", "dualsense", "openffboard".
[[nodiscard]] std::string_view to_string(Kind kind) noexcept;
/// The kind of that name.
[[nodiscard]] std::optional<Kind> kind_named(std::string_view name) noexcept;
/// The kind of a unit by vendor and product, or by its report descriptor for a game pad;
/// nullopt if it is not a device for this driver, such as a mouse.
[[nodiscard]] std::optional<Kind> kind_of(const Unit& unit);

/// Why a unit that could be a game pad is not served, as a clause; empty if kind_of() takes
/// it, or it is a device of another kind, such as a mouse.
[[nodiscard]] std::string refusal_of(const Unit& unit);

/// @param unit  the unit to describe; null if it is not plugged in, see README.md
/// @param torque_newton_metre_max  of a force wheel's motor; 0 if unknown: it applies no effort
[[nodiscard]] std::unique_ptr<Profile> make_profile(Kind kind, const Unit* unit,
                                                    double torque_newton_metre_max);

}  // namespace rtpm::device_hid
