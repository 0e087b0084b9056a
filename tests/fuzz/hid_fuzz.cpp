// Any bytes are a report descriptor or an error, and any reports of any device lead to a state
// within the device's description.

#include <array>
#include <cmath>
#include <cstdint>
#include <string>

#include "rtpm/base/assert.hpp"
#include "rtpm/device_hid/profiles.hpp"
#include "script.hpp"

using namespace rtpm;
using namespace rtpm::device_hid;

namespace {

/// A device that answers nothing; a fuzzer's own calibration over Bluetooth can't have its
/// checksum.
class SilentTransport final : public HidTransport {
 public:
  [[nodiscard]] Received read(MutableBytes, Duration patience) override {
    now_ += patience;
    return {};
  }
  [[nodiscard]] bool write(ConstBytes) override { return true; }
  [[nodiscard]] std::size_t read_feature(MutableBytes) override { return 0; }
  [[nodiscard]] MonotonicTime now() const override { return now_; }

 private:
  MonotonicTime now_{};
};

void check(const driver::Descriptor& descriptor, const State& state) {
  for (std::size_t i = 0; i < state.analogs.size(); ++i) {
    const double value = static_cast<double>(state.analogs[i]);
    const bool is_described = i < descriptor.analogs.size();
    RTPM_ASSERT(std::isfinite(value), "analogs are finite");
    RTPM_ASSERT(is_described || value == 0, "no analog is invented");
    RTPM_ASSERT(!is_described || value == 0 ||
                    (value >= descriptor.analogs[i].low && value <= descriptor.analogs[i].high),
                "analogs are within their range");
  }
  RTPM_ASSERT(std::isfinite(state.joint) && std::isfinite(state.joint_velocity),
              "joints are finite");
  RTPM_ASSERT((state.buttons >> descriptor.buttons.size()) == 0, "no button is invented");
}

void check_layout(const ReportDescriptor& layout) {
  RTPM_ASSERT(layout.inputs.size() <= kFieldCountMax, "fields are limited");
  RTPM_ASSERT(layout.unread.size() <= kUnreadCountMax, "what is left out is limited, too");
  for (const Field& field : layout.inputs) {
    const std::uint32_t bits = field.bit_offset + field.bit_size;
    RTPM_ASSERT(field.bit_size >= 1 && field.bit_size <= 32, "fields have 1 to 32 bits");
    RTPM_ASSERT(bits <= 8U * layout.input_sizes[field.report_id], "fields are in their reports");
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::Script script(data, size);
  const Kind kind = kKinds[script.byte() % kKinds.size()];
  Unit unit{.bus = script.byte() % 2 == 0 ? Bus::kUsb : Bus::kBluetooth, .node = "fuzz"};
  unit.product = static_cast<std::uint16_t>(script.number());
  const ConstBytes layout_bytes = script.bytes();
  unit.report_descriptor.assign(layout_bytes.begin(), layout_bytes.end());
  if (const auto layout = parse_report_descriptor(layout_bytes)) check_layout(*layout);

  RTPM_ASSERT(!kind_of(unit) || refusal_of(unit).empty(), "a unit is served or refused");
  const auto profile = make_profile(kind, &unit, 1);
  const driver::Descriptor descriptor = profile->describe();
  RTPM_ASSERT(descriptor.analogs.size() <= driver::kAnalogCountMax &&
                  descriptor.buttons.size() <= driver::kButtonCountMax,
              "channels are limited");
  SilentTransport transport;
  static_cast<void>(profile->begin(transport, unit));
  State state;
  MonotonicTime now{};
  while (script.has_more()) {
    const State before = state;
    now += std::chrono::milliseconds{script.byte()};
    const Verdict verdict = profile->take(script.bytes(), now, state);
    if (verdict != Verdict::kNew) {
      RTPM_ASSERT(before.analogs == state.analogs && before.buttons == state.buttons,
                  "a report that is dropped changes nothing");
    }
    check(descriptor, state);
  }
  RTPM_ASSERT(profile->encode({.effort = 1}).size <= 80, "output reports have their size");
  return 0;
}
