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
  double joint = 0;           ///< For a device with one joint: its position, in the joint's unit.
  double joint_velocity = 0;  ///< In the joint's unit per second.
  std::uint32_t buttons = 0;
  std::array<std::uint16_t, driver::kButtonCountMax> button_edges{};
  Duration device_time{0};

  /// Sets the buttons and counts the edges of those that changed.
  void set_buttons(std::uint32_t pressed) noexcept;
  /// Releases the buttons and resets everything else, because the state is unknown; keeps the
  /// counters.
  void release() noexcept;
};

/// A client's request to a device, within its descriptor.
/// @ownership plain value, trivially copyable
struct Request {
  std::array<float, driver::kOutputCountMax> outputs{};
  double effort = 0;  ///< For a device with one joint: its effort, in N m.
  friend bool operator==(const Request&, const Request&) noexcept = default;
};

/// The result of reading a report.
enum class Verdict : std::uint8_t {
  kNew,      ///< A valid report with new values.
  kStale,    ///< The same report again, according to its counter: no sign of life.
  kForeign,  ///< A report about something other than the channels, such as the battery.
  kCorrupt,  ///< Too short, too long, or a wrong checksum; the report was ignored.
};

/// One output report; its first byte is its number.
/// @ownership plain value
struct OutputReport {
  std::array<std::byte, 80> bytes{};
  std::size_t size = 0;  ///< 0 if there is no report.
  [[nodiscard]] ConstBytes view() const noexcept { return ConstBytes(bytes).first(size); }
};

/// One kind of device: its channels and the reports with their values.
/// @threads  take(): one thread; encode(): one thread, which may be another, concurrently; the
///           other members: while neither is called
class Profile {
 public:
  Profile() = default;
  Profile(const Profile&) = delete;
  Profile& operator=(const Profile&) = delete;
  virtual ~Profile() = default;

  /// Never changes; serial number and frame are empty.
  [[nodiscard]] virtual driver::Descriptor describe() const = 0;
  /// Identifies the unit and sends it everything it needs before its first report.
  /// @realtime set-up only
  /// @errors   the unit is of another kind or does not answer
  [[nodiscard]] virtual expected<void, SetupError> begin(HidTransport& transport,
                                                         const Unit& unit) = 0;
  /// Reads one report of the device. Untrusted data: every byte sequence has a verdict.
  /// @realtime alloc-free
  [[nodiscard]] virtual Verdict take(ConstBytes report, MonotonicTime now,
                                     State& state) noexcept = 0;
  /// The report that puts `request` into effect.
  /// @realtime alloc-free
  [[nodiscard]] virtual OutputReport encode(const Request& request) noexcept;
  /// Undoes what begin() did; the outputs already have their safe values.
  /// @realtime set-up only
  virtual void end(HidTransport&) noexcept {}
  /// The unit's controls without a channel, as text for users; empty if there are none or they are
  /// unknown.
  [[nodiscard]] virtual std::string left_out() const { return {}; }
  /// The longest silence of a healthy device; nullopt if the device reports only changes.
  [[nodiscard]] virtual std::optional<Duration> silence_max() const { return std::nullopt; }
};

/// The supported kinds of device.
enum class Kind : std::uint8_t { kSpaceMouse, kGamePad, kDualShock4, kDualSense, kOpenFfBoard };
inline constexpr std::array kKinds{Kind::kSpaceMouse, Kind::kGamePad, Kind::kDualShock4,
                                   Kind::kDualSense, Kind::kOpenFfBoard};
/// Returns "spacemouse", "gamepad", "dualshock4", "dualsense" or "openffboard".
[[nodiscard]] std::string_view to_string(Kind kind) noexcept;
/// The kind with this name; nullopt if there is none.
[[nodiscard]] std::optional<Kind> kind_named(std::string_view name) noexcept;
/// The kind of a unit, by its vendor and product ids or, for a game pad, by its report descriptor;
/// nullopt if this driver does not support the device, such as a mouse.
[[nodiscard]] std::optional<Kind> kind_of(const Unit& unit);

/// The reason why a unit that could be a game pad is not supported, as a clause; empty if kind_of()
/// finds a kind, or if it is another kind of device, such as a mouse.
[[nodiscard]] std::string refusal_of(const Unit& unit);

/// @param unit  the unit to describe; null if it is not plugged in, see README.md
/// @param torque_newton_metre_max  for the motor of a force wheel; 0 if unknown, and then it
///           applies no effort
[[nodiscard]] std::unique_ptr<Profile> make_profile(Kind kind, const Unit* unit,
                                                    double torque_newton_metre_max);

}  // namespace rtpm::device_hid
