#include "rtpm/device_serial/board.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <string>
#include <string_view>
#include <tuple>

#include "rtpm/device_serial/frames.hpp"

namespace rtpm::device_serial {
namespace {

constexpr std::uint8_t kStatusWatchdog = 1;
constexpr std::uint8_t kStatusSaturated = 2;
constexpr std::uint8_t kCommandOn = 1;
constexpr double kEffortMax = 1000;  ///< A larger effort is a mistake in the board's description.

float take_float(ByteReader& reader) noexcept {
  return std::bit_cast<float>(reader.take<std::uint32_t>());
}

void put_float(ByteWriter& writer, float value) noexcept {
  writer.put(std::bit_cast<std::uint32_t>(value));
}

/// Reads a description from its start and stores the first fault.
class DescriptionReader {
 public:
  explicit DescriptionReader(ConstBytes payload) : reader_(payload) {}

  [[nodiscard]] expected<BoardDescription, std::string> read() {
    BoardDescription board;
    board.nonce = reader_.take<std::uint32_t>();
    board.rate_hz = reader_.take<std::uint16_t>();
    check(board.rate_hz > 0 && board.rate_hz <= kBoardRateMaxHz, "its rate is not 1 to 4000 Hz");
    board.name = take_text("its name", 1);
    board.serial = take_text("its serial number", 0);
    take_list(board.joints, driver::kJointCountMax, "joints", [this] { return take_joint(); });
    take_list(board.analogs, driver::kAnalogCountMax, "analogs", [this] { return take_analog(); });
    take_list(board.buttons, driver::kButtonCountMax, "buttons",
              [this] { return take_text("a button's name", 1); });
    take_list(board.outputs, driver::kOutputCountMax, "outputs", [this] { return take_output(); });
    check(reader_.ok(), "it ends too early");
    check(reader_.left() == 0, "bytes follow its end");
    if (!fault_.empty()) return unexpected{fault_};
    return board;
  }

 private:
  void check(bool is_right, std::string_view fault) {
    if (!is_right && fault_.empty()) fault_ = reader_.ok() ? fault : "it ends too early";
  }

  std::string take_text(const char* what, std::size_t size_min) {
    const ConstBytes bytes = reader_.take_bytes(reader_.take<std::uint8_t>());
    std::string text;
    for (const std::byte byte : bytes)
      text += std::to_integer<char>(byte);
    const bool is_plain = std::ranges::all_of(text, [](char c) { return c >= ' ' && c <= '~'; });
    const bool has_size = text.size() >= size_min && text.size() <= kBoardTextSizeMax;
    std::string fault = what;
    fault += " is not " + std::to_string(size_min) + " to 31 characters of ASCII";
    check(is_plain && has_size, fault);
    return text;
  }

  template <class Item, class TakeItem>
  void take_list(std::vector<Item>& list, std::size_t count_max, const char* what,
                 TakeItem&& take_item) {
    const std::size_t count = reader_.take<std::uint8_t>();
    std::string fault = "it has too many ";
    fault += what;
    check(count <= count_max, fault);
    for (std::size_t i = 0; i < count && fault_.empty(); ++i)
      list.push_back(take_item());
  }

  driver::Joint take_joint() {
    driver::Joint joint;
    joint.name = take_text("a joint's name", 1);
    const auto unit = reader_.take<std::uint8_t>();
    check(unit <= 1, "a joint's unit is neither 0 (rad) nor 1 (m)");
    joint.unit = unit == 0 ? "rad" : "m";
    joint.low = take_float(reader_);
    joint.high = take_float(reader_);
    joint.effort_max = take_float(reader_);
    check(is_range(joint.low, joint.high), "a joint's range is not finite or empty");
    check(joint.effort_max >= 0 && joint.effort_max <= kEffortMax,
          "a joint's greatest effort is not 0 to 1000");
    return joint;
  }

  driver::Analog take_analog() {
    driver::Analog analog;
    analog.name = take_text("an analog's name", 1);
    analog.unit = take_text("an analog's unit", 1);
    analog.low = take_float(reader_);
    analog.high = take_float(reader_);
    check(is_range(analog.low, analog.high), "an analog's range is not finite or empty");
    return analog;
  }

  driver::Output take_output() {
    driver::Output output;
    output.name = take_text("an output's name", 1);
    output.unit = take_text("an output's unit", 1);
    output.low = take_float(reader_);
    output.high = take_float(reader_);
    output.safe = take_float(reader_);
    check(is_range(output.low, output.high), "an output's range is not finite or empty");
    check(output.safe >= output.low && output.safe <= output.high,
          "an output's safe value is outside its range");
    return output;
  }

  /// Equal limits mean a joint that turns endlessly.
  static bool is_range(double low, double high) {
    return std::isfinite(low) && std::isfinite(high) && low <= high;
  }

  ByteReader reader_;
  std::string fault_{};
};

template <class Item, class Key>
bool are_equal(const std::vector<Item>& a, const std::vector<Item>& b, Key&& key) {
  return std::ranges::equal(a, b, {}, key, key);
}

}  // namespace

BoardShape BoardDescription::shape() const noexcept {
  return {joints.size(), analogs.size(), buttons.size(), outputs.size()};
}

bool BoardDescription::has_channels_of(const BoardDescription& other) const {
  return rate_hz == other.rate_hz && buttons == other.buttons &&
         are_equal(joints, other.joints,
                   [](const auto& j) {
                     return std::tuple(j.name, j.unit, j.low, j.high, j.effort_max);
                   }) &&
         are_equal(analogs, other.analogs,
                   [](const auto& a) { return std::tuple(a.name, a.unit, a.low, a.high); }) &&
         are_equal(outputs, other.outputs,
                   [](const auto& o) { return std::tuple(o.name, o.unit, o.low, o.high, o.safe); });
}

expected<BoardDescription, std::string> parse_description(ConstBytes payload) {
  return DescriptionReader(payload).read();
}

std::optional<BoardState> parse_state(ConstBytes payload, const BoardShape& shape) noexcept {
  ByteReader reader(payload);
  BoardState state;
  state.answered = reader.take<std::uint16_t>();
  const auto status = reader.take<std::uint8_t>();
  state.is_watchdog_over = (status & kStatusWatchdog) != 0;
  state.is_saturated = (status & kStatusSaturated) != 0;
  state.bad_frame_count = reader.take<std::uint8_t>();
  state.time_us = reader.take<std::uint32_t>();
  state.buttons = reader.take<std::uint16_t>();
  bool is_finite = true;
  const auto take = [&] {
    const float value = take_float(reader);
    is_finite = is_finite && std::isfinite(value);
    return value;
  };
  for (std::size_t i = 0; i < shape.joint_count; ++i) {
    state.positions[i] = take();
    state.velocities[i] = take();
    state.efforts[i] = take();
  }
  for (std::size_t i = 0; i < shape.analog_count; ++i)
    state.analogs[i] = take();
  for (std::size_t i = 0; i < shape.output_count; ++i)
    state.outputs[i] = take();
  const bool is_whole = reader.ok() && reader.left() == 0;
  const bool has_own_bits = (status & ~(kStatusWatchdog | kStatusSaturated)) == 0 &&
                            (std::uint32_t{state.buttons} >> shape.button_count) == 0;
  if (!is_whole || !is_finite || !has_own_bits) return std::nullopt;
  return state;
}

std::size_t write_command(const BoardCommand& command, const BoardShape& shape,
                          MutableBytes payload) noexcept {
  ByteWriter writer(payload);
  writer.put(command.is_on ? kCommandOn : std::uint8_t{0});
  writer.put(std::clamp(command.watchdog_ms, std::uint16_t{1}, kWatchdogMaxMs));
  for (std::size_t i = 0; i < shape.joint_count; ++i)
    put_float(writer, command.efforts[i]);
  for (std::size_t i = 0; i < shape.output_count; ++i)
    put_float(writer, command.outputs[i]);
  return writer.size();
}

std::size_t exchange_size(const BoardShape& shape) noexcept {
  const auto framed = [](std::size_t payload_size) {
    return kHeaderSize + payload_size + kChecksumSize + 2;
  };
  return framed(3 + 4 * (shape.joint_count + shape.output_count)) +
         framed(10 + 4 * (3 * shape.joint_count + shape.analog_count + shape.output_count));
}

}  // namespace rtpm::device_serial
