#include "server.hpp"

#include <arpa/inet.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <memory>
#include <utility>

namespace rtpm::vrpn {
namespace {

constexpr std::array kTypes{kPoseType,  kVelocityType, kButtonType, kAnalogType,
                            kForceType, kPingType,     kPongType};
constexpr std::size_t kNameCountMax = 4096;
constexpr int kReadCountMax = 16;
/// Edges of a button between two samples; more are a restarted device.
constexpr unsigned kEdgeCountMax = 64;
/// The rotation of a velocity report is that of 10 ms.
constexpr double kVelocitySpanS = 0.01;

std::int32_t number_of(std::string_view type) {
  return static_cast<std::int32_t>(std::ranges::find(kTypes, type) - kTypes.begin());
}

bool has_axis(const driver::Descriptor& descriptor, bool driver::Axis::*property) {
  return std::ranges::any_of(descriptor.axes, property);
}

/// The port behind the last blank of "HOST PORT"; 0 if there is none.
std::uint16_t port_in(std::string_view text) {
  text = text.substr(0, text.find('\0'));
  const std::size_t blank = text.rfind(' ');
  std::uint16_t port = 0;
  if (blank == std::string_view::npos) return 0;
  const std::string_view digits = text.substr(blank + 1);
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), port);
  return error == std::errc{} && end == digits.data() + digits.size() ? port : 0;
}

void set_port(sockaddr_storage& address, std::uint16_t port) {
  if (address.ss_family == AF_INET6) {
    reinterpret_cast<sockaddr_in6&>(address).sin6_port = htons(port);
  } else {
    reinterpret_cast<sockaddr_in&>(address).sin_port = htons(port);
  }
}

std::uint16_t port_of(int socket) {
  sockaddr_storage address{};
  socklen_t size = sizeof address;
  ::getsockname(socket, reinterpret_cast<sockaddr*>(&address), &size);
  return ntohs(address.ss_family == AF_INET6 ? reinterpret_cast<sockaddr_in6&>(address).sin6_port
                                             : reinterpret_cast<sockaddr_in&>(address).sin_port);
}

}  // namespace

expected<Server, SetupError> Server::create(ServerConfig config) {
  Server server(std::move(config));
  if (auto listening = server.listen(); !listening) return unexpected{listening.error()};
  return server;
}

expected<void, SetupError> Server::listen() {
  addrinfo wanted{};
  wanted.ai_flags = AI_NUMERICHOST | AI_PASSIVE;
  wanted.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  if (::getaddrinfo(config_.host.c_str(), nullptr, &wanted, &found) != 0) {
    return setup_error("'" + config_.host + "' is no numeric address", "",
                       "give --host an address of this host, such as 127.0.0.1");
  }
  const std::unique_ptr<addrinfo, decltype(&::freeaddrinfo)> owned(found, &::freeaddrinfo);
  sockaddr_storage address{};
  std::memcpy(&address, found->ai_addr, found->ai_addrlen);
  set_port(address, config_.port);
  const auto* const at = reinterpret_cast<const sockaddr*>(&address);
  const std::string what = "VRPN at " + config_.host + " port " + std::to_string(config_.port);
  constexpr int kFlags = SOCK_NONBLOCK | SOCK_CLOEXEC;
  tcp_ = transport::Descriptor(::socket(address.ss_family, SOCK_STREAM | kFlags, 0));
  const int yes = 1;
  ::setsockopt(tcp_.number(), SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
  if (::bind(tcp_.number(), at, found->ai_addrlen) != 0 || ::listen(tcp_.number(), 16) != 0) {
    return unexpected{transport::not_served(what, errno)};
  }
  port_ = port_of(tcp_.number());
  set_port(address, port_);
  udp_ = transport::Descriptor(::socket(address.ss_family, SOCK_DGRAM | kFlags, 0));
  if (::bind(udp_.number(), at, found->ai_addrlen) != 0) {
    return unexpected{transport::not_served(what, errno)};
  }
  return {};
}

void Server::poll() {
  accept();
  answer_datagrams();
  for (Connection& connection : connections_) {
    if (!connection.is_closed) read(connection);
    if (!connection.is_closed) write(connection);
  }
  connections_.remove_if([](const Connection& connection) { return connection.is_closed; });
}

void Server::accept() {
  while (true) {
    transport::Descriptor socket(
        ::accept4(tcp_.number(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
    if (!socket.is_open()) return;
    add(std::move(socket));
  }
}

void Server::answer_datagrams() {
  std::array<char, 256> text{};
  for (int i = 0; i < kReadCountMax; ++i) {
    sockaddr_storage from{};
    socklen_t size = sizeof from;
    const ssize_t count = ::recvfrom(udp_.number(), text.data(), text.size(), 0,
                                     reinterpret_cast<sockaddr*>(&from), &size);
    if (count < 0) return;
    const std::uint16_t port = port_in({text.data(), static_cast<std::size_t>(count)});
    if (port == 0) continue;
    // The address in the text could be anybody's.
    set_port(from, port);
    transport::Descriptor socket(
        ::socket(from.ss_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
    const int connected = ::connect(socket.number(), reinterpret_cast<sockaddr*>(&from), size);
    if (connected == 0 || errno == EINPROGRESS) add(std::move(socket));
  }
}

void Server::add(transport::Descriptor socket) {
  if (connections_.size() >= kConnectionCountMax) {
    ++counters_.refused_count;
    return;
  }
  const int yes = 1;
  ::setsockopt(socket.number(), IPPROTO_TCP, TCP_NODELAY, &yes, sizeof yes);
  ++counters_.connection_count;
  connections_.push_back({.socket = std::move(socket)});
  greet(connections_.back());
}

void Server::greet(Connection& connection) {
  const auto bytes = cookie();
  connection.out.assign(bytes.begin(), bytes.end());
  const auto describe = [&](std::size_t number, std::int32_t kind, std::string_view name) {
    const Payload payload = name_payload(name);
    append(connection.out,
           {.sender = static_cast<std::int32_t>(number), .type = kind, .payload = payload},
           connection.message_count++);
  };
  for (std::size_t i = 0; i < config_.devices.size(); ++i)
    describe(i, kSenderDescription, config_.devices[i].name);
  for (std::size_t i = 0; i < kTypes.size(); ++i)
    describe(i, kTypeDescription, kTypes[i]);
}

void Server::read(Connection& connection) {
  std::array<std::byte, 4096> bytes{};
  for (int i = 0; i < kReadCountMax && !connection.is_closed; ++i) {
    const ssize_t count = ::recv(connection.socket.number(), bytes.data(), bytes.size(), 0);
    if (count < 0) {
      // ENOTCONN: it still connects.
      connection.is_closed = errno != EAGAIN && errno != EINTR && errno != ENOTCONN;
      return;
    }
    if (count == 0) {
      connection.is_closed = true;
      return;
    }
    take(connection, ConstBytes(bytes).first(static_cast<std::size_t>(count)));
  }
}

void Server::take(Connection& connection, ConstBytes bytes) {
  if (!connection.is_greeted) {
    auto& head = connection.unread_cookie;
    const std::size_t count = std::min(bytes.size(), kCookieSize - head.size());
    head.insert(head.end(), bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(count));
    bytes = bytes.subspan(count);
    if (head.size() < kCookieSize) return;
    if (!is_cookie(head)) return close(connection);
    connection.is_greeted = true;
    for (std::size_t i = 0; i < config_.devices.size(); ++i) {
      if (!buttons_[i].is_known) continue;
      for (std::size_t button = 0; button < config_.devices[i].descriptor.buttons.size(); ++button)
        send(connection, static_cast<std::int32_t>(i), kButtonType, 0,
             button_payload(static_cast<std::int32_t>(button),
                            (buttons_[i].pressed >> button & 1U) != 0));
    }
  }
  connection.parser.push(bytes);
  while (const auto message = connection.parser.next())
    take(connection, *message);
  if (connection.parser.is_broken()) close(connection);
}

void Server::take(Connection& connection, const Message& message) {
  if (message.type == kSenderDescription || message.type == kTypeDescription) {
    auto& names = message.type == kSenderDescription ? connection.senders : connection.types;
    const auto name = read_name(message.payload);
    if (!name || names.size() >= kNameCountMax) return close(connection);
    names[message.sender] = *name;
    return;
  }
  const auto type = connection.types.find(message.type);
  const auto sender = connection.senders.find(message.sender);
  if (type == connection.types.end() || type->second != kPingType) return;
  if (sender == connection.senders.end()) return;
  const auto device = std::ranges::find(config_.devices, sender->second, &ServedDevice::name);
  if (device == config_.devices.end()) return;
  send(connection, static_cast<std::int32_t>(device - config_.devices.begin()), kPongType,
       message.time_us, {});
}

void Server::write(Connection& connection) {
  std::vector<std::byte>& out = connection.out;
  std::size_t sent = 0;
  while (sent < out.size()) {
    const ssize_t count =
        ::send(connection.socket.number(), out.data() + sent, out.size() - sent, MSG_NOSIGNAL);
    if (count < 0) {
      if (errno == EAGAIN || errno == EINTR || errno == ENOTCONN) break;
      connection.is_closed = true;
      return;
    }
    sent += static_cast<std::size_t>(count);
  }
  out.erase(out.begin(), out.begin() + static_cast<std::ptrdiff_t>(sent));
  if (out.size() > kUnreadSizeMax) close(connection);
}

void Server::send(Connection& connection, std::int32_t sender, std::string_view type,
                  std::int64_t time_us, const Payload& payload) {
  append(connection.out,
         {.sender = sender, .type = number_of(type), .time_us = time_us, .payload = payload},
         connection.message_count++);
}

void Server::send_all(std::size_t device, std::string_view type, std::int64_t time_us,
                      const Payload& payload, bool may_be_dropped) {
  for (Connection& connection : connections_) {
    if (!connection.is_greeted) continue;
    if (may_be_dropped && connection.out.size() > kBacklogSizeMax) {
      ++counters_.dropped_count;
    } else {
      send(connection, static_cast<std::int32_t>(device), type, time_us, payload);
    }
  }
}

void Server::publish(std::size_t device, const driver::Sample& sample, std::int64_t time_us) {
  const driver::Descriptor& descriptor = config_.devices[device].descriptor;
  if (has_axis(descriptor, &driver::Axis::is_sensed)) {
    send_all(device, kPoseType, time_us, pose_payload(0, sample.pose), true);
    send_all(device, kVelocityType, time_us, velocity_payload(0, sample.twist, kVelocitySpanS),
             true);
  }
  if (!descriptor.analogs.empty()) {
    send_all(device, kAnalogType, time_us,
             analog_payload(std::span(sample.analogs).first(descriptor.analogs.size())), true);
  }
  if (has_axis(descriptor, &driver::Axis::is_actuated)) {
    send_all(device, kForceType, time_us, force_payload(sample.wrench_applied.force_newton), true);
  }
  publish_buttons(device, sample, time_us);
}

void Server::publish_buttons(std::size_t device, const driver::Sample& sample,
                             std::int64_t time_us) {
  Buttons& before = buttons_[device];
  for (std::size_t i = 0; i < config_.devices[device].descriptor.buttons.size(); ++i) {
    const bool is_pressed = (sample.buttons >> i & 1U) != 0;
    unsigned count = static_cast<std::uint16_t>(sample.button_edges[i] - before.edges[i]);
    if (!before.is_known || count > kEdgeCountMax) count = 1;
    // The newest change leads to the present state; those before it alternate.
    for (; count > 0; --count) {
      send_all(device, kButtonType, time_us,
               button_payload(static_cast<std::int32_t>(i), is_pressed == (count % 2 == 1)), false);
    }
  }
  before = {.is_known = true, .pressed = sample.buttons, .edges = sample.button_edges};
}

void Server::close(Connection& connection) {
  ++counters_.closed_count;
  connection.is_closed = true;
}

}  // namespace rtpm::vrpn
