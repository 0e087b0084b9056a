#include "os/native_socket.hpp"

#include <mstcpip.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <system_error>
#include <thread>

#include "rtpm/rt/clock.hpp"
#include "rtpm/transport/wait_set.hpp"
#include "sockets/native.hpp"

// Older headers lack these.
#ifndef SIO_UDP_CONNRESET
#define SIO_UDP_CONNRESET _WSAIOW(IOC_VENDOR, 12)
#endif
#ifndef SIO_UDP_NETRESET
#define SIO_UDP_NETRESET _WSAIOW(IOC_VENDOR, 15)
#endif
#ifndef TCP_MAXRT
#define TCP_MAXRT 5
#endif
#ifndef TCP_KEEPIDLE
#define TCP_KEEPIDLE 3
#define TCP_KEEPINTVL 17
#endif

namespace rtpm::transport::os {
namespace {

using std::chrono::milliseconds;

constexpr DWORD kFlags = WSA_FLAG_OVERLAPPED | WSA_FLAG_NO_HANDLE_INHERIT;

SOCKET native(int number) noexcept {
  return static_cast<SOCKET>(number);
}

Descriptor owned(SOCKET socket) noexcept {
  if (socket == INVALID_SOCKET) {
    fail();
    return {};
  }
  return Descriptor(static_cast<int>(socket));
}

// A refused connection may take longer to report: WSAPoll reports it since Windows 10 2004.
int poll_for(std::span<pollfd> entries, int time_ms) noexcept {
  if (entries.empty()) {
    Sleep(static_cast<DWORD>(time_ms));
    return 0;
  }
  const int ready = WSAPoll(entries.data(), static_cast<ULONG>(entries.size()), time_ms);
  return ready >= 0 ? ready : fail();
}

bool is_file(int number) noexcept {
  return GetFileType(reinterpret_cast<HANDLE>(native(number))) == FILE_TYPE_DISK;
}

}  // namespace

Descriptor open_socket(int family, int type, Blocking) noexcept {
  start_winsock();
  Descriptor socket = owned(WSASocketW(family, type, 0, nullptr, 0, kFlags));
  u_long is_non_blocking = 1;
  if (socket.is_open())
    ioctlsocket(native(socket.number()), static_cast<long>(FIONBIO), &is_non_blocking);
  return socket;
}

Descriptor accept_from(int listener, Blocking) noexcept {
  // It does not block either, as the listener does not.
  return owned(::accept(native(listener), nullptr, nullptr));
}

void close(int descriptor) noexcept {
  if (is_file(descriptor)) {
    CloseHandle(reinterpret_cast<HANDLE>(native(descriptor)));
  } else {
    closesocket(native(descriptor));
  }
}

Descriptor duplicate(int socket) noexcept {
  WSAPROTOCOL_INFOW information{};
  if (WSADuplicateSocketW(native(socket), GetCurrentProcessId(), &information) != 0) {
    fail();
    return {};
  }
  return owned(WSASocketW(FROM_PROTOCOL_INFO, FROM_PROTOCOL_INFO, FROM_PROTOCOL_INFO, &information,
                          0, kFlags));
}

bool is_open(int descriptor) noexcept {
  int type = 0;
  socklen_t size = sizeof type;
  return getsockopt(descriptor, SOL_SOCKET, SO_TYPE, &type, &size) == 0;
}

void limit_blocking(int, Duration) noexcept {}

int poll_until(std::span<pollfd> entries, MonotonicTime until) noexcept {
  constexpr Duration kMost = std::chrono::hours{1};
  if (until == kAlready) return poll_for(entries, 0);
  if (until == kNever) return poll_for(entries, -1);
  const Duration left = std::clamp(until - rt::now(), Duration{0}, kMost);
  // Rounded up, as the rest can't be waited for.
  return poll_for(entries, static_cast<int>(std::chrono::ceil<milliseconds>(left).count()));
}

void prepare_server_port(int socket) noexcept {
  set_option(socket, SOL_SOCKET, SO_EXCLUSIVEADDRUSE, 1);
  // Otherwise a reply that its client no longer waits for makes the next receive fail.
  BOOL is_reported = FALSE;
  DWORD size = 0;
  for (const DWORD reset : {DWORD{SIO_UDP_CONNRESET}, DWORD{SIO_UDP_NETRESET}}) {
    WSAIoctl(native(socket), reset, &is_reported, sizeof is_reported, nullptr, 0, &size, nullptr,
             nullptr);
  }
}

// Windows lets it bind, and with SO_REUSEADDR would let others take the port.
void prepare_listener(int socket) noexcept {
  set_option(socket, SOL_SOCKET, SO_EXCLUSIVEADDRUSE, 1);
}

// A socket can't be bound to a group; it receives those that it has joined.
SocketAddress address_to_hear(const SocketAddress& group) noexcept {
  return SocketAddress::of_ipv4(INADDR_ANY, group.port());
}

// The names of interfaces have blanks.
std::string name_of_zone(std::uint32_t zone) {
  return std::to_string(zone);
}

std::string lookup_error_text(int error) {
  return std::system_category().message(error);
}

std::optional<PeerProcess> peer_process(int) noexcept {
  return std::nullopt;
}

bool is_own_or_root(std::uint32_t user) noexcept {
  return user == 0;  // See users_at().
}

void enlarge_receive_buffer(int socket, int size) noexcept {
  set_option(socket, SOL_SOCKET, SO_RCVBUF, size);
}

void set_queue(int, int) noexcept {}

void limit_silence(int stream) noexcept {
  set_option(stream, SOL_SOCKET, SO_KEEPALIVE, 1);
  // All in seconds.
  set_option(stream, IPPROTO_TCP, TCP_KEEPIDLE, 5);
  set_option(stream, IPPROTO_TCP, TCP_KEEPINTVL, 1);
  set_option(stream, IPPROTO_TCP, TCP_MAXRT, 3);
}

std::optional<std::size_t> unacknowledged_size(int) noexcept {
  return std::nullopt;
}

void keep_whole(int socket) noexcept {
  set_option(socket, IPPROTO_IP, IP_DONTFRAGMENT, 1);
}

bool hear_joined_groups_only(int) noexcept {
  return true;
}

}  // namespace rtpm::transport::os
