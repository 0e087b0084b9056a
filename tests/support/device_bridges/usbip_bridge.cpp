#include "usbip_bridge.hpp"

#include <fcntl.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <fstream>
#include <optional>
#include <sstream>

#include "rtpm/rt/clock.hpp"

namespace rtpm::device_bridges {
namespace {

constexpr std::size_t kHeaderSize = 48;
constexpr std::uint32_t kSubmit = 1;
constexpr std::uint32_t kUnlink = 2;
constexpr std::uint32_t kSubmitReply = 3;
constexpr std::uint32_t kUnlinkReply = 4;
/// The offsets of a header's fields, each of 32 bits, big-endian.
constexpr std::size_t kCommandAt = 0;
constexpr std::size_t kSequenceAt = 4;
constexpr std::size_t kDirectionAt = 12;
constexpr std::size_t kEndpointAt = 16;
constexpr std::size_t kUnlinkSequenceAt = 20;
constexpr std::size_t kStatusAt = 20;
constexpr std::size_t kSizeAt = 24;
constexpr std::size_t kSetupAt = 40;
/// More than any transfer of these tests: a header with a larger size is damaged.
constexpr std::uint32_t kTransferMax = 1U << 20U;

constexpr std::uint8_t kGetStatus = 0;
constexpr std::uint8_t kGetDescriptor = 6;
constexpr std::uint8_t kGetConfiguration = 8;
constexpr std::uint8_t kGetInterface = 10;
constexpr std::uint8_t kDeviceDescriptor = 1;
constexpr std::uint8_t kConfigurationDescriptor = 2;
constexpr std::uint8_t kStringDescriptor = 3;
constexpr std::uint8_t kRequestKindMask = 0x60;

using Header = std::array<std::byte, kHeaderSize>;

std::uint32_t read_u32(std::span<const std::byte> bytes, std::size_t at) {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < 4; ++i)
    value = value << 8U | std::to_integer<std::uint32_t>(bytes[at + i]);
  return value;
}

void write_u32(Header& header, std::size_t at, std::uint32_t value) {
  for (std::size_t i = 0; i < 4; ++i)
    header[at + i] = static_cast<std::byte>(value >> (24U - 8U * static_cast<unsigned>(i)));
}

/// Reads from a setup packet, which is little-endian.
std::uint16_t read_u16(std::span<const std::byte> bytes, std::size_t at) {
  return static_cast<std::uint16_t>(std::to_integer<unsigned>(bytes[at]) |
                                    std::to_integer<unsigned>(bytes[at + 1]) << 8U);
}

bool read_all(int socket, std::span<std::byte> into) {
  while (!into.empty()) {
    const ssize_t count = ::recv(socket, into.data(), into.size(), MSG_WAITALL);
    if (count <= 0) return false;
    into = into.subspan(static_cast<std::size_t>(count));
  }
  return true;
}

void write_all(int socket, std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    const ssize_t count = ::send(socket, bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (count <= 0) return;
    bytes = bytes.subspan(static_cast<std::size_t>(count));
  }
}

/// The lowest port of the USB 2 hub that has no device, from vhci_hcd's table of ports.
std::optional<int> free_port(const std::string& folder) {
  constexpr int kFree = 4;
  std::ifstream table(folder + "/status");
  std::string line;
  std::getline(table, line);
  while (std::getline(table, line)) {
    std::istringstream words(line);
    std::string hub;
    int port = 0;
    int state = 0;
    if (words >> hub >> port >> state && hub == "hs" && state == kFree) return port;
  }
  return std::nullopt;
}

}  // namespace

expected<void, SetupError> UsbipBridge::plug() {
  unplug();
  const std::string folder = "/sys/devices/platform/vhci_hcd.0";
  const std::string what = "a USB device cannot be plugged into vhci_hcd";
  const auto port = free_port(folder);
  if (!port) {
    return setup_error(what, folder + " has no free port", "load the kernel module vhci-hcd");
  }
  std::array<int, 2> ends{};
  if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data()) != 0) {
    return setup_error(what, system_error(errno));
  }
  // "port socket device speed": the device number is only passed back in each command.
  const std::string text = std::to_string(*port) + " " + std::to_string(ends[1]) + " 1 " +
                           std::to_string(static_cast<int>(model_.speed));
  const int attach = ::open((folder + "/attach").c_str(), O_WRONLY | O_CLOEXEC);
  const bool is_attached =
      attach >= 0 && ::write(attach, text.data(), text.size()) == static_cast<ssize_t>(text.size());
  const int error = errno;
  if (attach >= 0) ::close(attach);
  // The kernel holds its own reference to its end.
  ::close(ends[1]);
  if (!is_attached) {
    ::close(ends[0]);
    return setup_error(what, system_error(error), "run as root");
  }
  socket_ = ends[0];
  is_stopping_ = false;
  thread_ = std::thread([this] { serve(); });
  return {};
}

void UsbipBridge::unplug() noexcept {
  if (socket_ < 0) return;
  is_stopping_ = true;
  ::shutdown(socket_, SHUT_RDWR);
  thread_.join();
  ::close(std::exchange(socket_, -1));
  pending_.clear();
}

void UsbipBridge::serve() {
  constexpr int kPollPeriodMs = 1;
  while (!is_stopping_) {
    pollfd entry{.fd = socket_, .events = POLLIN, .revents = 0};
    if (::poll(&entry, 1, pending_.empty() ? -1 : kPollPeriodMs) > 0 && !take_command()) return;
    try_pending();
  }
}

bool UsbipBridge::take_command() {
  Header header{};
  if (!read_all(socket_, header)) return false;
  if (read_u32(header, kCommandAt) == kUnlink) {
    take_unlink(header);
    return true;
  }
  const std::uint32_t size = read_u32(header, kSizeAt);
  if (read_u32(header, kCommandAt) != kSubmit || size > kTransferMax) return false;
  std::vector<std::byte> data;
  if (read_u32(header, kDirectionAt) == 0) {
    data.resize(size);
    if (!read_all(socket_, data)) return false;
  }
  take_submit(header, std::move(data));
  return true;
}

void UsbipBridge::take_submit(std::span<const std::byte, 48> header, std::vector<std::byte> data) {
  pending_.push_back({.sequence = read_u32(header, kSequenceAt),
                      .endpoint = static_cast<std::uint8_t>(read_u32(header, kEndpointAt)),
                      .is_to_host = read_u32(header, kDirectionAt) != 0,
                      .size = read_u32(header, kSizeAt),
                      .setup = {.request_type = std::to_integer<std::uint8_t>(header[kSetupAt]),
                                .request = std::to_integer<std::uint8_t>(header[kSetupAt + 1]),
                                .value = read_u16(header, kSetupAt + 2),
                                .index = read_u16(header, kSetupAt + 4),
                                .length = read_u16(header, kSetupAt + 6)},
                      .data = std::move(data)});
}

void UsbipBridge::take_unlink(std::span<const std::byte, 48> header) {
  const std::uint32_t sequence = read_u32(header, kUnlinkSequenceAt);
  const auto removed =
      pending_.remove_if([&](const Transfer& transfer) { return transfer.sequence == sequence; });
  Header reply{};
  write_u32(reply, kCommandAt, kUnlinkReply);
  write_u32(reply, kSequenceAt, read_u32(header, kSequenceAt));
  // 0 means that it was answered before.
  write_u32(reply, kStatusAt, static_cast<std::uint32_t>(removed > 0 ? -ECONNRESET : 0));
  write_all(socket_, reply);
}

void UsbipBridge::try_pending() {
  std::vector<std::pair<std::uint8_t, bool>> waiting;
  for (auto transfer = pending_.begin(); transfer != pending_.end();) {
    const std::pair<std::uint8_t, bool> pipe{transfer->endpoint, transfer->is_to_host};
    const bool is_behind = std::find(waiting.begin(), waiting.end(), pipe) != waiting.end();
    const UsbAnswer answer = is_behind ? UsbAnswer{UsbStatus::kNotReady}
                                       : with_model([&] { return answer_to(*transfer); });
    if (answer.status == UsbStatus::kNotReady) {
      waiting.push_back(pipe);
      ++transfer;
      continue;
    }
    reply(*transfer, answer);
    transfer = pending_.erase(transfer);
  }
}

UsbAnswer UsbipBridge::answer_to(const Transfer& transfer) {
  if (transfer.endpoint == 0) return answer_to_control(transfer);
  if (transfer.is_to_host) {
    if (!model_.on_in) return {UsbStatus::kStall};
    return model_.on_in(transfer.endpoint, transfer.size, rt::now());
  }
  if (!model_.on_out) return {UsbStatus::kStall};
  return model_.on_out(transfer.endpoint, transfer.data);
}

UsbAnswer UsbipBridge::answer_to_control(const Transfer& transfer) {
  UsbAnswer answer{UsbStatus::kStall};
  if ((transfer.setup.request_type & kRequestKindMask) == 0) {
    answer = answer_to_standard(transfer.setup);
  } else if (model_.on_control) {
    answer = model_.on_control(transfer.setup, transfer.data);
  }
  if (answer.data.size() > transfer.setup.length) answer.data.resize(transfer.setup.length);
  return answer;
}

UsbAnswer UsbipBridge::answer_to_standard(const UsbSetup& setup) const {
  switch (setup.request) {
    case kGetDescriptor:
      return descriptor(setup);
    case kGetStatus:
      return {.data = {std::byte{0}, std::byte{0}}};
    case kGetConfiguration:
      return {.data = {std::byte{1}}};
    case kGetInterface:
      return {.data = {std::byte{0}}};
    default:
      // SET_CONFIGURATION, SET_INTERFACE, CLEAR_FEATURE: nothing to do for one configuration.
      return {};
  }
}

UsbAnswer UsbipBridge::descriptor(const UsbSetup& setup) const {
  const auto kind = static_cast<std::uint8_t>(setup.value >> 8U);
  const std::size_t index = setup.value & 0xFFU;
  if (kind == kDeviceDescriptor) {
    return {.data = {model_.device_descriptor.begin(), model_.device_descriptor.end()}};
  }
  if (kind == kConfigurationDescriptor && index == 0) {
    return {.data = model_.configuration_descriptor};
  }
  if (kind != kStringDescriptor || index > model_.strings.size()) return {UsbStatus::kStall};
  std::vector<std::byte> text{std::byte{0}, std::byte{kStringDescriptor}};
  if (index == 0) {
    // The only language: English (United States).
    text.insert(text.end(), {std::byte{0x09}, std::byte{0x04}});
  } else {
    for (const char letter : model_.strings[index - 1])
      text.insert(text.end(), {static_cast<std::byte>(letter), std::byte{0}});
  }
  text[0] = static_cast<std::byte>(text.size());
  return {.data = std::move(text)};
}

void UsbipBridge::reply(const Transfer& transfer, const UsbAnswer& answer) {
  int status = answer.status == UsbStatus::kStall ? -EPIPE : 0;
  std::span<const std::byte> data(answer.data);
  if (status != 0 || !transfer.is_to_host) data = {};
  if (data.size() > transfer.size) {
    status = -EOVERFLOW;
    data = data.first(transfer.size);
  }
  const std::size_t size =
      transfer.is_to_host ? data.size() : (status == 0 ? transfer.data.size() : 0);
  Header header{};
  write_u32(header, kCommandAt, kSubmitReply);
  write_u32(header, kSequenceAt, transfer.sequence);
  write_u32(header, kStatusAt, static_cast<std::uint32_t>(status));
  write_u32(header, kSizeAt, static_cast<std::uint32_t>(size));
  write_all(socket_, header);
  write_all(socket_, data);
}

}  // namespace rtpm::device_bridges
