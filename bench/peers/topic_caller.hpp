#pragma once

#include <string>

#include "peer.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::bench {

/// The names of a lane's topics. Each of its callers has two of its own, so that a reply is for it
/// alone.
[[nodiscard]] inline std::string topic_name(std::size_t lane, int caller, const char* what) {
  return "rtpm_bench_lane" + std::to_string(lane) + "_caller" + std::to_string(caller) + "_" + what;
}

/// A caller of a middleware that knows no calls, only topics: a request on one, its reply on
/// another.
class TopicCaller : public PeerCaller {
 public:
  /// Calls until an answer comes: what is said before the two have found each other is lost. Then
  /// waits until no late answer is left.
  [[nodiscard]] expected<void, std::string> find_server() {
    const MonotonicTime give_up = rt::now() + std::chrono::seconds{8};
    while (rt::now() < give_up) {
      PeerMessage reply;
      if (auto sent = send({}); !sent) return sent;
      if (!receive(reply, std::chrono::milliseconds{100})) continue;
      while (receive(reply, std::chrono::milliseconds{200})) {
      }
      return {};
    }
    return unexpected{std::string("no answer to any request within 8 s")};
  }

 protected:
  [[nodiscard]] virtual expected<void, std::string> send(const PeerMessage& request) = 0;
  /// False if nothing came in time.
  [[nodiscard]] virtual bool receive(PeerMessage& reply, Duration patience) = 0;

  expected<void, std::string> exchange(const PeerMessage& request, PeerMessage& reply) final {
    if (auto sent = send(request); !sent) return sent;
    if (!receive(reply, std::chrono::seconds{1})) return unexpected{std::string("no reply in 1 s")};
    return {};
  }
};

}  // namespace rtpm::bench
