#include <fcntl.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <sys/un.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cerrno>
#include <cstring>
#include <optional>

#include "rtpm/rt/clock.hpp"
#include "shared_memory/memory.hpp"
#include "shared_memory/setup.hpp"
#include "shared_memory/unix_socket.hpp"
#include "sockets/native.hpp"

namespace rtpm::transport {
namespace {

// How long a caller waits for a full ring before it gives up on the server.
constexpr Duration kServerPatience = std::chrono::milliseconds{100};
// How often receive() checks the ring. The checks take several times as long as callers spend
// between calls, so that most replies arrive during a check.
constexpr int kCheckCount = 128;
// After this many empty receives, about 20 µs, a spinning caller checks whether the server is
// alive.
constexpr std::uint32_t kReceivesPerCheck = 128;

// How often a sleeping caller checks whether the server is alive. Waiting for the socket as well
// would delay its wake-up.
constexpr Duration kCheckInterval = std::chrono::milliseconds{20};

class SharedMemoryTransport final : public ClientTransport {
 public:
  SharedMemoryTransport(Descriptor socket, Descriptor event, SharedMapping mapping, RingSizes sizes)
      : connection_(std::move(socket), std::move(event), std::move(mapping), sizes,
                    SharedMemoryConnection::Side::kClient) {}

  expected<void, IoError> send(ConstBytes frame) noexcept override {
    // Reads the clock only if the ring is full.
    auto sent = connection_.send(frame, MonotonicTime::min());
    if (!sent && sent.error() == IoError::kFull) {
      sent = connection_.send(frame, rt::now() + kServerPatience);
    }
    return sent;
  }

  expected<MutableBytes, IoError> receive() noexcept override {
    for (int check = 0; check < kCheckCount; ++check) {
      if (!connection_.has_buffered()) continue;
      fruitless_count_ = 0;
      return connection_.receive();
    }
    if (++fruitless_count_ % kReceivesPerCheck == 0) connection_.check_peer();
    // hp-16.4-1: everything that the server wrote before it hung up is in the ring by now.
    return connection_.receive();
  }

  void wait(MonotonicTime until) noexcept override {
    const MonotonicTime next_check = rt::now() + kCheckInterval;
    connection_.wait_for_frame(std::min(until, next_check));
    if (!connection_.has_buffered()) connection_.check_peer();
  }

  bool announce_sleep() noexcept override { return connection_.announce_sleep(); }
  void end_sleep() noexcept override {
    connection_.end_sleep();
    connection_.check_peer();
  }
  int descriptor() const noexcept override { return connection_.descriptor(); }
  wire::Medium medium() const noexcept override { return wire::Medium::kStream; }
  std::optional<std::uint32_t> unread_count() const noexcept override {
    return connection_.unread_count();
  }
  void check_peer() noexcept override { connection_.check_peer(); }

 private:
  SharedMemoryConnection connection_;
  std::uint32_t fruitless_count_ = 0;
};

// Connects by the deadline; returns 0 or the error number.
int connect_by(int socket, const sockaddr_un& native, unsigned size,
               MonotonicTime deadline) noexcept {
  // SO_SNDTIMEO bounds a blocking connect, which waits while the server's backlog is full.
  const MonotonicTime now = rt::now();
  const Duration patience_left = std::max(deadline, now + std::chrono::microseconds{1}) - now;
  const auto left = std::chrono::duration_cast<std::chrono::microseconds>(patience_left).count();
  set_option(socket, SOL_SOCKET, SO_SNDTIMEO,
             timeval{.tv_sec = left / 1'000'000, .tv_usec = left % 1'000'000});
  return connect(socket, reinterpret_cast<const sockaddr*>(&native), size) == 0 ? 0 : errno;
}

SetupError not_reached(const SharedMemoryAddress& address, const std::string& why,
                       const std::string& remedy, std::error_code cause = {}) {
  return {in_words(address) + " gives no shared memory", why, remedy, cause};
}

SetupError exhausted(const SharedMemoryAddress& address, int error) {
  return not_reached(address, std::strerror(error), remedy_for_shortage(error),
                     system_error(error));
}

// The error for a refused request, with the server's reason.
SetupError refused(const SharedMemoryAddress& address, const std::optional<SetupAnswer>& answer) {
  const SetupStatus status = answer ? answer->status : SetupStatus::kNotAllowed;
  if (status == SetupStatus::kNoMemory) {
    return not_reached(address, "the server has no memory or no descriptor left",
                       "raise its limits (ulimit -v, ulimit -n), or use another transport.");
  }
  const bool is_version = status == SetupStatus::kVersionUnsupported;
  return not_reached(address,
                     is_version ? "the server speaks another version" : "the server refused",
                     "run both as one user and of one release, or use another transport.");
}

// The resources that the server granted.
struct Grant {
  Descriptor socket;
  Descriptor memory;
  Descriptor event;
  SetupAnswer answer{};
};

// Connects, sends the request, and receives the answer.
expected<Grant, SetupError> ask(const SharedMemoryAddress& address, const SetupRequest& request,
                                MonotonicTime deadline) {
  sockaddr_un native{};
  const unsigned size = to_native(address, native);
  Grant grant;
  grant.socket = Descriptor(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0));
  if (!grant.socket.is_open()) return unexpected{exhausted(address, errno)};
  if (size == 0) {
    return unexpected{not_reached(address, "too long a name", "choose a shorter folder.")};
  }
  const int socket = grant.socket.number();
  if (const int error = connect_by(socket, native, size, deadline); error != 0) {
    return unexpected{not_reached(address, std::strerror(error),
                                  "start the server on this host, with shared memory, or use "
                                  "another transport.")};
  }
  // hp-16.1-4: any user may take the name, so only memory from the process's own user, and from
  // users that the caller names, is trusted.
  if (!is_trusted(socket, address.trusted_users)) {
    const std::string user = std::to_string(user_of(socket).value_or(0));
    return unexpected{not_reached(address, "the server is another user's, number " + user,
                                  "run both as one user, or trust that user's servers by a line "
                                  "'local uid:" +
                                      user +
                                      "' in known_servers, or use another "
                                      "transport.")};
  }
  std::array<std::byte, SetupAnswer::kSize + 1> message{};
  ReceivedMessage received;
  if (send_message(socket, encode(request), {})) {
    while (!wait_readable(socket, deadline)) {
      if (rt::now() < deadline) continue;
      return unexpected{not_reached(address, "the server does not answer",
                                    "see whether it runs, or use another transport.")};
    }
    received = receive_message(socket, message);
  }
  const auto answer = decode_answer(ConstBytes(message).first(received.size));
  if (!answer || answer->status != SetupStatus::kOk) return unexpected{refused(address, answer)};
  if (received.lacks_descriptors) return unexpected{exhausted(address, EMFILE)};
  grant.memory = std::move(received.descriptors[0]);
  grant.event = std::move(received.descriptors[1]);
  grant.answer = *answer;
  return grant;
}

bool is_possible(std::uint32_t ring_size) noexcept {
  return ring_size >= kRingSizeMin && ring_size <= kRingSizeMax && std::has_single_bit(ring_size);
}

// hp-16.1-5: checks that the memory has the stated size and cannot shrink.
bool is_sound(int memory, RingSizes sizes) noexcept {
  return is_possible(sizes.to_server) && is_possible(sizes.to_client) &&
         sealed_size(memory) >= memory_size(sizes);
}

}  // namespace

bool is_shared_memory_served(const SharedMemoryAddress& address, MonotonicTime deadline) noexcept {
  return ask(address, {.priority = {}, .only_asks = true}, deadline).has_value();
}

expected<std::unique_ptr<ClientTransport>, SetupError> open_shared_memory_transport(
    const SharedMemoryAddress& address, Priority priority, MonotonicTime deadline) {
  auto grant = ask(address, {.priority = priority, .only_asks = false}, deadline);
  if (!grant) return unexpected{grant.error()};
  const RingSizes sizes = grant->answer.sizes;
  if (!is_sound(grant->memory.number(), sizes) || !grant->event.is_open()) {
    return unexpected{not_reached(address, "the server gave memory that breaks the rules",
                                  "use another transport.")};
  }
  // hp-16.3-3: a signal never waits.
  fcntl(grant->event.number(), F_SETFL, O_NONBLOCK);
  SharedMapping mapping(grant->memory.number(), memory_size(sizes));
  if (mapping.bytes().empty()) return unexpected{exhausted(address, ENOMEM)};
  return std::unique_ptr<ClientTransport>(std::make_unique<SharedMemoryTransport>(
      std::move(grant->socket), std::move(grant->event), std::move(mapping), sizes));
}

}  // namespace rtpm::transport
