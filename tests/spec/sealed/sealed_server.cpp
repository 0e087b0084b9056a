// A server of sealed sessions over UDP, for clients written from spec/security.md: it answers each
// call with the bytes of its request in reverse, and those of method 2 with their number of runs.
// It prints its port and its key, and ends with its standard input.
//   sealed_server [PRE-SHARED KEY IN HEX]

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdio>
#include <string_view>

#include "rtpm/sealed/server.hpp"

namespace rtpm::sealed {
namespace {

class EveryClient : public Admission {
 public:
  bool admits(const crypto::PublicKey&, const wire::PeerAddress&) noexcept override { return true; }
};

MonotonicTime now() {
  timespec time{};
  clock_gettime(CLOCK_MONOTONIC, &time);
  return time_from_ns(time.tv_sec * 1'000'000'000 + time.tv_nsec);
}

/// A socket on loopback, at a port that the system chooses.
class Socket {
 public:
  Socket() : file_(socket(AF_INET, SOCK_DGRAM, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof address;
    is_bound_ = bind(file_, reinterpret_cast<sockaddr*>(&address), size) == 0 &&
                getsockname(file_, reinterpret_cast<sockaddr*>(&address), &size) == 0;
    port_ = ntohs(address.sin_port);
  }
  Socket(const Socket&) = delete;
  Socket& operator=(const Socket&) = delete;
  ~Socket() { close(file_); }

  [[nodiscard]] bool is_bound() const { return is_bound_; }
  [[nodiscard]] int port() const { return port_; }
  /// The next datagram; empty once the standard input has ended.
  [[nodiscard]] MutableBytes receive(MutableBytes into, sockaddr_in& from) const {
    std::array<pollfd, 2> files{{{file_, POLLIN, 0}, {STDIN_FILENO, POLLIN, 0}}};
    if (poll(files.data(), files.size(), -1) <= 0 || files[1].revents != 0) return {};
    socklen_t size = sizeof from;
    const ssize_t count =
        recvfrom(file_, into.data(), into.size(), 0, reinterpret_cast<sockaddr*>(&from), &size);
    return count > 0 ? into.first(static_cast<std::size_t>(count)) : MutableBytes{};
  }
  void send(ConstBytes frame, const sockaddr_in& to) const {
    static_cast<void>(sendto(file_, frame.data(), frame.size(), 0,
                             reinterpret_cast<const sockaddr*>(&to), sizeof to));
  }

 private:
  int file_;
  bool is_bound_ = false;
  int port_ = 0;
};

class Server {
 public:
  explicit Server(const ServerIdentity& identity)
      : sessions_(config()),
        sealed_({.identity = &identity, .admission = &admission_, .key = config().key}, sessions_) {
  }
  void serve(const Socket& socket) {
    std::array<std::byte, 2048> buffer;
    sockaddr_in from{};
    for (MutableBytes frame = socket.receive(buffer, from); !frame.empty();
         frame = socket.receive(buffer, from)) {
      const wire::PeerAddress peer{.low = from.sin_addr.s_addr, .port = from.sin_port};
      SealedServer::Outcome outcome = sealed_.on_frame(frame, peer, now());
      answer(outcome, socket, from);
      while (outcome.job != nullptr) {
        HandshakeJob& job = *outcome.job;
        job.run();
        outcome = sealed_.on_job(job, now());
        answer(outcome, socket, from);
      }
    }
  }

 private:
  static wire::ServerSessionsConfig config() {
    wire::ServerSessionsConfig config;
    config.epoch = 0x5e12e7;
    config.key = {3, 4};
    config.frame_payload_max =
        static_cast<std::uint32_t>(wire::sealed_payload_max(wire::Medium::kDatagram));
    return config;
  }
  void answer(const SealedServer::Outcome& outcome, const Socket& socket, const sockaddr_in& to) {
    ConstBytes frame = outcome.verdict.frame;
    if (outcome.verdict.action == wire::Verdict::Action::kDispatch) {
      const wire::Request& request = outcome.verdict.request;
      const MutableBytes reply = sessions_.reply_buffer(request, now());
      std::size_t size = request.payload.size();
      if (request.header.method == kCountMethod) {
        store_le(reply.data(), ++run_count_);
        size = sizeof run_count_;
      } else {
        std::ranges::reverse_copy(request.payload, reply.begin());
      }
      frame =
          sessions_.complete(request, wire::Status::kOk, static_cast<std::uint32_t>(size), now());
    } else if (outcome.verdict.action != wire::Verdict::Action::kSend) {
      return;
    }
    if (!frame.empty()) socket.send(sealed_.seal(frame), to);
  }

  static constexpr std::uint16_t kCountMethod = 2;
  std::uint64_t run_count_ = 0;
  EveryClient admission_;
  wire::ServerSessions sessions_;
  SealedServer sealed_;
};

int run(std::string_view preshared) {
  ServerIdentity identity{.key = crypto::KeyPair::generate(), .preshared = {}};
  for (std::size_t i = 0; 2 * i + 1 < preshared.size() && i < crypto::kKeySize; ++i) {
    unsigned byte = 0;
    std::from_chars(preshared.data() + 2 * i, preshared.data() + 2 * i + 2, byte, 16);
    identity.preshared.bytes()[i] = static_cast<std::byte>(byte);
  }
  const Socket socket;
  if (!socket.is_bound()) return 1;
  std::printf("%d %d ", socket.port(), identity.suites);
  for (const std::byte byte : identity.key.public_key)
    std::printf("%02x", std::to_integer<unsigned>(byte));
  std::printf("\n");
  std::fflush(stdout);
  Server(identity).serve(socket);
  return 0;
}

}  // namespace
}  // namespace rtpm::sealed

int main(int argument_count, char** arguments) {
  return rtpm::sealed::run(argument_count > 1 ? arguments[1] : "");
}
