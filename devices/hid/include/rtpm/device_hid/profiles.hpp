#pragma once

#include <array>
#include <string>
#include <vector>

#include "rtpm/device_hid/profile.hpp"
#include "rtpm/device_hid/report_descriptor.hpp"

/// The kinds of device, with one class each.
namespace rtpm::device_hid {

/// The cap with six degrees of freedom by 3Dconnexion: analogs "x", "y", "z" (its displacement in
/// metres) and "rx", "ry", "rz" (-1 to 1), buttons, output "light".
/// @source   the report descriptors of SpaceNavigator and SpaceMouse Wireless
class SpaceMouse final : public Profile {
 public:
  explicit SpaceMouse(std::uint16_t product);
  [[nodiscard]] driver::Descriptor describe() const override;
  [[nodiscard]] std::string left_out() const override;
  [[nodiscard]] expected<void, SetupError> begin(HidTransport& transport,
                                                 const Unit& unit) override;
  [[nodiscard]] Verdict take(ConstBytes report, MonotonicTime now, State& state) noexcept override;
  [[nodiscard]] OutputReport encode(const Request& request) noexcept override;

 private:
  [[nodiscard]] bool has_axes_size(ConstBytes report, std::size_t size) const noexcept;
  [[nodiscard]] Verdict take_buttons(ConstBytes report, State& state) const noexcept;

  std::uint16_t product_;
  std::vector<std::string> names_{};
  std::vector<std::uint8_t> bits_{};  ///< The bit of each button in report 3.
  std::size_t axes_size_ = 0;         ///< The size of report 1; 0 if unknown.
};

/// Whether an application collection with this usage is a joystick, game pad or multi-axis
/// controller.
[[nodiscard]] bool is_pad_application(std::uint32_t usage) noexcept;

/// Any game pad, based on its report descriptor: axes as analogs, the hat as two analogs, buttons.
/// If the unit has several applications, the first one of a pad is used.
class GamePad final : public Profile {
 public:
  /// @param unit  if null, describes a typical pad, see README.md
  explicit GamePad(const Unit* unit);
  [[nodiscard]] driver::Descriptor describe() const override;
  [[nodiscard]] std::string left_out() const override { return left_out_; }
  [[nodiscard]] expected<void, SetupError> begin(HidTransport& transport,
                                                 const Unit& unit) override;
  [[nodiscard]] Verdict take(ConstBytes report, MonotonicTime now, State& state) noexcept override;

 private:
  enum class Part : std::uint8_t { kWhole, kHatX, kHatY };
  struct Channel {
    std::string name;
    std::uint32_t usage = 0;
    std::size_t index = 0;  ///< Index among the fields with this usage.
    Part part = Part::kWhole;
    std::optional<Field> field{};  ///< Nullopt if the unit does not have it.
  };

  [[nodiscard]] static std::uint32_t served_application(const ReportDescriptor& descriptor);
  [[nodiscard]] static std::size_t count_of(const std::vector<Channel>& channels,
                                            std::uint32_t usage, Part part);
  /// Returns false, like the next two functions, if no kind of channel fits the field or no channel
  /// is free.
  [[nodiscard]] bool take_field(const Field& field);
  [[nodiscard]] bool add_analog(std::uint32_t usage);
  [[nodiscard]] bool add_button(std::uint32_t usage);
  void bind(const ReportDescriptor& descriptor);

  std::vector<Channel> analogs_{};
  std::vector<Channel> buttons_{};
  ReportDescriptor layout_{};
  std::string model_ = "game pad";
  std::string left_out_{};
};

/// Sony's DualShock 4 and DualSense: analogs for sticks, triggers and hat; 14 or 15 buttons;
/// outputs for rumble and light.
/// @source   Linux, drivers/hid/hid-playstation.c
class SonyPad final : public Profile {
 public:
  enum class Model : std::uint8_t { kDualShock4, kDualSense };
  explicit SonyPad(Model model) : model_(model) {}
  [[nodiscard]] driver::Descriptor describe() const override;
  [[nodiscard]] expected<void, SetupError> begin(HidTransport& transport,
                                                 const Unit& unit) override;
  [[nodiscard]] Verdict take(ConstBytes report, MonotonicTime now, State& state) noexcept override;
  [[nodiscard]] OutputReport encode(const Request& request) noexcept override;
  [[nodiscard]] std::optional<Duration> silence_max() const override;

 private:
  [[nodiscard]] Verdict take_dualshock4(ConstBytes common, State& state) noexcept;
  [[nodiscard]] Verdict take_dualsense(ConstBytes common, State& state) noexcept;
  /// A model's clock: its valid bits, and the duration of three ticks.
  struct Clock {
    std::uint32_t mask;
    std::int64_t three_ticks_ns;
  };
  [[nodiscard]] bool advance(const Clock& clock, std::uint32_t counter, std::uint32_t ticks,
                             State& state) noexcept;

  Model model_;
  Bus bus_ = Bus::kUsb;
  bool has_report_ = false;
  std::uint32_t counter_ = 0;  ///< The counter in the last report.
  std::uint32_t ticks_ = 0;    ///< The device time of the last report.
  std::uint8_t output_sequence_ = 0;
};

/// The force wheel by OpenFFBoard: joint "wheel", whose motor is controlled by a constant-force
/// effect of the board's effects manager; the other axes are analogs.
/// @source   OpenFFBoard's wiki, "Commands", and HidCommandInterface.h in its firmware
class OpenFfBoard final : public Profile {
 public:
  explicit OpenFfBoard(double torque_newton_metre_max) : torque_max_(torque_newton_metre_max) {}
  [[nodiscard]] driver::Descriptor describe() const override;
  [[nodiscard]] expected<void, SetupError> begin(HidTransport& transport,
                                                 const Unit& unit) override;
  [[nodiscard]] Verdict take(ConstBytes report, MonotonicTime now, State& state) noexcept override;
  [[nodiscard]] OutputReport encode(const Request& request) noexcept override;
  void end(HidTransport& transport) noexcept override;
  [[nodiscard]] std::optional<Duration> silence_max() const override;

 private:
  [[nodiscard]] expected<void, SetupError> begin_effect(HidTransport& transport);
  void set_velocity(MonotonicTime now, State& state) noexcept;

  double torque_max_;
  double range_rad_ = 0;
  std::int64_t effect_ = -1;  ///< The number of the effect on the board; -1 if there is none.
  ReportDescriptor layout_{};
  std::optional<Field> wheel_{};
  std::array<std::optional<Field>, driver::kAnalogCountMax> axes_{};
  std::array<std::optional<Field>, driver::kButtonCountMax> buttons_{};
  bool has_reference_ = false;
  MonotonicTime reference_time_{};
  double reference_rad_ = 0;
};

}  // namespace rtpm::device_hid
