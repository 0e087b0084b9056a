#pragma once

#include <utility>

#include "peer.hpp"

/// Calls by middleware that has only topics: a request on one, its reply on another.
namespace rtpm::bench {

/// Each caller has two topics of its own, so that a reply is for it alone.
[[nodiscard]] inline std::string topic_name(const PeerLane& lane, int caller, const char* what) {
  return "rtpm_bench_lane" + std::to_string(lane.index) + "_caller" + std::to_string(caller) + "_" +
         what;
}

/// A caller's ends of its two topics.
struct Topics {
  std::function<Outcome(const PeerMessage& request)> send;
  /// False if nothing came in time.
  std::function<bool(PeerMessage& reply, Duration patience)> receive;
};

/// Calls until an answer comes: what is said before the two have found each other is lost. Then
/// waits until no late answer is left.
[[nodiscard]] inline expected<Exchange, std::string> find_server(Topics topics) {
  const MonotonicTime give_up = rt::now() + std::chrono::seconds{8};
  for (PeerMessage reply; rt::now() < give_up;) {
    if (auto sent = topics.send({}); !sent) return unexpected{sent.error()};
    if (!topics.receive(reply, std::chrono::milliseconds{100})) continue;
    while (topics.receive(reply, std::chrono::milliseconds{200})) {
    }
    return Exchange([topics = std::move(topics)](const PeerMessage& request, PeerMessage& got) {
      auto outcome = topics.send(request);
      if (outcome && !topics.receive(got, std::chrono::seconds{1})) {
        outcome = unexpected{std::string("no reply in 1 s")};
      }
      return outcome;
    });
  }
  return unexpected{std::string("no answer to any request within 8 s")};
}

}  // namespace rtpm::bench
