#include <lcm/lcm.h>

#include <cstring>

#include "topics.hpp"

// LCM: a request and a reply channel for each caller. It has one transport between programs, UDP
// multicast, here of a time-to-live of 0, which stays within the host; nothing is repeated that
// gets lost, and nothing can be tuned but the receive buffer. Each lane and each caller has an
// instance of its own, with its own thread that receives and so has the lane's priority.
// Its events have no broker: the kernel takes each datagram to every consumer's instance.
namespace rtpm::bench {
namespace {

constexpr const char* kEventChannel = "rtpm_bench_events";

expected<lcm_t*, std::string> create() {
  lcm_t* const lcm = lcm_create("udpm://239.255.76.97:7697?ttl=0&recv_buf_size=1048576");
  if (lcm != nullptr) return lcm;
  return unexpected{
      std::string("LCM does not start; it needs an interface with multicast. Remedy: ip link set "
                  "lo multicast on && ip route add 224.0.0.0/4 dev lo.")};
}

/// A message that the handler of a channel left.
struct Letter {
  PeerMessage message{};
  bool is_new = false;
  std::string reply_channel{};
};

void take(const lcm_recv_buf_t* buffer, const char*, void* user) {
  auto& letter = *static_cast<Letter*>(user);
  if (buffer->data_size != sizeof letter.message) return;
  std::memcpy(&letter.message, buffer->data, sizeof letter.message);
  letter.is_new = true;
}

Outcome serve(const PeerLane& lane, const Announce& announce) {
  const auto lcm = create();
  if (!lcm) return unexpected{lcm.error()};
  std::vector<Letter> letters(static_cast<std::size_t>(lane.connection_count));
  int caller = 0;
  for (Letter& letter : letters) {
    letter.reply_channel = topic_name(lane, caller, "reply");
    lcm_subscribe(*lcm, topic_name(lane, caller++, "request").c_str(), take, &letter);
  }
  announce("by name");
  while (lcm_handle(*lcm) == 0) {
    for (Letter& letter : letters) {
      if (!std::exchange(letter.is_new, false)) continue;
      answer(letter.message.work_ns);
      lcm_publish(*lcm, letter.reply_channel.c_str(), &letter.message, sizeof letter.message);
    }
  }
  return failure_of("LCM", "server");
}

expected<Exchange, std::string> connect(const PeerLane& lane, const std::string&) {
  const auto created = create();
  if (!created) return unexpected{created.error()};
  lcm_t* const lcm = *created;
  auto& letter = *new Letter;
  lcm_subscribe(lcm, topic_name(lane, lane.caller, "reply").c_str(), take, &letter);
  return find_server({.send = [lcm, channel = topic_name(lane, lane.caller, "request")](
                                  const PeerMessage& request) -> Outcome {
                        if (lcm_publish(lcm, channel.c_str(), &request, sizeof request) == 0)
                          return {};
                        return failure_of("LCM", "publish");
                      },
                      .receive =
                          [lcm, &letter](PeerMessage& reply, Duration patience) {
                            const auto ms =
                                std::chrono::duration_cast<std::chrono::milliseconds>(patience);
                            letter.is_new = false;
                            if (lcm_handle_timeout(lcm, static_cast<int>(ms.count())) <= 0)
                              return false;
                            reply = letter.message;
                            return letter.is_new;
                          }});
}

expected<Push, std::string> connect_supplier(const PeerLane&, const std::string&) {
  const auto created = create();
  if (!created) return unexpected{created.error()};
  return [lcm = *created](const EventStamp& stamp) -> Outcome {
    if (lcm_publish(lcm, kEventChannel, &stamp, sizeof stamp) == 0) return {};
    return failure_of("LCM", "publish");
  };
}

expected<Consume, std::string> connect_consumer(const PeerLane&, const std::string&, Note& note) {
  const auto created = create();
  if (!created) return unexpected{created.error()};
  const auto take_event = [](const lcm_recv_buf_t* buffer, const char*, void* user) {
    (*static_cast<const Note*>(user))(buffer->data, buffer->data_size);
  };
  lcm_subscribe(*created, kEventChannel, take_event, &note);
  return [lcm = *created] {
    while (lcm_handle_timeout(lcm, 1000) >= 0) {
    }
  };
}

}  // namespace

const Peer kPeer{.serve = serve,
                 .connect = connect,
                 .connect_supplier = connect_supplier,
                 .connect_consumer = connect_consumer};

}  // namespace rtpm::bench
