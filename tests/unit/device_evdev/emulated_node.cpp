#include "emulated_node.hpp"

#include <linux/input.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <optional>
#include <span>
#include <string>

#include "rtpm/base/assert.hpp"
#include "rtpm/rt/clock.hpp"
#include "umockdev.hpp"

namespace rtpm::test {

using device_evdev::AbsoluteAxis;
using device_evdev::Capabilities;
using device_evdev::Effect;
using device_evdev::EffectKind;

namespace {

/// The data that one ioctl returns.
using Bytes = std::vector<std::uint8_t>;

template <class T>
Bytes bytes_of(const T& value) {
  Bytes bytes(sizeof value);
  std::memcpy(bytes.data(), &value, sizeof value);
  return bytes;
}

Bytes bits_of(const std::vector<std::uint16_t>& codes, std::size_t size) {
  Bytes bits(size);
  for (const std::uint16_t code : codes) {
    if (code / 8u < size) bits[code / 8u] |= static_cast<std::uint8_t>(1u << code % 8u);
  }
  return bits;
}

std::vector<std::uint16_t> codes_of_type(const Capabilities& has, unsigned type) {
  std::vector<std::uint16_t> codes;
  switch (type) {
    case 0:
      codes = {EV_SYN};
      if (!has.absolute.empty()) codes.push_back(EV_ABS);
      if (!has.relative.empty()) codes.push_back(EV_REL);
      if (!has.keys.empty()) codes.push_back(EV_KEY);
      if (!has.force_feedback.empty()) codes.push_back(EV_FF);
      break;
    case EV_ABS:
      for (const AbsoluteAxis& axis : has.absolute)
        codes.push_back(axis.code);
      break;
    case EV_REL:
      return has.relative;
    case EV_KEY:
      return has.keys;
    case EV_FF:
      return has.force_feedback;
    default:
      break;
  }
  return codes;
}

Bytes absinfo_of(const Capabilities& has, unsigned code) {
  input_absinfo info{};
  for (const AbsoluteAxis& axis : has.absolute) {
    if (axis.code != code) continue;
    info = {.value = axis.value,
            .minimum = axis.minimum,
            .maximum = axis.maximum,
            .fuzz = 0,
            .flat = axis.flat,
            .resolution = axis.resolution};
  }
  return bytes_of(info);
}

/// The result of a reading ioctl of the input layer; nullopt for an unknown ioctl.
std::optional<Bytes> answer_of(EvdevModel& model, unsigned number, std::size_t size) {
  constexpr unsigned kFirstAxis = _IOC_NR(EVIOCGABS(0));
  constexpr unsigned kFirstType = _IOC_NR(EVIOCGBIT(0, 0));
  const Capabilities has = model.capabilities();
  const auto text = [&](const std::string& words) {
    Bytes bytes(words.begin(), words.end());
    bytes.push_back(0);
    bytes.resize(std::min(bytes.size(), size));
    return bytes;
  };
  if (number >= kFirstAxis && number < kFirstAxis + ABS_CNT)
    return absinfo_of(has, number - kFirstAxis);
  if (number >= kFirstType && number < kFirstType + EV_CNT) {
    return bits_of(codes_of_type(has, number - kFirstType), size);
  }
  switch (number) {
    case _IOC_NR(EVIOCGVERSION):
      return bytes_of(EV_VERSION);
    case _IOC_NR(EVIOCGID):
      return bytes_of(input_id{BUS_USB, model.unit().vendor, model.unit().product, 1});
    case _IOC_NR(EVIOCGNAME(0)):
      return text(has.name);
    case _IOC_NR(EVIOCGPHYS(0)):
      return text(model.unit().path);
    case _IOC_NR(EVIOCGUNIQ(0)):
      return text(model.unit().serial);
    case _IOC_NR(EVIOCGPROP(0)):
    case _IOC_NR(EVIOCGLED(0)):
    case _IOC_NR(EVIOCGSW(0)):
      return Bytes(size);
    case _IOC_NR(EVIOCGKEY(0)):
      return bits_of(has.pressed, size);
    case _IOC_NR(EVIOCGEFFECTS):
      return bytes_of(has.effect_count);
    default:
      return std::nullopt;
  }
}

Effect from_kernel(const ff_effect& raw) {
  Effect effect;
  effect.id = raw.id;
  effect.length = std::chrono::milliseconds{raw.replay.length};
  switch (raw.type) {
    case FF_CONSTANT:
      // 0xc000 points to the right.
      effect.level = raw.direction == 0xc000 ? raw.u.constant.level : std::int16_t{-1};
      break;
    case FF_RUMBLE:
      effect.kind = EffectKind::kRumble;
      effect.strong = raw.u.rumble.strong_magnitude;
      effect.weak = raw.u.rumble.weak_magnitude;
      break;
    default:
      effect.kind = raw.type == FF_SPRING ? EffectKind::kSpring : EffectKind::kDamper;
      effect.coefficient = raw.u.condition[0].right_coeff;
      break;
  }
  return effect;
}

int upload(EvdevModel& model, const IoctlMemory& memory) {
  ff_effect raw{};
  std::memcpy(&raw, memory.data(), sizeof raw);
  Effect effect = from_kernel(raw);
  const int error = model.upload(effect);
  raw.id = static_cast<std::int16_t>(effect.id);
  memory.put(bytes_of(raw));
  return error;
}

void complete(UMockdevIoctlClient* client, long result, int error) {
  umockdev_ioctl_client_complete(client, error == 0 ? result : -1, error);
}

gboolean on_ioctl(UMockdevIoctlBase*, UMockdevIoctlClient* client, gpointer context) {
  auto& model = *static_cast<EvdevModel*>(context);
  const unsigned long request = umockdev_ioctl_client_get_request(client);
  const auto number = static_cast<unsigned>(_IOC_NR(request));
  if (_IOC_TYPE(request) != 'E') return FALSE;
  if (!model.is_plugged_in()) {
    complete(client, 0, ENODEV);
  } else if (number == _IOC_NR(EVIOCSFF)) {
    const IoctlMemory memory(client, sizeof(ff_effect));
    complete(client, 0, upload(model, memory));
  } else if (number == _IOC_NR(EVIOCRMFF)) {
    gulong id = 0;
    std::memcpy(&id, umockdev_ioctl_client_get_arg(client)->data, sizeof id);
    complete(client, 0, model.erase(static_cast<int>(id)));
  } else if (number == _IOC_NR(EVIOCGRAB) || number == _IOC_NR(EVIOCSCLOCKID)) {
    complete(client, 0, 0);
  } else if (const auto answer = answer_of(model, number, _IOC_SIZE(request))) {
    const IoctlMemory memory(client, _IOC_SIZE(request));
    memory.put(*answer);
    // Like the kernel, returns the size of texts and bit fields, and 0 for all other requests.
    const bool has_size = number >= _IOC_NR(EVIOCGNAME(0)) && number < _IOC_NR(EVIOCGABS(0));
    complete(client, has_size ? static_cast<long>(answer->size()) : 0, 0);
  } else {
    complete(client, 0, EINVAL);
  }
  return TRUE;
}

/// Events come through the node itself; this function only reports its end.
gboolean on_read(UMockdevIoctlBase*, UMockdevIoctlClient* client, gpointer context) {
  if (static_cast<EvdevModel*>(context)->is_plugged_in()) return FALSE;
  complete(client, 0, ENODEV);
  return TRUE;
}

gboolean on_write(UMockdevIoctlBase*, UMockdevIoctlClient* client, gpointer context) {
  auto& model = *static_cast<EvdevModel*>(context);
  input_event event{};
  std::memcpy(&event, umockdev_ioctl_client_get_arg(client)->data, sizeof event);
  int error = EINVAL;
  if (event.type == EV_FF && event.code == FF_GAIN) error = model.set_gain(event.value / 65'535.0);
  if (event.type == EV_FF && event.code == FF_AUTOCENTER) error = model.disable_autocenter();
  if (event.type == EV_FF && event.code < FF_GAIN) error = model.play(event.code, event.value != 0);
  complete(client, sizeof event, error);
  return TRUE;
}

/// udev's description of the node and its device.
std::string description(const device_evdev::Unit& unit, const std::string& number) {
  const std::string input = "/devices/platform/input/input" + number;
  return "P: " + input + "\nE: SUBSYSTEM=input\nA: name=" + unit.name +
         "\\n\nA: uniq=" + unit.serial + "\\n\nA: phys=" + unit.path +
         "\\n\nA: id/vendor=046d\\n\nA: id/product=c24f\\n\n\nP: " + input + "/event" + number +
         "\nN: input/event" + number + "\nE: SUBSYSTEM=input\nE: DEVNAME=/dev/input/event" +
         number + "\nE: ID_INPUT=1\nE: ID_INPUT_JOYSTICK=1\nE: ID_SERIAL_SHORT=" + unit.serial +
         "\nE: ID_PATH=" + unit.path + "\n\n";
}

std::string number_of(const std::string& node) {
  return node.substr(std::string("/dev/input/event").size());
}

}  // namespace

struct EmulatedNode::Impl {
  explicit Impl(EvdevModel& the_model) : model(the_model) {
    g_signal_connect(handler, "handle-ioctl", G_CALLBACK(on_ioctl), &model);
    g_signal_connect(handler, "handle-read", G_CALLBACK(on_read), &model);
    g_signal_connect(handler, "handle-write", G_CALLBACK(on_write), &model);
  }

  EvdevModel& model;
  UMockdevTestbed* testbed = umockdev_testbed_new();
  UMockdevIoctlBase* handler = umockdev_ioctl_base_new();
  std::string node{};
};

EmulatedNode::EmulatedNode(EvdevModel& model) : impl_(std::make_unique<Impl>(model)) {
  plug_in();
}

EmulatedNode::~EmulatedNode() {
  umockdev_testbed_detach_ioctl(impl_->testbed, impl_->node.c_str(), nullptr);
  g_object_unref(impl_->handler);
  g_object_unref(impl_->testbed);
}

void EmulatedNode::plug_in() {
  const device_evdev::Unit unit = impl_->model.unit();
  impl_->node = unit.node;
  const bool is_added = umockdev_testbed_add_from_string(
      impl_->testbed, description(unit, number_of(unit.node)).c_str(), nullptr);
  RTPM_ASSERT(is_added, "umockdev takes the description");
  const bool is_attached =
      umockdev_testbed_attach_ioctl(impl_->testbed, unit.node.c_str(), impl_->handler, nullptr);
  RTPM_ASSERT(is_attached, "umockdev takes the handler");
}

void EmulatedNode::unplug() {
  impl_->model.unplug();
  const std::string input = "/sys/devices/platform/input/input" + number_of(impl_->node);
  umockdev_testbed_remove_device(impl_->testbed,
                                 (input + "/event" + number_of(impl_->node)).c_str());
  umockdev_testbed_remove_device(impl_->testbed, input.c_str());
}

void EmulatedNode::send(const std::vector<device_evdev::Event>& events) const {
  const int master = umockdev_testbed_get_dev_fd(impl_->testbed, impl_->node.c_str());
  const std::int64_t now_us = to_ns(rt::now()) / 1000;
  for (const device_evdev::Event& event : events) {
    input_event raw{};
    raw.input_event_sec = now_us / 1'000'000;
    raw.input_event_usec = now_us % 1'000'000;
    raw.type = event.type;
    raw.code = event.code;
    raw.value = event.value;
    RTPM_ASSERT(::write(master, &raw, sizeof raw) == sizeof raw, "the node has capacity");
  }
}

void EmulatedNode::send_bytes(std::size_t count) const {
  const int master = umockdev_testbed_get_dev_fd(impl_->testbed, impl_->node.c_str());
  const Bytes bytes(count);
  RTPM_ASSERT(::write(master, bytes.data(), count) == static_cast<ssize_t>(count),
              "the node has capacity");
}

}  // namespace rtpm::test
