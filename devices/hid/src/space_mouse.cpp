#include <algorithm>

#include "report.hpp"
#include "rtpm/device_hid/profiles.hpp"

namespace rtpm::device_hid {
namespace {

constexpr int kCountMax = 350;
/// ±350 counts equal ±1400 · 10^-4 cm.
constexpr float kDisplacementMaxMetres = 0.0014F;
// Newer models also send the rotation in this report.
constexpr std::uint8_t kTranslationReport = 1;
constexpr std::uint8_t kRotationReport = 2;
constexpr std::uint8_t kButtonReport = 3;
constexpr std::size_t kTripleSize = 7;
constexpr std::size_t kBothSize = 13;
constexpr std::size_t kButtonBytesMax = 5;
constexpr std::size_t kEnterpriseButtonBytesMax = 24;

struct Key {
  const char* name;
  std::uint8_t bit;
};
constexpr std::array kProKeys{
    Key{"menu", 0},    Key{"fit", 1},  Key{"top", 2},    Key{"right", 4},    Key{"front", 5},
    Key{"roll", 8},    Key{"1", 12},   Key{"2", 13},     Key{"3", 14},       Key{"4", 15},
    Key{"escape", 22}, Key{"alt", 23}, Key{"shift", 24}, Key{"control", 25}, Key{"lock", 26}};

/// An Enterprise has the keys of a Pro at the same bits, and more keys. A Universal Receiver may be
/// connected to a Pro, or to a model with two buttons, which are the first two of a Pro.
constexpr std::uint16_t kEnterprise = 0xc633;
constexpr std::uint16_t kUniversalReceiver = 0xc652;

/// The number of plain buttons of a model; 0 if it has the keys of a Pro.
std::size_t button_count(std::uint16_t product) noexcept {
  constexpr std::array<std::uint16_t, 6> kPro{0xc62b, 0xc631,      0xc632,
                                              0xc638, kEnterprise, kUniversalReceiver};
  constexpr std::array<std::uint16_t, 8> kTwoButtons{0xc623, 0xc626, 0xc627, 0xc628,
                                                     0xc62e, 0xc62f, 0xc635, 0xc63a};
  if (std::ranges::count(kPro, product) > 0) return 0;
  return std::ranges::count(kTwoButtons, product) > 0 ? 2 : driver::kButtonCountMax;
}

/// Reads three numbers at `offset`, converted from the device's frame (right, towards the user,
/// down) to the driver's frame (right, up, towards the user).
void take_triple(ConstBytes report, std::size_t offset, float scale, float* to) noexcept {
  std::array<float, 3> value{};
  for (std::size_t i = 0; i < value.size(); ++i) {
    const auto count =
        static_cast<std::int16_t>(load_le<std::uint16_t>(report.data() + offset + 2 * i));
    value[i] =
        static_cast<float>(std::clamp<int>(count, -kCountMax, kCountMax)) / kCountMax * scale;
  }
  to[0] = value[0];
  to[1] = -value[2];
  to[2] = value[1];
}

}  // namespace

SpaceMouse::SpaceMouse(std::uint16_t product) : product_(product) {
  const std::size_t count = button_count(product);
  for (std::size_t i = 0; i < count; ++i) {
    names_.push_back("button_" + std::to_string(i + 1));
    bits_.push_back(static_cast<std::uint8_t>(i));
  }
  for (std::size_t i = 0; count == 0 && i < kProKeys.size(); ++i) {
    names_.emplace_back(kProKeys[i].name);
    bits_.push_back(kProKeys[i].bit);
  }
}

driver::Descriptor SpaceMouse::describe() const {
  driver::Descriptor descriptor;
  descriptor.device_class = driver::DeviceClass::kInput;
  descriptor.model = "3Dconnexion SpaceMouse";
  descriptor.buttons = names_;
  for (const char* name : {"x", "y", "z"}) {
    descriptor.analogs.push_back({.name = name,
                                  .unit = "m",
                                  .low = -kDisplacementMaxMetres,
                                  .high = kDisplacementMaxMetres});
  }
  for (const char* name : {"rx", "ry", "rz"})
    descriptor.analogs.push_back({.name = name, .unit = "1", .low = -1, .high = 1});
  descriptor.outputs = {{.name = "light", .unit = "1"}};
  descriptor.modes = {driver::CommandMode::kOutputs};
  descriptor.rate_hz = 125;
  return descriptor;
}

std::string SpaceMouse::left_out() const {
  return product_ == kEnterprise ? "the keys that a SpaceMouse Pro lacks" : "";
}

expected<void, SetupError> SpaceMouse::begin(HidTransport&, const Unit& unit) {
  const auto descriptor = parse_report_descriptor(unit.report_descriptor);
  axes_size_ = descriptor ? descriptor->input_sizes[kTranslationReport] : 0;
  return {};
}

/// Whether the size is exactly that of one of the two layouts. If one read returns two reports of
/// the older layout, their size differs by only one byte from that of the newer layout.
bool SpaceMouse::has_axes_size(ConstBytes report, std::size_t size) const noexcept {
  return report.size() == size && (axes_size_ == 0 || axes_size_ == size);
}

Verdict SpaceMouse::take(ConstBytes report, MonotonicTime, State& state) noexcept {
  if (report.empty()) return Verdict::kCorrupt;
  switch (byte_at(report, 0)) {
    case kTranslationReport: {
      const bool has_rotation = has_axes_size(report, kBothSize);
      if (!has_rotation && !has_axes_size(report, kTripleSize)) return Verdict::kCorrupt;
      take_triple(report, 1, kDisplacementMaxMetres, state.analogs.data());
      if (has_rotation) take_triple(report, kTripleSize, 1, state.analogs.data() + 3);
      return Verdict::kNew;
    }
    case kRotationReport:
      if (!has_axes_size(report, kTripleSize)) return Verdict::kCorrupt;
      take_triple(report, 1, 1, state.analogs.data() + 3);
      return Verdict::kNew;
    case kButtonReport:
      return take_buttons(report, state);
    default:
      return Verdict::kForeign;
  }
}

/// The size of the report differs between models and may contradict the report descriptor.
Verdict SpaceMouse::take_buttons(ConstBytes report, State& state) const noexcept {
  const std::size_t bytes_max =
      product_ == kEnterprise ? kEnterpriseButtonBytesMax : kButtonBytesMax;
  if (report.size() < 2 || report.size() > 1 + bytes_max) return Verdict::kCorrupt;
  std::uint32_t pressed = 0;
  for (std::size_t i = 0; i < bits_.size(); ++i) {
    const std::size_t at = 1 + bits_[i] / 8U;
    if (at < report.size() && (byte_at(report, at) >> (bits_[i] % 8) & 1) != 0) pressed |= 1U << i;
  }
  state.set_buttons(pressed);
  return Verdict::kNew;
}

OutputReport SpaceMouse::encode(const Request& request) noexcept {
  OutputReport report;
  report.bytes[0] = std::byte{4};
  report.bytes[1] = request.outputs[0] >= 0.5F ? std::byte{1} : std::byte{0};
  report.size = 2;
  return report;
}

}  // namespace rtpm::device_hid
