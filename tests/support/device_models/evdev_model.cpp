#include "evdev_model.hpp"

#include <linux/input.h>

#include <algorithm>
#include <cerrno>
#include <limits>
#include <string>
#include <utility>

namespace rtpm::test {

using device_evdev::AbsoluteAxis;
using device_evdev::Effect;
using device_evdev::EffectKind;
using device_evdev::ReadResult;
using device_evdev::ReadStatus;

namespace {

/// The model behind the transport interface: closes its node with it.
class ModelTransport final : public device_evdev::Transport {
 public:
  explicit ModelTransport(EvdevModel& model) : model_(model), has_(model.capabilities()) {}
  ~ModelTransport() override { model_.close(); }
  [[nodiscard]] const device_evdev::Capabilities& capabilities() const override { return has_; }
  [[nodiscard]] ReadResult read(std::span<device_evdev::Event> events, Duration) noexcept override {
    return model_.read(events);
  }
  [[nodiscard]] int upload(Effect& effect) noexcept override { return model_.upload(effect); }
  [[nodiscard]] int erase(int id) noexcept override { return model_.erase(id); }
  [[nodiscard]] int play(int id, bool is_on) noexcept override { return model_.play(id, is_on); }
  [[nodiscard]] int set_gain(double share) noexcept override { return model_.set_gain(share); }
  [[nodiscard]] int disable_autocenter() noexcept override { return model_.disable_autocenter(); }
  [[nodiscard]] MonotonicTime now() const noexcept override { return model_.now(); }

 private:
  EvdevModel& model_;
  device_evdev::Capabilities has_;
};

}  // namespace

EvdevModel::EvdevModel(Capabilities capabilities) : capabilities_(std::move(capabilities)) {
  unit_ = {.node = "/dev/input/event5",
           .name = capabilities_.name,
           .serial = "A1",
           .path = "usb-0:1",
           .vendor = 0x046d,
           .product = 0xc24f,
           .is_joystick = true};
  for (const AbsoluteAxis& axis : capabilities_.absolute)
    axes_[axis.code] = axis.value;
}

device_evdev::Capabilities EvdevModel::pad() {
  Capabilities pad;
  pad.name = "Model Pad";
  for (const int code : {ABS_X, ABS_Y, ABS_RX, ABS_RY}) {
    pad.absolute.push_back({.code = static_cast<std::uint16_t>(code),
                            .minimum = -32'768,
                            .maximum = 32'767,
                            .flat = 128});
  }
  pad.absolute.insert(pad.absolute.begin() + 2, {.code = ABS_Z, .minimum = 0, .maximum = 255});
  pad.absolute.push_back({.code = ABS_RZ, .minimum = 0, .maximum = 255});
  pad.absolute.push_back({.code = ABS_HAT0X, .minimum = -1, .maximum = 1});
  pad.absolute.push_back({.code = ABS_HAT0Y, .minimum = -1, .maximum = 1});
  pad.keys = {BTN_SOUTH,  BTN_EAST,  BTN_NORTH, BTN_WEST,   BTN_TL,    BTN_TR,
              BTN_SELECT, BTN_START, BTN_MODE,  BTN_THUMBL, BTN_THUMBR};
  pad.force_feedback = {FF_RUMBLE, FF_PERIODIC, FF_CONSTANT, FF_GAIN};
  pad.effect_count = 16;
  return pad;
}

device_evdev::Capabilities EvdevModel::wheel() {
  Capabilities wheel;
  wheel.name = "Model Racing Wheel";
  wheel.absolute = {{.code = ABS_X, .minimum = 0, .maximum = 65'535, .value = 32'768},
                    {.code = ABS_Z, .minimum = 0, .maximum = 255},
                    {.code = ABS_RZ, .minimum = 0, .maximum = 255}};
  wheel.keys = {BTN_TRIGGER, BTN_THUMB, BTN_GEAR_DOWN, BTN_GEAR_UP};
  wheel.force_feedback = {FF_CONSTANT, FF_SPRING, FF_DAMPER, FF_GAIN, FF_AUTOCENTER};
  wheel.effect_count = 16;
  return wheel;
}

device_evdev::Capabilities EvdevModel::dial() {
  Capabilities dial;
  dial.name = "Model Dial";
  dial.relative = {REL_DIAL};
  dial.keys = {BTN_0};
  return dial;
}

void EvdevModel::move(std::uint16_t axis, std::int32_t value) {
  const Lock lock(mutex_);
  axes_[axis] = value;
  push(EV_ABS, axis, value);
}

void EvdevModel::turn(std::uint16_t relative_axis, std::int32_t step) {
  const Lock lock(mutex_);
  push(EV_REL, relative_axis, step);
}

void EvdevModel::press(std::uint16_t key, bool is_down) {
  const Lock lock(mutex_);
  if (is_down) {
    pressed_.insert(key);
  } else {
    pressed_.erase(key);
  }
  push(EV_KEY, key, is_down ? 1 : 0);
}

void EvdevModel::report() {
  const Lock lock(mutex_);
  push(EV_SYN, SYN_REPORT, 0);
  changed_.notify_all();
}

void EvdevModel::push(std::uint16_t type, std::uint16_t code, std::int32_t value) {
  if (is_plugged_in_) events_.push_back({now_, type, code, value});
}

/// Reports as libevdev does after SYN_DROPPED: the kernel's current state, whatever the events
/// said.
void EvdevModel::push_state() {
  push(EV_SYN, SYN_DROPPED, 0);
  for (const auto& [axis, value] : axes_)
    push(EV_ABS, axis, value);
  for (const std::uint16_t key : capabilities_.keys)
    push(EV_KEY, key, pressed_.contains(key) ? 1 : 0);
  push(EV_SYN, SYN_REPORT, 0);
}

void EvdevModel::advance(Duration time) {
  const Lock lock(mutex_);
  now_ += time;
}

void EvdevModel::set_fault(EvdevFault fault, std::uint64_t from) {
  const Lock lock(mutex_);
  fault_ = fault;
  faulty_from_ = from;
  read_count_ = write_count_ = 0;
  changed_.notify_all();
}

void EvdevModel::unplug() {
  const Lock lock(mutex_);
  is_plugged_in_ = false;
  events_.clear();
  effects_.clear();
  changed_.notify_all();
}

void EvdevModel::plug_in() {
  const Lock lock(mutex_);
  is_plugged_in_ = true;
  fault_ = EvdevFault::kNone;
  pressed_.clear();
  has_autocenter_ = true;
  unit_.node = "/dev/input/event" + std::to_string(++node_number_);
}

void EvdevModel::set_blocked(bool is_blocked) {
  const Lock lock(mutex_);
  is_blocked_ = is_blocked;
  changed_.notify_all();
}

device_evdev::Levels EvdevModel::levels() const {
  const Lock lock(mutex_);
  return levels_locked();
}

device_evdev::Levels EvdevModel::levels_locked() const {
  Levels sum;
  for (const auto& [id, uploaded] : effects_) {
    if (!uploaded.is_playing || now_ - uploaded.started_at >= uploaded.effect.length) continue;
    sum.effort = static_cast<std::int16_t>(sum.effort + uploaded.effect.level);
    sum.strong = std::max(sum.strong, uploaded.effect.strong);
    sum.weak = std::max(sum.weak, uploaded.effect.weak);
    if (uploaded.effect.kind == EffectKind::kSpring) sum.spring = uploaded.effect.coefficient;
    if (uploaded.effect.kind == EffectKind::kDamper) sum.damper = uploaded.effect.coefficient;
  }
  return sum;
}

std::size_t EvdevModel::effect_count() const {
  const Lock lock(mutex_);
  return effects_.size();
}
std::size_t EvdevModel::abandoned_count() const {
  const Lock lock(mutex_);
  return abandoned_count_;
}
bool EvdevModel::was_left_playing() const {
  const Lock lock(mutex_);
  return was_left_playing_;
}
std::uint64_t EvdevModel::upload_count() const {
  const Lock lock(mutex_);
  return upload_count_;
}
std::uint64_t EvdevModel::new_effect_count() const {
  const Lock lock(mutex_);
  return static_cast<std::uint64_t>(next_effect_id_);
}
double EvdevModel::gain() const {
  const Lock lock(mutex_);
  return gain_;
}
bool EvdevModel::has_autocenter() const {
  const Lock lock(mutex_);
  return has_autocenter_;
}
bool EvdevModel::is_grabbed() const {
  const Lock lock(mutex_);
  return is_grabbed_;
}
bool EvdevModel::is_plugged_in() const {
  const Lock lock(mutex_);
  return is_plugged_in_;
}
std::size_t EvdevModel::waiting_event_count() const {
  const Lock lock(mutex_);
  return events_.size();
}
MonotonicTime EvdevModel::now() const {
  const Lock lock(mutex_);
  return now_;
}
device_evdev::Unit EvdevModel::unit() const {
  const Lock lock(mutex_);
  return unit_;
}
void EvdevModel::set_unit(const device_evdev::Unit& unit) {
  const Lock lock(mutex_);
  unit_ = unit;
}

device_evdev::Access EvdevModel::access() {
  using Opened = expected<std::unique_ptr<device_evdev::Transport>, SetupError>;
  device_evdev::Access access;
  access.list = [this] {
    std::vector<device_evdev::Unit> units;
    const Lock lock(mutex_);
    if (is_plugged_in_) units.push_back(unit_);
    return units;
  };
  access.open = [this](const device_evdev::Unit&, bool is_grabbed) -> Opened {
    if (!open(is_grabbed)) return setup_error("the model is gone", "", "plug it in");
    return std::make_unique<ModelTransport>(*this);
  };
  return access;
}

bool EvdevModel::open(bool is_grabbed) {
  const Lock lock(mutex_);
  if (!is_plugged_in_) return false;
  is_open_ = true;
  is_grabbed_ = is_grabbed;
  events_.clear();
  return true;
}

void EvdevModel::close() {
  const Lock lock(mutex_);
  abandoned_count_ += effects_.size();
  was_left_playing_ = was_left_playing_ || levels_locked() != Levels{};
  effects_.clear();
  is_open_ = is_grabbed_ = false;
}

device_evdev::Capabilities EvdevModel::capabilities() const {
  const Lock lock(mutex_);
  Capabilities present = capabilities_;
  for (AbsoluteAxis& axis : present.absolute)
    axis.value = axes_.at(axis.code);
  present.pressed.assign(pressed_.begin(), pressed_.end());
  return present;
}

bool EvdevModel::is_faulty_read(EvdevFault fault) const {
  return fault_ == fault && read_count_ > faulty_from_;
}

std::uint32_t EvdevModel::random() {
  random_ = random_ * 1'664'525 + 1'013'904'223;
  return random_ >> 8;
}

/// The faults that change events and not reads.
void EvdevModel::spoil_events() {
  if (is_faulty_read(EvdevFault::kDropped)) {
    events_.clear();
    push_state();
  }
  if (is_faulty_read(EvdevFault::kLostReport)) {
    std::erase_if(events_, [](const Event& event) { return event.type == EV_SYN; });
  }
  for (Event& event : events_) {
    if (is_faulty_read(EvdevFault::kOutOfRange) && event.type == EV_ABS) {
      event.value = std::numeric_limits<std::int32_t>::min();
    }
    if (is_faulty_read(EvdevFault::kClockAhead)) event.time += std::chrono::hours{1};
    if (is_faulty_read(EvdevFault::kClockBehind)) event.time = MonotonicTime{};
  }
}

ReadResult EvdevModel::read(std::span<Event> events) {
  Lock lock(mutex_);
  // Real time bounds the wait, because the driver's threads are real.
  if (events_.empty() && is_plugged_in_) changed_.wait_for(lock, std::chrono::microseconds{200});
  ++read_count_;
  if (!is_plugged_in_ || is_faulty_read(EvdevFault::kGone)) return {ReadStatus::kGone, 0};
  if (is_faulty_read(EvdevFault::kShortRead)) return {ReadStatus::kCorrupt, 0};
  if (is_faulty_read(EvdevFault::kGarbage)) {
    for (Event& event : events) {
      event = {time_from_ns(random()), static_cast<std::uint16_t>(random()),
               static_cast<std::uint16_t>(random()), static_cast<std::int32_t>(random() << 9)};
    }
    return {ReadStatus::kOk, events.size()};
  }
  if (is_faulty_read(EvdevFault::kFlood)) {
    while (events_.size() < events.size())
      push(EV_ABS, ABS_X, static_cast<std::int32_t>(random() & 0xff));
    push(EV_SYN, SYN_REPORT, 0);
  }
  spoil_events();
  const std::size_t count = std::min(events.size(), events_.size());
  std::copy_n(events_.begin(), count, events.begin());
  events_.erase(events_.begin(), events_.begin() + static_cast<std::ptrdiff_t>(count));
  return {ReadStatus::kOk, count};
}

/// @return `error` if its fault has begun, or another fault's error; 0 if the write is done
int EvdevModel::begin_write(Lock& lock, EvdevFault fault, int error) {
  changed_.wait(lock, [this] { return !is_blocked_; });
  ++write_count_;
  const bool has_begun = write_count_ > faulty_from_;
  if (!is_plugged_in_ || (fault_ == EvdevFault::kGone && has_begun)) return ENODEV;
  if (fault_ == EvdevFault::kInterrupted && has_begun && write_count_ % 2 == 0) return EBUSY;
  return fault_ == fault && has_begun ? error : 0;
}

int EvdevModel::upload(Effect& effect) {
  Lock lock(mutex_);
  const bool has_no_slot = fault_ == EvdevFault::kNoSlots;
  const EvdevFault fault = has_no_slot ? EvdevFault::kNoSlots : EvdevFault::kUploadFails;
  if (const int error = begin_write(lock, fault, has_no_slot ? ENOSPC : EIO)) return error;
  ++upload_count_;
  if (effect.id < 0) {
    if (effects_.size() >= static_cast<std::size_t>(capabilities_.effect_count)) return ENOSPC;
    effect.id = next_effect_id_++;
  } else if (!effects_.contains(effect.id)) {
    return EINVAL;
  }
  effects_[effect.id].effect = effect;
  return 0;
}

int EvdevModel::erase(int id) {
  Lock lock(mutex_);
  if (const int error = begin_write(lock, EvdevFault::kEraseFails, EINVAL)) return error;
  return effects_.erase(id) == 1 ? 0 : EINVAL;
}

int EvdevModel::play(int id, bool is_on) {
  Lock lock(mutex_);
  if (const int error = begin_write(lock, EvdevFault::kPlayFails, EIO)) return error;
  const auto found = effects_.find(id);
  if (found == effects_.end()) return EINVAL;
  found->second.is_playing = is_on;
  found->second.started_at = now_;
  return 0;
}

int EvdevModel::set_gain(double share) {
  Lock lock(mutex_);
  if (const int error = begin_write(lock, EvdevFault::kPlayFails, EIO)) return error;
  gain_ = share;
  return 0;
}

int EvdevModel::disable_autocenter() {
  Lock lock(mutex_);
  if (const int error = begin_write(lock, EvdevFault::kPlayFails, EIO)) return error;
  has_autocenter_ = false;
  return 0;
}

}  // namespace rtpm::test
