// Any bytes from a Falcon become packets of sound values, positions of its mechanism, or nothing.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "rtpm/base/assert.hpp"
#include "rtpm/device_falcon/session.hpp"

using namespace rtpm;

namespace {

/// A unit whose answers come from the fuzzer: a byte of length, then a transfer of that many bytes.
class FuzzedUnit final : public device_falcon::Transport {
 public:
  explicit FuzzedUnit(std::span<const std::byte> script) : script_(script) {}
  [[nodiscard]] bool has_more() const noexcept { return !script_.empty(); }

  device_falcon::UsbStatus request(device_falcon::FtdiRequest, std::uint16_t) override {
    return device_falcon::UsbStatus::kOk;
  }
  device_falcon::UsbStatus send(std::span<const std::byte> bytes) override {
    RTPM_ASSERT(bytes.size() == device_falcon::kPacketSize, "one packet at a time");
    const auto request = device_falcon::decode_request(bytes.first<device_falcon::kPacketSize>());
    RTPM_ASSERT(request.has_value(), "what is sent is a packet");
    for (const int count : request->counts)
      RTPM_ASSERT(std::abs(count) <= device_falcon::kMotorCountMax, "within the motors' range");
    return device_falcon::UsbStatus::kOk;
  }
  device_falcon::Received receive(std::span<std::byte> buffer, Duration) override {
    now_ += std::chrono::milliseconds{1};
    if (script_.empty()) return {device_falcon::UsbStatus::kTimeout, 0, now_};
    const auto wanted = std::to_integer<std::size_t>(script_[0]) * 2;
    const std::size_t size = std::min({wanted, script_.size() - 1, buffer.size()});
    std::copy_n(script_.begin() + 1, size, buffer.begin());
    script_ = script_.subspan(1 + size);
    return {device_falcon::UsbStatus::kOk, size, now_};
  }
  [[nodiscard]] MonotonicTime now() const override { return now_; }

 private:
  std::span<const std::byte> script_;
  MonotonicTime now_{std::chrono::seconds{1}};
};

bool is_finite(const driver::Vector3& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  FuzzedUnit unit(std::as_bytes(std::span(data, size)));
  device_falcon::Session session(unit);
  std::uint64_t number = 0;
  bool is_alive = true;
  while (is_alive && unit.has_more()) {
    is_alive =
        session.step({++number, {32767, -32768, 4095}, kNever}, std::chrono::milliseconds{1});
    const device_falcon::FalconState& state = session.state();
    RTPM_ASSERT(is_finite(state.position_m) && is_finite(state.velocity_m_per_s),
                "numbers are finite");
    RTPM_ASSERT(state.buttons < 16, "there are four buttons");
    RTPM_ASSERT(!state.is_homed || device_falcon::inverse(state.position_m).has_value() ||
                    state.position_m == driver::Vector3{},
                "the mechanism reaches the position");
  }
  session.stop();
  return 0;
}
