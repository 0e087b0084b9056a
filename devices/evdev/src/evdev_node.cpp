#include "evdev_node.hpp"

#include <fcntl.h>
#include <libevdev/libevdev.h>
#include <linux/input.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <ctime>
#include <utility>

#include "rtpm/device_io/found_device.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::device_evdev {
namespace {

/// Owns a file descriptor. The kernel erases the effects when the descriptor is closed.
class Handle {
 public:
  explicit Handle(int number) noexcept : number_(number) {}
  Handle(Handle&& other) noexcept : number_(std::exchange(other.number_, -1)) {}
  Handle& operator=(Handle&&) = delete;
  ~Handle() {
    if (number_ >= 0) ::close(number_);
  }
  [[nodiscard]] int number() const noexcept { return number_; }

 private:
  int number_;
};

struct FreeDevice {
  void operator()(libevdev* device) const { libevdev_free(device); }
};
using Device = std::unique_ptr<libevdev, FreeDevice>;

MonotonicTime time_of(const input_event& event) {
  return time_from_ns(event.input_event_sec * 1'000'000'000 + event.input_event_usec * 1'000);
}

std::vector<std::uint16_t> codes_of(const libevdev* device, unsigned type, unsigned end) {
  std::vector<std::uint16_t> codes;
  for (unsigned code = 0; code < end; ++code) {
    if (libevdev_has_event_code(device, type, code) != 0) {
      codes.push_back(static_cast<std::uint16_t>(code));
    }
  }
  return codes;
}

Capabilities capabilities_of(const libevdev* device, int node) {
  Capabilities capabilities;
  capabilities.name = libevdev_get_name(device);
  capabilities.is_accelerometer = libevdev_has_property(device, INPUT_PROP_ACCELEROMETER) != 0;
  for (const std::uint16_t code : codes_of(device, EV_ABS, ABS_CNT)) {
    const input_absinfo* const info = libevdev_get_abs_info(device, code);
    if (info == nullptr) continue;
    capabilities.absolute.push_back({code, info->minimum, info->maximum, info->flat,
                                     info->resolution,
                                     libevdev_get_event_value(device, EV_ABS, code)});
  }
  capabilities.relative = codes_of(device, EV_REL, REL_CNT);
  capabilities.keys = codes_of(device, EV_KEY, KEY_CNT);
  for (const std::uint16_t key : capabilities.keys) {
    if (libevdev_get_event_value(device, EV_KEY, key) != 0) capabilities.pressed.push_back(key);
  }
  capabilities.force_feedback = codes_of(device, EV_FF, FF_CNT);
  int effect_count = 0;
  if (::ioctl(node, EVIOCGEFFECTS, &effect_count) == 0) capabilities.effect_count = effect_count;
  return capabilities;
}

/// A condition with the same values on both sides of the centre.
ff_condition_effect condition(std::int16_t coefficient) {
  ff_condition_effect condition{};
  condition.right_saturation = condition.left_saturation = 0xffff;
  condition.right_coeff = condition.left_coeff = coefficient;
  return condition;
}

ff_effect to_kernel(const Effect& effect) {
  // Pushes to the right, towards larger axis values; a negative level pushes to the left.
  constexpr std::uint16_t kToTheRight = 0xc000;
  using Milliseconds = std::chrono::duration<std::uint16_t, std::milli>;
  ff_effect raw{};
  raw.id = static_cast<std::int16_t>(effect.id);
  raw.replay.length = std::chrono::duration_cast<Milliseconds>(effect.length).count();
  switch (effect.kind) {
    case EffectKind::kConstant:
      raw.type = FF_CONSTANT;
      raw.direction = kToTheRight;
      raw.u.constant.level = effect.level;
      break;
    case EffectKind::kRumble:
      raw.type = FF_RUMBLE;
      raw.u.rumble.strong_magnitude = effect.strong;
      raw.u.rumble.weak_magnitude = effect.weak;
      break;
    case EffectKind::kSpring:
    case EffectKind::kDamper:
      raw.type = effect.kind == EffectKind::kSpring ? FF_SPRING : FF_DAMPER;
      raw.direction = kToTheRight;
      raw.u.condition[0] = raw.u.condition[1] = condition(effect.coefficient);
      break;
  }
  return raw;
}

/// Only the reading thread uses libevdev; effects are written to the node directly.
class EvdevNode final : public Transport {
 public:
  EvdevNode(Handle node, Device device)
      : node_(std::move(node)),
        device_(std::move(device)),
        capabilities_(capabilities_of(device_.get(), node_.number())) {}

  [[nodiscard]] const Capabilities& capabilities() const override { return capabilities_; }
  [[nodiscard]] ReadResult read(std::span<Event> events, Duration patience) noexcept override;
  [[nodiscard]] int upload(Effect& effect) noexcept override;
  [[nodiscard]] int erase(int effect_id) noexcept override { return control(EVIOCRMFF, effect_id); }
  [[nodiscard]] int play(int effect_id, bool is_on) noexcept override {
    return write(static_cast<std::uint16_t>(effect_id), is_on ? 1 : 0);
  }
  [[nodiscard]] int set_gain(double share) noexcept override {
    return write(FF_GAIN, static_cast<std::int32_t>(std::clamp(share, 0.0, 1.0) * 0xffff));
  }
  [[nodiscard]] int disable_autocenter() noexcept override { return write(FF_AUTOCENTER, 0); }
  [[nodiscard]] MonotonicTime now() const noexcept override { return rt::now(); }

 private:
  [[nodiscard]] int control(unsigned long request, auto argument) noexcept;
  [[nodiscard]] int write(std::uint16_t code, std::int32_t value) noexcept;
  [[nodiscard]] int next(Event& event) noexcept;
  [[nodiscard]] bool await(Duration patience) noexcept;

  Handle node_;
  Device device_;
  Capabilities capabilities_;
  bool is_catching_up_ = false;
};

int EvdevNode::control(unsigned long request, auto argument) noexcept {
  int result = 0;
  do {
    result = ::ioctl(node_.number(), request, argument);
  } while (result < 0 && errno == EINTR);
  return result < 0 ? errno : 0;
}

int EvdevNode::upload(Effect& effect) noexcept {
  ff_effect raw = to_kernel(effect);
  const int error = control(EVIOCSFF, &raw);
  if (error == 0) effect.id = raw.id;
  return error;
}

int EvdevNode::write(std::uint16_t code, std::int32_t value) noexcept {
  input_event event{};
  event.type = EV_FF;
  event.code = code;
  event.value = value;
  ssize_t size = 0;
  do {
    size = ::write(node_.number(), &event, sizeof event);
  } while (size < 0 && errno == EINTR);
  if (size < 0) return errno;
  return size == sizeof event ? 0 : EIO;
}

/// @return an errno; 0 if `event` was read; EAGAIN if no event is waiting
int EvdevNode::next(Event& event) noexcept {
  input_event raw{};
  while (true) {
    const unsigned flag = is_catching_up_ ? LIBEVDEV_READ_FLAG_SYNC : LIBEVDEV_READ_FLAG_NORMAL;
    const int result = libevdev_next_event(device_.get(), flag, &raw);
    if (result == -EAGAIN && std::exchange(is_catching_up_, false)) continue;
    if (result < 0) return -result;
    if (result == LIBEVDEV_READ_STATUS_SYNC) is_catching_up_ = true;
    event = {time_of(raw), raw.type, raw.code, raw.value};
    return 0;
  }
}

/// @return false if the device is gone
bool EvdevNode::await(Duration patience) noexcept {
  pollfd waiting{.fd = node_.number(), .events = POLLIN, .revents = 0};
  const auto ms = std::chrono::ceil<std::chrono::milliseconds>(patience);
  const int ready = ::poll(&waiting, 1, static_cast<int>(ms.count()));
  // An unplugged device may still have events to be read.
  return ready <= 0 || (waiting.revents & POLLIN) != 0 ||
         (waiting.revents & (POLLERR | POLLHUP | POLLNVAL)) == 0;
}

ReadResult EvdevNode::read(std::span<Event> events, Duration patience) noexcept {
  ReadResult result;
  bool has_waited = false;
  while (result.count < events.size()) {
    const int error = next(events[result.count]);
    if (error == 0) {
      ++result.count;
      continue;
    }
    if (error == EINTR) continue;
    if (error != EAGAIN) {
      result.status = error == EINVAL ? ReadStatus::kCorrupt : ReadStatus::kGone;
      return result;
    }
    if (result.count > 0 || has_waited) return result;
    has_waited = true;
    if (!await(patience)) return {ReadStatus::kGone, 0};
  }
  return result;
}

unexpected<SetupError> refusal(const Unit& unit, int error) {
  const std::string what = unit.node + " (" + unit.name + ") can't be opened";
  if (error != EACCES && error != EPERM) {
    return setup_error(what, system_error(error), "plug it in again");
  }
  const std::string rule = device_io::udev_rule("input", unit.vendor, unit.product);
  return setup_error(what, system_error(error), device_io::rule_remedy(rule));
}

}  // namespace

expected<std::unique_ptr<Transport>, SetupError> open_node(const Unit& unit, bool is_grabbed) {
  Handle node(::open(unit.node.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC));
  if (node.number() < 0) return refusal(unit, errno);
  libevdev* raw = nullptr;
  if (const int error = libevdev_new_from_fd(node.number(), &raw); error < 0) {
    return refusal(unit, -error);
  }
  Device device(raw);
  if (const int error = libevdev_set_clock_id(device.get(), CLOCK_MONOTONIC); error < 0) {
    return refusal(unit, -error);
  }
  if (is_grabbed && libevdev_grab(device.get(), LIBEVDEV_GRAB) < 0) {
    return setup_error(unit.node + " (" + unit.name + ") can't be grabbed",
                       "another program has grabbed it", "end that program, or give grab=no");
  }
  return std::make_unique<EvdevNode>(std::move(node), std::move(device));
}

}  // namespace rtpm::device_evdev
