#include "uinput_device.hpp"

#include <fcntl.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <filesystem>

#include "rtpm/base/assert.hpp"

namespace rtpm::test {
namespace {

constexpr const char* kFile = "/dev/uinput";

void set_bits(int file, unsigned long request, unsigned long type,
              const std::vector<std::uint16_t>& codes) {
  if (codes.empty()) return;
  RTPM_ASSERT(::ioctl(file, UI_SET_EVBIT, type) == 0, "the kernel knows the type");
  for (const std::uint16_t code : codes)
    RTPM_ASSERT(::ioctl(file, request, code) == 0, "the kernel knows the code");
}

int level_of(const ff_effect& effect) {
  switch (effect.type) {
    case FF_CONSTANT:
      return effect.u.constant.level;
    case FF_RUMBLE:
      return effect.u.rumble.strong_magnitude;
    default:
      return effect.u.condition[0].right_coeff;
  }
}

}  // namespace

std::string UinputDevice::obstacle() {
  const int file = ::open(kFile, O_RDWR | O_CLOEXEC);
  if (file < 0) return std::string(kFile) + ": " + std::strerror(errno);
  ::close(file);
  return {};
}

UinputDevice::UinputDevice(const Description& description)
    : file_(::open(kFile, O_RDWR | O_NONBLOCK | O_CLOEXEC)) {
  RTPM_ASSERT(file_ >= 0, "obstacle() was asked before");
  set_bits(file_, UI_SET_KEYBIT, EV_KEY, description.keys);
  set_bits(file_, UI_SET_FFBIT, EV_FF, description.effects);
  for (const Axis& axis : description.axes) {
    set_bits(file_, UI_SET_ABSBIT, EV_ABS, {axis.code});
    uinput_abs_setup setup{};
    setup.code = axis.code;
    setup.absinfo.minimum = axis.minimum;
    setup.absinfo.maximum = axis.maximum;
    RTPM_ASSERT(::ioctl(file_, UI_ABS_SETUP, &setup) == 0, "the kernel takes the range");
  }
  // The driver finds the device again by its port.
  RTPM_ASSERT(::ioctl(file_, UI_SET_PHYS, "rtpm/test") == 0, "the kernel takes the port");
  uinput_setup setup{};
  setup.id = {.bustype = BUS_USB, .vendor = 0x1209, .product = 0x0001, .version = 1};
  description.name.copy(setup.name, sizeof setup.name - 1);
  setup.ff_effects_max = description.effects.empty() ? 0 : 16;
  RTPM_ASSERT(::ioctl(file_, UI_DEV_SETUP, &setup) == 0, "the kernel takes the description");
  RTPM_ASSERT(::ioctl(file_, UI_DEV_CREATE) == 0, "the kernel makes the device");
  thread_ = std::thread([this] { serve(); });
  find_node();
}

UinputDevice::~UinputDevice() {
  ::ioctl(file_, UI_DEV_DESTROY);
  is_ending_.store(true);
  thread_.join();
  ::close(file_);
}

void UinputDevice::find_node() {
  std::array<char, 64> name{};
  if (::ioctl(file_, UI_GET_SYSNAME(name.size()), name.data()) < 0) return;
  const std::string folder = std::string("/sys/devices/virtual/input/") + name.data();
  for (int i = 0; i < 200 && node_.empty(); ++i) {
    std::error_code error;
    for (const auto& entry : std::filesystem::directory_iterator(folder, error)) {
      const std::string node = "/dev/input/" + entry.path().filename().string();
      if (entry.path().filename().string().starts_with("event") && std::filesystem::exists(node)) {
        node_ = node;
      }
    }
    if (node_.empty()) std::this_thread::sleep_for(std::chrono::milliseconds{10});
  }
}

void UinputDevice::send(std::uint16_t type, std::uint16_t code, std::int32_t value) const {
  input_event event{};
  event.type = type;
  event.code = code;
  event.value = value;
  RTPM_ASSERT(::write(file_, &event, sizeof event) == sizeof event, "the kernel takes the event");
}

int UinputDevice::level(std::uint16_t type) const {
  const std::scoped_lock lock(mutex_);
  for (const auto& [id, effect] : effects_) {
    const auto playing = is_playing_.find(id);
    if (effect.type == type && playing != is_playing_.end() && playing->second) {
      return level_of(effect);
    }
  }
  return 0;
}

std::size_t UinputDevice::effect_count() const {
  const std::scoped_lock lock(mutex_);
  return effects_.size();
}

void UinputDevice::serve() {
  while (!is_ending_.load()) {
    pollfd waiting{.fd = file_, .events = POLLIN, .revents = 0};
    if (::poll(&waiting, 1, 20) <= 0) continue;
    input_event event{};
    if (::read(file_, &event, sizeof event) == sizeof event) {
      take(event);
    } else {
      std::this_thread::sleep_for(std::chrono::milliseconds{1});
    }
  }
}

void UinputDevice::take(const input_event& event) {
  const auto request = static_cast<std::uint32_t>(event.value);
  if (event.type == EV_UINPUT && event.code == UI_FF_UPLOAD) return upload(request);
  if (event.type == EV_UINPUT && event.code == UI_FF_ERASE) return erase(request);
  if (event.type != EV_FF) return;
  if (event.code == FF_GAIN) {
    gain_.store(event.value);
  } else if (event.code < FF_GAIN) {
    const std::scoped_lock lock(mutex_);
    is_playing_[event.code] = event.value != 0;
  }
}

void UinputDevice::upload(std::uint32_t request) {
  uinput_ff_upload upload{};
  upload.request_id = request;
  if (::ioctl(file_, UI_BEGIN_FF_UPLOAD, &upload) != 0) return;
  {
    const std::scoped_lock lock(mutex_);
    effects_[upload.effect.id] = upload.effect;
  }
  upload.retval = 0;
  ::ioctl(file_, UI_END_FF_UPLOAD, &upload);
}

void UinputDevice::erase(std::uint32_t request) {
  uinput_ff_erase erase{};
  erase.request_id = request;
  if (::ioctl(file_, UI_BEGIN_FF_ERASE, &erase) != 0) return;
  {
    const std::scoped_lock lock(mutex_);
    effects_.erase(static_cast<int>(erase.effect_id));
    is_playing_.erase(static_cast<int>(erase.effect_id));
  }
  erase.retval = 0;
  ::ioctl(file_, UI_END_FF_ERASE, &erase);
}

}  // namespace rtpm::test
