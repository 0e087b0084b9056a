#include <libserialport.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <ctime>
#include <filesystem>
#include <limits>
#include <system_error>
#include <utility>

#include "rtpm/device_io/found_device.hpp"
#include "rtpm/device_serial/ports.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::device_serial {
namespace {

struct FreePort {
  void operator()(sp_port* port) const noexcept {
    sp_close(port);
    sp_free_port(port);
  }
};
using PortHandle = std::unique_ptr<sp_port, FreePort>;

class SerialPort final : public Transport {
 public:
  /// @param fd  the descriptor of the port, owned by the port
  SerialPort(PortHandle port, int fd, int wake_fd)
      : port_(std::move(port)), fd_(fd), wake_fd_(wake_fd) {
    // Two programs would steal each other's frames.
    static_cast<void>(::ioctl(fd_, TIOCEXCL));
  }
  ~SerialPort() override {
    // A terminal that exists after it is closed, such as a pseudo terminal, would stay exclusive.
    static_cast<void>(::ioctl(fd_, TIOCNXCL));
    ::close(wake_fd_);
  }

  [[nodiscard]] Transferred send(ConstBytes bytes) override {
    const int sent = sp_nonblocking_write(port_.get(), bytes.data(), bytes.size());
    return sent < 0 ? Transferred{0, true} : Transferred{static_cast<std::size_t>(sent), false};
  }

  [[nodiscard]] Transferred receive(MutableBytes buffer, Duration patience) override {
    std::array<pollfd, 2> files{pollfd{fd_, POLLIN, 0}, pollfd{wake_fd_, POLLIN, 0}};
    const auto whole = std::chrono::duration_cast<std::chrono::seconds>(patience);
    const timespec limit{whole.count(), (patience - whole).count()};
    if (::ppoll(files.data(), files.size(), &limit, nullptr) <= 0) return {};
    if (files[1].revents != 0) {
      std::uint64_t count = 0;
      static_cast<void>(::read(wake_fd_, &count, sizeof count));
    }
    if (files[0].revents == 0) return {};
    const int received = sp_nonblocking_read(port_.get(), buffer.data(), buffer.size());
    if (received > 0) return {static_cast<std::size_t>(received), false};
    // A port that is gone is readable but has no bytes.
    return {0, received < 0 || (files[0].revents & (POLLHUP | POLLERR | POLLNVAL)) != 0};
  }

  void wake() noexcept override {
    const std::uint64_t one = 1;
    static_cast<void>(::write(wake_fd_, &one, sizeof one));
  }

  [[nodiscard]] MonotonicTime now() const override { return rt::now(); }

 private:
  PortHandle port_;
  int fd_;
  int wake_fd_;
};

/// libserialport knows the nodes only by their own names, not by links.
expected<PortHandle, SetupError> find_port(const std::string& node) {
  sp_port* port = nullptr;
  if (sp_get_port_by_name(node.c_str(), &port) == SP_OK) return PortHandle(port);
  std::error_code error;
  const std::filesystem::path target = std::filesystem::canonical(node, error);
  if (error) return setup_error(node + " is not plugged in", error, "plug the board in");
  if (sp_get_port_by_name(target.c_str(), &port) == SP_OK) return PortHandle(port);
  return setup_error(node + " is no serial port", "", "name one as /dev/ttyACM0 or /dev/ttyUSB0");
}

SetupError refusal(const Port& port, int number) {
  std::string remedy;
  if (number == EACCES || number == EPERM) {
    remedy = "add the user to the group dialout";
    if (port.is_usb) {
      const std::string rule = device_io::udev_rule("tty", port.usb_vendor, port.usb_product);
      remedy += ", or " + device_io::rule_remedy(rule);
    }
  } else if (number == EBUSY) {
    remedy = "close the other program that uses it, such as a serial monitor";
  }
  return setup_error(port.node + " can't be opened", system_error(number), remedy).error;
}

/// All calls except the one for the speed set a property that every port has.
expected<void, SetupError> set_line(const Port& port, sp_port* handle, std::int64_t speed_baud) {
  if (speed_baud < 1 || speed_baud > std::numeric_limits<int>::max() ||
      sp_set_baudrate(handle, static_cast<int>(speed_baud)) != SP_OK) {
    return setup_error(port.node + " has no speed of " + std::to_string(speed_baud) + " baud", "",
                       "give another 'speed=', as in the board's firmware");
  }
  if (sp_set_bits(handle, 8) != SP_OK || sp_set_parity(handle, SP_PARITY_NONE) != SP_OK ||
      sp_set_stopbits(handle, 1) != SP_OK ||
      sp_set_flowcontrol(handle, SP_FLOWCONTROL_NONE) != SP_OK) {
    return setup_error(port.node + " can't be set up", system_error(sp_last_error_code()));
  }
  // USB boards such as the Leonardo send only while DTR is set. Some lines have no DTR.
  static_cast<void>(sp_set_dtr(handle, SP_DTR_ON));
  static_cast<void>(sp_flush(handle, SP_BUF_BOTH));
  return {};
}

expected<std::unique_ptr<Transport>, SetupError> open_port(const Port& port,
                                                           std::int64_t speed_baud) {
  auto handle = find_port(port.node);
  if (!handle) return unexpected{handle.error()};
  if (sp_open(handle->get(), SP_MODE_READ_WRITE) != SP_OK)
    return unexpected{refusal(port, sp_last_error_code())};
  if (auto set = set_line(port, handle->get(), speed_baud); !set) return unexpected{set.error()};
  int fd = -1;
  if (sp_get_port_handle(handle->get(), &fd) != SP_OK || fd < 0)
    return setup_error(port.node + " has no file descriptor");
  const int wake_fd = ::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
  if (wake_fd < 0) return setup_error(port.node + " gets no eventfd", system_error(errno));
  return std::make_unique<SerialPort>(std::move(*handle), fd, wake_fd);
}

}  // namespace

OpenTransport open_serial_port(ListPorts list) {
  return [list = std::move(list)](
             const PortSettings& settings) -> expected<std::unique_ptr<Transport>, SetupError> {
    const auto port = choose_port(settings, list());
    if (!port) return unexpected{port.error()};
    return open_port(*port, settings.speed_baud);
  };
}

}  // namespace rtpm::device_serial
