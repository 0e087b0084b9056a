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
#include <atomic>
#include <cerrno>
#include <cstring>
#include <memory>
#include <system_error>
#include <thread>

#include "rtpm/rt/budget.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/native_time.hpp"
#include "rtpm/rt/semaphore.hpp"
#include "sockets/native.hpp"

namespace rtpm::transport {

Descriptor::~Descriptor() {
  if (number_ >= 0) close(number_);
}

namespace {

// A name server may take much longer than its caller waits, and can't be interrupted.
constexpr int kLookupCountMax = 8;
std::atomic<int> lookup_count{0};

struct Lookup {
  std::string host{};
  int error = EAI_SYSTEM;
  in_addr address{};
  rt::Semaphore done{};
};

void look_up(Lookup& lookup) noexcept {
  addrinfo hints{};
  hints.ai_family = AF_INET;
  addrinfo* found = nullptr;
  lookup.error = getaddrinfo(lookup.host.c_str(), nullptr, &hints, &found);
  if (lookup.error == 0 && found == nullptr) lookup.error = EAI_NONAME;
  if (lookup.error == 0) {
    lookup.address = reinterpret_cast<const sockaddr_in*>(found->ai_addr)->sin_addr;
    freeaddrinfo(found);
  }
  lookup.done.post();
}

// Begins a lookup on a detached thread. Null: too many are under way, or no thread is left.
std::shared_ptr<Lookup> begin_lookup(const std::string& host) {
  if (lookup_count.fetch_add(1) >= kLookupCountMax) {
    lookup_count.fetch_sub(1);
    return nullptr;
  }
  auto lookup = std::make_shared<Lookup>();
  lookup->host = host;
  try {
    std::thread([lookup] {
      look_up(*lookup);
      lookup_count.fetch_sub(1);
    }).detach();
  } catch (const std::system_error&) {
    lookup_count.fetch_sub(1);
    return nullptr;
  }
  return lookup;
}

}  // namespace

expected<sockaddr_in, SetupError> address_of(const std::string& host, std::uint16_t port,
                                             MonotonicTime deadline) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  if (inet_pton(AF_INET, host.c_str(), &address.sin_addr) == 1) return address;
  const auto not_found = [&host](const std::string& what, const std::string& why) {
    return setup_error("host '" + host + "' " + what, why,
                       "check the name, or give a numeric address");
  };
  const auto lookup = begin_lookup(host);
  if (!lookup) {
    return not_found("can't be looked up now",
                     "no thread is left, or too many names are asked for");
  }
  if (!lookup->done.wait_until(deadline)) {
    return not_found("can't be looked up", "no name server answered in time");
  }
  if (lookup->error != 0) return not_found("has no IPv4 address", gai_strerror(lookup->error));
  address.sin_addr = lookup->address;
  return address;
}

expected<sockaddr_in, SetupError> address_of(const std::string& host, std::uint16_t port) {
  return address_of(host, port, rt::now() + kResolvePatience);
}

expected<std::string, SetupError> numeric_address_of(const std::string& host,
                                                     MonotonicTime deadline) {
  const auto address = address_of(host, 0, deadline);
  if (!address) return unexpected{address.error()};
  std::array<char, INET_ADDRSTRLEN> text{};
  inet_ntop(AF_INET, &address->sin_addr, text.data(), text.size());
  return std::string(text.data());
}

bool is_shortage(int error) noexcept {
  return error == EMFILE || error == ENFILE || error == ENOMEM || error == ENOBUFS;
}

const char* remedy_for_shortage(int error) noexcept {
  switch (error) {
    case EMFILE:
      return "raise the limit of open files (ulimit -n; LimitNOFILE= of a systemd unit), or open "
             "fewer.";
    case ENFILE:
      return "raise the host's limit of open files (sysctl fs.file-max), or end other programs.";
    default:
      return "raise the limit of memory (ulimit -v; MemoryMax= of a systemd unit), or free some.";
  }
}

SetupError no_descriptor(const std::string& what, int error) {
  const char* const remedy =
      is_shortage(error) ? remedy_for_shortage(error) : "see which system calls are allowed here.";
  return {what + " can't be had", std::strerror(error), remedy, system_error(error)};
}

wire::PeerAddress host_of(int socket) noexcept {
  sockaddr_storage address{};
  socklen_t size = sizeof address;
  if (getpeername(socket, reinterpret_cast<sockaddr*>(&address), &size) != 0) return {};
  if (address.ss_family == AF_INET) {
    return {.low = reinterpret_cast<const sockaddr_in&>(address).sin_addr.s_addr};
  }
  ucred credentials{};
  size = sizeof credentials;
  if (getsockopt(socket, SOL_SOCKET, SO_PEERCRED, &credentials, &size) != 0) return {};
  return {.low = static_cast<std::uint32_t>(credentials.pid)};
}

SetupError not_served(const std::string& what, int error) {
  const char* remedy = "give an address of this host, such as 127.0.0.1.";
  if (error == EADDRINUSE) {
    remedy =
        "end the program that has it (ss -lptun), or choose another port; 0 lets the system "
        "choose.";
  } else if (error == EACCES) {
    remedy =
        "choose a port from 1024 on, or 0, which lets the system choose; lower ones need root, "
        "or CAP_NET_BIND_SERVICE.";
  }
  return {what + " can't be served", std::strerror(error), remedy, system_error(error)};
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
  set_option(socket, IPPROTO_IP, IP_TOS, type_of_service);
  set_option(socket, SOL_SOCKET, SO_PRIORITY, chosen.queue);
}

namespace {

bool wait_for(int descriptor, short events, MonotonicTime until) noexcept {
  const rt::AsleepScope asleep;
  pollfd entry{descriptor, events, 0};
  if (until == kNever) return ppoll(&entry, 1, nullptr, nullptr) > 0;
  // The difference to a time long past would overflow.
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
  set_option(socket, SOL_SOCKET, SO_RCVTIMEO, limit);
  const int flags = fcntl(socket, F_GETFL);
  fcntl(socket, F_SETFL, flags & ~O_NONBLOCK);
}

bool may_block_until(MonotonicTime until, Duration time) noexcept {
  if (until == kNever) return true;
  const MonotonicTime now = rt::now();
  return until > now && until - now > time + kBlockTimeError;
}

Descriptor spare_descriptor() noexcept {
  return Descriptor(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
}

Accepted accept_or_turn_away(int listener, Descriptor& spare) noexcept {
  Accepted accepted;
  accepted.socket = Descriptor(accept4(listener, nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
  if (accepted.socket.is_open()) {
    if (!spare.is_open()) spare = spare_descriptor();
    return accepted;
  }
  if (!is_shortage(errno)) return accepted;
  accepted.shortage = errno;
  { const Descriptor closed = std::move(spare); }
  {
    const Descriptor unwanted(accept4(listener, nullptr, nullptr, SOCK_CLOEXEC));
    accepted.still_waits = !unwanted.is_open() && is_shortage(errno);
  }
  spare = spare_descriptor();
  return accepted;
}

}  // namespace rtpm::transport
