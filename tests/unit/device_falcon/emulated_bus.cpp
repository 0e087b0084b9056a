#include "emulated_bus.hpp"

#include <linux/usbdevice_fs.h>
#include <sys/ioctl.h>
#include <umockdev.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <deque>
#include <fstream>
#include <iterator>
#include <mutex>

#include "rtpm/base/assert.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::test {
namespace {

constexpr std::size_t kSetupSize = 8;

/// The bytes of a request block. Here the kernel's side shares the program's memory.
std::span<std::byte> bytes_of(const usbdevfs_urb& urb) {
  return {static_cast<std::byte*>(urb.buffer), static_cast<std::size_t>(urb.buffer_length)};
}

int status_of(UsbReply reply) {
  switch (reply) {
    case UsbReply::kOk:
      return 0;
    case UsbReply::kStall:
      return -EPIPE;
    case UsbReply::kOverflow:
      return -EOVERFLOW;
    default:
      return -ENODEV;
  }
}

std::uint16_t number_at(std::span<const std::byte> bytes, std::size_t index) {
  return static_cast<std::uint16_t>(std::to_integer<int>(bytes[index]) |
                                    std::to_integer<int>(bytes[index + 1]) << 8);
}

std::string hex_of(std::span<const std::byte> bytes) {
  std::string text;
  for (const std::byte byte : bytes) {
    std::array<char, 3> digits{};
    std::snprintf(digits.data(), digits.size(), "%02x", std::to_integer<unsigned>(byte));
    text += digits.data();
  }
  return text;
}

/// One unit's node of usbfs: takes request blocks and lets the model answer them.
class Node {
 public:
  Node(std::shared_ptr<FalconModel> model, std::mutex& mutex)
      : model_(std::move(model)), mutex_(mutex), handler_(umockdev_ioctl_base_new()) {
    g_signal_connect(handler_, "handle-ioctl", G_CALLBACK(&Node::on_ioctl), this);
  }
  Node(const Node&) = delete;
  Node& operator=(const Node&) = delete;
  ~Node() {
    g_signal_handlers_disconnect_by_data(handler_, this);
    g_object_unref(handler_);
  }
  [[nodiscard]] UMockdevIoctlBase* handler() const noexcept { return handler_; }
  [[nodiscard]] const std::shared_ptr<FalconModel>& model() const noexcept { return model_; }

 private:
  struct Result {
    long value = 0;
    int error = 0;
  };

  static gboolean on_ioctl(UMockdevIoctlBase*, UMockdevIoctlClient* client, gpointer self) {
    Node& node = *static_cast<Node*>(self);
    const std::scoped_lock lock(node.mutex_);
    node.let_time_pass();
    const UMockdevIoctlData* const argument = umockdev_ioctl_client_get_arg(client);
    void* const pointer = *reinterpret_cast<void**>(argument->data);
    const Result result = node.answer(umockdev_ioctl_client_get_request(client), pointer);
    umockdev_ioctl_client_complete(client, result.value, result.error);
    return TRUE;
  }

  void let_time_pass() {
    const MonotonicTime now = rt::now();
    model_->advance(std::min<Duration>(now - seen_at_, std::chrono::milliseconds{100}));
    seen_at_ = now;
  }

  Result answer(unsigned long request, void* pointer) {
    constexpr Result kFailed{-1, ENODEV};
    switch (request) {
      case USBDEVFS_GET_CAPABILITIES:
        *static_cast<std::uint32_t*>(pointer) = USBDEVFS_CAP_REAP_AFTER_DISCONNECT;
        return {};
      case USBDEVFS_CLAIMINTERFACE:
      case USBDEVFS_RELEASEINTERFACE:
      case USBDEVFS_DISCONNECT_CLAIM:
        return model_->is_plugged_in() ? Result{} : kFailed;
      case USBDEVFS_CLEAR_HALT:
        return model_->is_plugged_in() ? Result{} : kFailed;
      case USBDEVFS_SUBMITURB:
        return submit(*static_cast<usbdevfs_urb*>(pointer));
      case USBDEVFS_REAPURB:
      case USBDEVFS_REAPURBNDELAY:
        return reap(*static_cast<usbdevfs_urb**>(pointer));
      case USBDEVFS_DISCARDURB:
        return discard(static_cast<usbdevfs_urb*>(pointer));
      default:
        return {-1, ENODATA};
    }
  }

  Result submit(usbdevfs_urb& urb) {
    if (!model_->is_plugged_in()) return {-1, ENODEV};
    urb.actual_length = 0;
    if (urb.type == USBDEVFS_URB_TYPE_CONTROL) {
      submit_control(urb);
    } else if ((urb.endpoint & 0x80) != 0) {
      waiting_.push_back(&urb);
    } else {
      finish(urb, model_->write(bytes_of(urb)).reply, bytes_of(urb).size());
    }
    return {};
  }

  void submit_control(usbdevfs_urb& urb) {
    const std::span<std::byte> bytes = bytes_of(urb);
    const UsbSetup setup{.type = std::to_integer<std::uint8_t>(bytes[0]),
                         .request = std::to_integer<std::uint8_t>(bytes[1]),
                         .value = number_at(bytes, 2),
                         .index = number_at(bytes, 4),
                         .length = number_at(bytes, 6)};
    const UsbAnswer answer = model_->control(setup, bytes.subspan(kSetupSize));
    if (answer.reply == UsbReply::kNothingYet) {
      unanswered_.push_back(&urb);
    } else {
      finish(urb, answer.reply, answer.size);
    }
  }

  void finish(usbdevfs_urb& urb, UsbReply reply, std::size_t size) {
    urb.status = status_of(reply);
    urb.actual_length = reply == UsbReply::kOk ? static_cast<int>(size) : 0;
    done_.push_back(&urb);
  }

  Result reap(usbdevfs_urb*& urb) {
    if (done_.empty() && !waiting_.empty() && model_->is_plugged_in()) {
      const UsbAnswer answer = model_->read(bytes_of(*waiting_.front()));
      if (answer.reply != UsbReply::kNothingYet) {
        usbdevfs_urb& first = *waiting_.front();
        waiting_.pop_front();
        finish(first, answer.reply, answer.size);
      }
    }
    if (done_.empty()) return {-1, model_->is_plugged_in() ? EAGAIN : ENODEV};
    urb = done_.front();
    done_.pop_front();
    return {};
  }

  Result discard(usbdevfs_urb* urb) {
    if (std::erase(waiting_, urb) + std::erase(unanswered_, urb) == 0) return {-1, EINVAL};
    urb->status = -ENOENT;
    done_.push_back(urb);
    return {};
  }

  std::shared_ptr<FalconModel> model_;
  std::mutex& mutex_;
  UMockdevIoctlBase* handler_;
  MonotonicTime seen_at_ = rt::now();
  std::deque<usbdevfs_urb*> waiting_{};
  std::deque<usbdevfs_urb*> unanswered_{};
  std::deque<usbdevfs_urb*> done_{};
};

std::string node_name(int address) {
  std::array<char, 32> name{};
  std::snprintf(name.data(), name.size(), "bus/usb/001/%03d", address);
  return name.data();
}

/// A device in umockdev's text format, with the properties that udev would set.
std::string description(const std::string& path, int address, const std::string& descriptors,
                        const std::string& attributes) {
  const std::string node = node_name(address);
  const std::string number = std::to_string(address);
  return "P: " + path + "\nN: " + node + "\nE: SUBSYSTEM=usb\nE: DRIVER=usb\nE: BUSNUM=001\n" +
         "E: DEVNUM=" + number + "\nE: DEVNAME=/dev/" + node + "\nE: DEVTYPE=usb_device\n" +
         "A: bConfigurationValue=1\\n\nA: busnum=1\\n\nA: devnum=" + number + "\\n\n" + attributes +
         "H: descriptors=" + descriptors + "\n";
}

}  // namespace

struct EmulatedBus::Parts {
  struct Plugged {
    std::string path;
    std::string node;
    std::unique_ptr<Node> usbfs;
  };
  std::mutex mutex;
  UMockdevTestbed* testbed = umockdev_testbed_new();
  std::vector<Plugged> plugged;

  ~Parts() {
    for (const Plugged& unit : plugged)
      umockdev_testbed_detach_ioctl(testbed, unit.node.c_str(), nullptr);
    plugged.clear();
    g_object_unref(testbed);
  }
  void add(const std::string& text) {
    RTPM_ASSERT(umockdev_testbed_add_from_string(testbed, text.c_str(), nullptr) != 0,
                "umockdev takes the description");
  }
};

EmulatedBus::Lock::Lock(EmulatedBus& bus) : bus_(bus) {
  bus_.parts_->mutex.lock();
}
EmulatedBus::Lock::~Lock() {
  bus_.parts_->mutex.unlock();
}

EmulatedBus::EmulatedBus() : parts_(std::make_unique<Parts>()) {
  // libusb needs the root hub to know the ports below it.
  parts_->add(description(
      "/devices/usb1", 1,
      "12010002090001406b1d020006050302010109021900010100e0000904000001090000000705810304000c",
      "A: speed=480\\n\n"));
}

EmulatedBus::~EmulatedBus() = default;

void EmulatedBus::plug_in(const std::shared_ptr<FalconModel>& model, int port, int address) {
  with_model(model, [](FalconModel& unit) { unit.plug_in(); });
  const std::string path = "/devices/usb1/1-" + std::to_string(port);
  const std::string node = "/dev/" + node_name(address);
  auto usbfs = std::make_unique<Node>(model, parts_->mutex);
  RTPM_ASSERT(
      umockdev_testbed_attach_ioctl(parts_->testbed, node.c_str(), usbfs->handler(), nullptr) != 0,
      "umockdev takes the handler");
  parts_->add(description(
      path, address,
      hex_of(FalconModel::device_descriptor()) + hex_of(FalconModel::configuration_descriptor()),
      "A: speed=12\\n\nA: serial=" + model->serial() + "\\n\n"));
  parts_->plugged.push_back({"/sys" + path, node, std::move(usbfs)});
}

void EmulatedBus::unplug(const std::shared_ptr<FalconModel>& model) {
  with_model(model, [](FalconModel& unit) { unit.unplug(); });
  const auto found = std::ranges::find_if(
      parts_->plugged, [&](const Parts::Plugged& unit) { return unit.usbfs->model() == model; });
  RTPM_ASSERT(found != parts_->plugged.end(), "the unit is plugged in");
  umockdev_testbed_uevent(parts_->testbed, found->path.c_str(), "remove");
  umockdev_testbed_remove_device(parts_->testbed, found->path.c_str());
}

}  // namespace rtpm::test
