#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <list>
#include <mutex>
#include <span>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"

namespace rtpm::device_bridges {

/// The setup packet of a control transfer, in this machine's byte order.
/// @source   USB 2.0 specification, table 9-2
struct UsbSetup {
  std::uint8_t request_type = 0;
  std::uint8_t request = 0;
  std::uint16_t value = 0;
  std::uint16_t index = 0;
  std::uint16_t length = 0;
};

enum class UsbStatus : std::uint8_t {
  kDone,
  kNotReady,  ///< Asked again within a millisecond, like a device that answers NAK.
  kStall,
};

/// A USB device's answer to a transfer; `data` for transfers to the host.
struct UsbAnswer {
  UsbStatus status = UsbStatus::kDone;
  std::vector<std::byte> data{};
};

/// A device's speed, with the kernel's numbers.
enum class UsbSpeed : std::uint8_t { kLow = 1, kFull = 2, kHigh = 3 };

/// The behaviour of a USB device. All functions are called from the bridge's thread, one at a time;
/// a missing function stalls. The bridge itself answers the standard requests.
struct UsbModel {
  UsbSpeed speed = UsbSpeed::kFull;
  std::array<std::byte, 18> device_descriptor{};
  /// The configuration descriptor, with its interfaces and endpoints.
  std::vector<std::byte> configuration_descriptor{};
  /// The string descriptors, from index 1 on.
  std::vector<std::string> strings{};
  /// Class and vendor requests; `data` comes with the request.
  std::function<UsbAnswer(const UsbSetup& setup, std::span<const std::byte> data)> on_control{};
  /// A bulk or interrupt transfer to the device.
  std::function<UsbAnswer(std::uint8_t endpoint, std::span<const std::byte> data)> on_out{};
  /// A transfer from the device. More than `capacity` bytes are an overflow.
  std::function<UsbAnswer(std::uint8_t endpoint, std::size_t capacity, MonotonicTime now)> on_in{};
};

/// Puts a model behind the kernel's USB stack: it is a USB/IP server at the other end of a socket
/// that vhci_hcd holds, so that libusb and kernel drivers see it as hardware. No network is used.
/// @threads  one; the model's functions run on the bridge's own thread
/// @source   the kernel's Documentation/usb/usbip_protocol.rst
class UsbipBridge {
 public:
  explicit UsbipBridge(UsbModel model) : model_(std::move(model)) {}
  UsbipBridge(const UsbipBridge&) = delete;
  UsbipBridge& operator=(const UsbipBridge&) = delete;
  /// Unplugs.
  ~UsbipBridge() { unplug(); }

  /// Plugs the device into a free port. The kernel goes on to set it up after this returns.
  /// @errors   no vhci_hcd, no right to it, or no port is free
  [[nodiscard]] expected<void, SetupError> plug();
  /// Unplugs the device, in use or not. The model keeps its state. No effect if not plugged in.
  void unplug() noexcept;

  /// Calls `function` while no function of the model runs.
  template <class Function>
  auto with_model(Function function) {
    const std::lock_guard lock(mutex_);
    return function();
  }

 private:
  /// A transfer that the host has submitted.
  struct Transfer {
    std::uint32_t sequence = 0;
    std::uint8_t endpoint = 0;
    bool is_to_host = false;
    std::uint32_t size = 0;
    UsbSetup setup{};
    std::vector<std::byte> data{};
  };
  void serve();
  [[nodiscard]] bool take_command();
  void take_submit(std::span<const std::byte, 48> header, std::vector<std::byte> data);
  void take_unlink(std::span<const std::byte, 48> header);
  /// Asks the model for each pending transfer, the oldest of each endpoint first.
  void try_pending();
  [[nodiscard]] UsbAnswer answer_to(const Transfer& transfer);
  [[nodiscard]] UsbAnswer answer_to_control(const Transfer& transfer);
  [[nodiscard]] UsbAnswer answer_to_standard(const UsbSetup& setup) const;
  [[nodiscard]] UsbAnswer descriptor(const UsbSetup& setup) const;
  void reply(const Transfer& transfer, const UsbAnswer& answer);

  UsbModel model_;
  std::mutex mutex_{};
  std::atomic<bool> is_stopping_{false};
  int socket_ = -1;
  std::list<Transfer> pending_{};
  std::thread thread_{};
};

}  // namespace rtpm::device_bridges
