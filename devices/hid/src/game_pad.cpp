#include <algorithm>
#include <array>

#include "report.hpp"
#include "rtpm/device_hid/profiles.hpp"

namespace rtpm::device_hid {
namespace {

constexpr std::uint32_t kHat = kDesktopPage + 0x39;

struct NamedUsage {
  std::uint32_t usage;
  const char* name;
};
constexpr std::array kAxes{
    NamedUsage{kDesktopPage + 0x30, "x"},
    NamedUsage{kDesktopPage + 0x31, "y"},
    NamedUsage{kDesktopPage + 0x32, "z"},
    NamedUsage{kDesktopPage + 0x33, "rx"},
    NamedUsage{kDesktopPage + 0x34, "ry"},
    NamedUsage{kDesktopPage + 0x35, "rz"},
    NamedUsage{kDesktopPage + 0x36, "slider"},
    NamedUsage{kDesktopPage + 0x37, "dial"},
    NamedUsage{kDesktopPage + 0x38, "wheel"},
    NamedUsage{kHat, "hat"},
    NamedUsage{kSimulationPage + 0xba, "rudder"},
    NamedUsage{kSimulationPage + 0xbb, "throttle"},
    NamedUsage{kSimulationPage + 0xc4, "accelerator"},
    NamedUsage{kSimulationPage + 0xc5, "brake"},
    NamedUsage{kSimulationPage + 0xc8, "steering"},
};

const char* axis_name(std::uint32_t usage) noexcept {
  const auto* const found = std::ranges::find(kAxes, usage, &NamedUsage::usage);
  return found == kAxes.end() ? nullptr : found->name;
}

bool is_usable(const Field& field) noexcept {
  return !field.is_relative && field.logical_low < field.logical_high;
}
bool is_button(const Field& field) noexcept {
  return field.usage > kButtonPage && field.usage <= (kButtonPage | 0xffff) && field.bit_size == 1;
}

struct Direction {
  float x = 0;
  float y = 0;  ///< Towards the user, as of a stick.
};

/// Of a hat with 4 or 8 directions, clockwise from away from the user; the centre for others.
Direction direction_of(const Field& field, std::int64_t value) noexcept {
  constexpr std::array<Direction, 8> kDirections{
      {{0, -1}, {1, -1}, {1, 0}, {1, 1}, {0, 1}, {-1, 1}, {-1, 0}, {-1, -1}}};
  const std::int64_t count = field.logical_high - field.logical_low + 1;
  if (value < field.logical_low || value > field.logical_high || (count != 4 && count != 8)) {
    return {};
  }
  return kDirections[static_cast<std::size_t>((value - field.logical_low) * 8 / count)];
}

}  // namespace

GamePad::GamePad(const Unit* unit) {
  const auto descriptor = unit != nullptr ? parse_report_descriptor(unit->report_descriptor)
                                          : unexpected{std::string("not plugged in")};
  if (!descriptor) {
    for (std::uint32_t axis = 0x30; axis <= 0x35; ++axis)
      add_analog(kDesktopPage + axis);
    add_analog(kHat);
    for (std::uint32_t i = 1; i <= driver::kButtonCountMax; ++i)
      buttons_.push_back({"button_" + std::to_string(i), kButtonPage + i});
    return;
  }
  if (!unit->model.empty()) model_ = unit->model;
  for (const Field& field : descriptor->inputs) {
    if (is_button(field) && buttons_.size() < driver::kButtonCountMax &&
        std::ranges::count(buttons_, field.usage, &Channel::usage) == 0) {
      buttons_.push_back({"button_" + std::to_string(field.usage - kButtonPage), field.usage});
    }
    if (is_usable(field) && std::ranges::count(analogs_, field.usage, &Channel::usage) == 0) {
      add_analog(field.usage);
    }
  }
  bind(*descriptor);
}

void GamePad::add_analog(std::uint32_t usage) {
  const char* const name = axis_name(usage);
  const std::size_t needed = usage == kHat ? 2 : 1;
  if (name == nullptr || analogs_.size() + needed > driver::kAnalogCountMax) return;
  if (usage == kHat) {
    analogs_.push_back({"hat_x", usage, Part::kHatX});
    analogs_.push_back({"hat_y", usage, Part::kHatY});
  } else {
    analogs_.push_back({name, usage});
  }
}

void GamePad::bind(const ReportDescriptor& descriptor) {
  layout_ = descriptor;
  const auto find = [&](Channel& channel, auto is_suitable) {
    channel.field.reset();
    for (const Field& field : descriptor.inputs) {
      if (field.usage == channel.usage && is_suitable(field)) {
        channel.field = field;
        return;
      }
    }
  };
  for (Channel& channel : analogs_)
    find(channel, is_usable);
  for (Channel& channel : buttons_)
    find(channel, is_button);
}

driver::Descriptor GamePad::describe() const {
  driver::Descriptor descriptor;
  descriptor.device_class = driver::DeviceClass::kInput;
  descriptor.model = model_;
  for (const Channel& channel : buttons_)
    descriptor.buttons.push_back(channel.name);
  for (const Channel& channel : analogs_) {
    const double low = goes_one_way(channel.usage) ? 0 : -1;
    descriptor.analogs.push_back({.name = channel.name, .unit = "1", .low = low, .high = 1});
  }
  descriptor.rate_hz = 125;
  return descriptor;
}

expected<void, SetupError> GamePad::begin(HidTransport&, const Unit& unit) {
  const auto descriptor = parse_report_descriptor(unit.report_descriptor);
  if (!descriptor) {
    return setup_error("the report descriptor of " + unit.node + " is unreadable",
                       descriptor.error(), "use its evdev device instead");
  }
  bind(*descriptor);
  return {};
}

Verdict GamePad::take(ConstBytes report, MonotonicTime, State& state) noexcept {
  if (report.empty()) return Verdict::kCorrupt;
  const std::size_t size = layout_.input_sizes[layout_.has_report_ids ? byte_at(report, 0) : 0];
  if (size == 0) return layout_.has_report_ids ? Verdict::kForeign : Verdict::kCorrupt;
  if (!has_size(report, size)) return Verdict::kCorrupt;
  for (std::size_t i = 0; i < analogs_.size(); ++i) {
    const Channel& channel = analogs_[i];
    const auto value = channel.field ? value_of(*channel.field, report) : std::nullopt;
    if (!value) continue;
    if (channel.part == Part::kWhole) {
      const bool is_none = channel.field->has_null && (*value < channel.field->logical_low ||
                                                       *value > channel.field->logical_high);
      if (!is_none) state.analogs[i] = static_cast<float>(share_of(*channel.field, *value));
    } else {
      const Direction direction = direction_of(*channel.field, *value);
      state.analogs[i] = channel.part == Part::kHatX ? direction.x : direction.y;
    }
  }
  std::uint32_t pressed = state.buttons;
  for (std::size_t i = 0; i < buttons_.size(); ++i) {
    const auto value = buttons_[i].field ? value_of(*buttons_[i].field, report) : std::nullopt;
    if (value) pressed = *value != 0 ? pressed | 1U << i : pressed & ~(1U << i);
  }
  state.set_buttons(pressed);
  return Verdict::kNew;
}

}  // namespace rtpm::device_hid
