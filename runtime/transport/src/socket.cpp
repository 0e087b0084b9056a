#include "rtpm/transport/socket.hpp"

#include <arpa/inet.h>
#include <fcntl.h>
#include <netdb.h>
#include <netinet/ip.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include <array>
#include <cerrno>

#include "rtpm/rt/budget.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/native_time.hpp"

namespace rtpm::transport {

Descriptor::~Descriptor() {
  if (number_ >= 0) close(number_);
}

expected<sockaddr_in, TransportError> address_of(const std::string& host, std::uint16_t port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  if (inet_pton(AF_INET, host.c_str(), &address.sin_addr) == 1) return address;
  addrinfo hints{};
  hints.ai_family = AF_INET;
  addrinfo* found = nullptr;
  const int error = getaddrinfo(host.c_str(), nullptr, &hints, &found);
  if (error != 0 || found == nullptr) {
    return unexpected{TransportError{"host '" + host + "' has no IPv4 address (" +
                                     gai_strerror(error) +
                                     "). Remedy: check the name, or give a numeric address."}};
  }
  address.sin_addr = reinterpret_cast<const sockaddr_in*>(found->ai_addr)->sin_addr;
  freeaddrinfo(found);
  return address;
}

expected<std::string, TransportError> numeric_address_of(const std::string& host) {
  const auto address = address_of(host, 0);
  if (!address) return unexpected{address.error()};
  std::array<char, INET_ADDRSTRLEN> text{};
  inet_ntop(AF_INET, &address->sin_addr, text.data(), text.size());
  return std::string(text.data());
}

std::string remedy_for_bind(int error) {
  switch (error) {
    case EADDRINUSE:
      return "Remedy: end the program that has it (ss -lptun), or choose another port; 0 lets the "
             "system choose.";
    case EACCES:
      return "Remedy: choose a port from 1024 on, or 0, which lets the system choose; lower ones "
             "need root, or CAP_NET_BIND_SERVICE.";
    default:
      return "Remedy: give an address of this host, such as 127.0.0.1.";
  }
}

void set_traffic_class(int socket, Priority priority) noexcept {
  constexpr int kDscpShift = 2;
  struct Class {
    int dscp;
    int queue;
  };
  // By quarters of the range. SO_PRIORITY above 6 would need a privilege.
  constexpr Class kClasses[] = {{0, 0}, {18, 2}, {34, 4}, {46, 6}};
  const Class chosen = kClasses[priority.value() / ((Priority::kHighest + 1) / 4)];
  const int type_of_service = chosen.dscp << kDscpShift;
  // IP_TOS sets SO_PRIORITY as well, so it comes first.
  setsockopt(socket, IPPROTO_IP, IP_TOS, &type_of_service, sizeof type_of_service);
  setsockopt(socket, SOL_SOCKET, SO_PRIORITY, &chosen.queue, sizeof chosen.queue);
}

namespace {

bool wait_for(int descriptor, short events, MonotonicTime until) noexcept {
  const rt::AsleepScope asleep;
  pollfd entry{descriptor, events, 0};
  if (until == kNever) return ppoll(&entry, 1, nullptr, nullptr) > 0;
  // A time long past may be so far away that no difference can be told.
  const MonotonicTime now = rt::now();
  const Duration left = until > now ? until - now : Duration{0};
  const timespec timeout = rt::to_timespec(left);
  return ppoll(&entry, 1, &timeout, nullptr) > 0;
}

}  // namespace

bool wait_readable(int descriptor, MonotonicTime until) noexcept {
  return wait_for(descriptor, POLLIN, until);
}

bool wait_writable(int descriptor, MonotonicTime until) noexcept {
  return wait_for(descriptor, POLLOUT, until);
}

void limit_blocking(int socket, Duration time) noexcept {
  const timeval limit{.tv_sec = 0, .tv_usec = time / std::chrono::microseconds{1}};
  setsockopt(socket, SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof limit);
  const int flags = fcntl(socket, F_GETFL);
  fcntl(socket, F_SETFL, flags & ~O_NONBLOCK);
}

bool may_block_until(MonotonicTime until, Duration time) noexcept {
  if (until == kNever) return true;
  const MonotonicTime now = rt::now();
  return until > now && until - now > time + kBlockTimeError;
}

}  // namespace rtpm::transport
