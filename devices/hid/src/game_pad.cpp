#include <algorithm>
#include <array>
#include <cstdio>
#include <utility>

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
  float y = 0;  ///< Towards the user is positive, as for a stick.
};

/// Converts a hat value, which counts clockwise starting away from the user; a value outside the
/// range means the centre.
Direction direction_of(const Field& field, std::int64_t value) noexcept {
  constexpr std::array<Direction, 8> kDirections{
      {{0, -1}, {1, -1}, {1, 0}, {1, 1}, {0, 1}, {-1, 1}, {-1, 0}, {-1, -1}}};
  const std::int64_t count = field.logical_high - field.logical_low + 1;
  if (value < field.logical_low || value > field.logical_high) return {};
  return kDirections[static_cast<std::size_t>((value - field.logical_low) * 8 / count)];
}

/// Returns "" for the first control with a usage, "_2" for the second.
std::string suffix_of(std::size_t index) {
  return index == 0 ? "" : "_" + std::to_string(index + 1);
}

std::string in_hex(std::uint32_t number) {
  std::array<char, 12> text{};
  std::snprintf(text.data(), text.size(), "0x%x", number);
  return text.data();
}

/// The parts of a report descriptor without a channel, as text for users.
class LeftOut {
 public:
  void add_field(const Field& field) {
    const char* const name = axis_name(field.usage);
    if (is_button(field)) {
      ++button_count_;
    } else if (name == nullptr) {
      add(other_, "of usage " + in_hex(field.usage), 1);
    } else if (field.is_relative) {
      add(other_, "relative (" + std::string(name) + ")", 1);
    } else if (!is_usable(field)) {
      add(other_, "without a range (" + std::string(name) + ")", 1);
    } else {
      axes_ += (axes_.empty() ? "" : ", ") + std::string(name);
    }
  }
  void add_unread(const UnreadFields& fields, std::uint32_t application) {
    constexpr std::uint32_t kMakersPages = 0xff00'0000;
    if (fields.application != application) return add_application(fields.application, fields.count);
    const bool is_makers = fields.page >= kMakersPages;
    add(other_, is_makers ? "of the maker's own" : "of page " + in_hex(fields.page >> 16),
        fields.count);
  }
  void add_application(std::uint32_t application, std::uint32_t field_count) {
    add(other_, "of the application " + in_hex(application), field_count);
  }
  [[nodiscard]] std::string text() const {
    std::string text;
    const auto append = [&](const std::string& clause) {
      text += (text.empty() ? "" : "; ") + clause;
    };
    if (!axes_.empty()) {
      append(axes_ + ": a sample holds " + std::to_string(driver::kAnalogCountMax) + " analogs");
    }
    if (button_count_ > 0) {
      append(std::to_string(button_count_) + " buttons: a sample holds " +
             std::to_string(driver::kButtonCountMax));
    }
    for (const auto& [what, count] : other_)
      append(std::to_string(count) + (count == 1 ? " field " : " fields ") + what);
    return text;
  }

 private:
  using Counts = std::vector<std::pair<std::string, std::uint32_t>>;
  static void add(Counts& counts, const std::string& what, std::uint32_t count) {
    const auto known = std::ranges::find(counts, what, &Counts::value_type::first);
    if (known != counts.end()) {
      known->second += count;
    } else {
      counts.emplace_back(what, count);
    }
  }

  std::string axes_{};
  std::uint32_t button_count_ = 0;
  Counts other_{};
};

}  // namespace

GamePad::GamePad(const Unit* unit) {
  const auto descriptor = unit != nullptr ? parse_report_descriptor(unit->report_descriptor)
                                          : unexpected{std::string("not plugged in")};
  if (!descriptor) {
    for (std::uint32_t axis = 0x30; axis <= 0x35; ++axis)
      static_cast<void>(add_analog(kDesktopPage + axis));
    static_cast<void>(add_analog(kHat));
    for (std::uint32_t i = 1; i <= driver::kButtonCountMax; ++i)
      static_cast<void>(add_button(kButtonPage + i));
    return;
  }
  if (!unit->model.empty()) model_ = unit->model;
  LeftOut left_out;
  const std::uint32_t application = served_application(*descriptor);
  for (const Field& field : descriptor->inputs) {
    if (field.application != application) {
      left_out.add_application(field.application, 1);
    } else if (!take_field(field)) {
      left_out.add_field(field);
    }
  }
  for (const UnreadFields& fields : descriptor->unread)
    left_out.add_unread(fields, application);
  left_out_ = left_out.text();
  bind(*descriptor);
}

/// Like Linux, which creates an input device for each application.
std::uint32_t GamePad::served_application(const ReportDescriptor& descriptor) {
  const auto is_served = [](const Field& field) {
    return is_button(field) || (is_usable(field) && axis_name(field.usage) != nullptr);
  };
  for (const bool is_any_taken : {false, true}) {
    for (const Field& field : descriptor.inputs) {
      if (is_served(field) && (is_any_taken || is_pad_application(field.application))) {
        return field.application;
      }
    }
  }
  return 0;
}

bool GamePad::take_field(const Field& field) {
  if (is_button(field)) return add_button(field.usage);
  return is_usable(field) && add_analog(field.usage);
}

bool GamePad::add_button(std::uint32_t usage) {
  if (buttons_.size() == driver::kButtonCountMax) return false;
  const std::size_t index = count_of(buttons_, usage, Part::kWhole);
  buttons_.push_back(
      {"button_" + std::to_string(usage - kButtonPage) + suffix_of(index), usage, index});
  return true;
}

/// A repeated usage is another control, such as the second of two sliders.
bool GamePad::add_analog(std::uint32_t usage) {
  const char* const name = axis_name(usage);
  const std::size_t needed = usage == kHat ? 2 : 1;
  if (name == nullptr || analogs_.size() + needed > driver::kAnalogCountMax) return false;
  if (usage == kHat) {
    const std::size_t index = count_of(analogs_, usage, Part::kHatX);
    analogs_.push_back({"hat_x" + suffix_of(index), usage, index, Part::kHatX});
    analogs_.push_back({"hat_y" + suffix_of(index), usage, index, Part::kHatY});
  } else {
    const std::size_t index = count_of(analogs_, usage, Part::kWhole);
    analogs_.push_back({name + suffix_of(index), usage, index});
  }
  return true;
}

std::size_t GamePad::count_of(const std::vector<Channel>& channels, std::uint32_t usage,
                              Part part) {
  return static_cast<std::size_t>(std::ranges::count_if(channels, [&](const Channel& channel) {
    return channel.usage == usage && channel.part == part;
  }));
}

void GamePad::bind(const ReportDescriptor& descriptor) {
  layout_ = descriptor;
  const std::uint32_t application = served_application(descriptor);
  const auto find = [&](Channel& channel, auto is_suitable) {
    channel.field.reset();
    std::size_t index = 0;
    for (const Field& field : descriptor.inputs) {
      if (field.application != application || field.usage != channel.usage || !is_suitable(field) ||
          index++ != channel.index) {
        continue;
      }
      channel.field = field;
      return;
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
