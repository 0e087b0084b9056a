#include <lcm/lcm.h>

#include <atomic>
#include <cstring>
#include <vector>

#include "topic_caller.hpp"

// LCM: a request and a reply channel for each caller. It has one transport between programs, UDP
// multicast, here of a time-to-live of 0, which stays within the host; nothing is repeated that
// gets lost, and nothing can be tuned but the receive buffer. Each lane and each caller has an
// instance of its own, with its own thread that receives and so has the lane's priority.
// Its events have no broker: each goes straight from the supplier to every consumer.
namespace rtpm::bench {
namespace {

constexpr const char* kUrl = "udpm://239.255.76.97:7697?ttl=0&recv_buf_size=1048576";

/// A message that the handler of a channel left.
struct Letter {
  PeerMessage message{};
  bool is_new = false;
};

void take(const lcm_recv_buf_t* buffer, const char*, void* user) {
  auto& letter = *static_cast<Letter*>(user);
  if (buffer->data_size != sizeof letter.message) return;
  std::memcpy(&letter.message, buffer->data, sizeof letter.message);
  letter.is_new = true;
}

class LcmCaller final : public TopicCaller {
 public:
  LcmCaller(std::size_t lane, int caller)
      : lcm_(lcm_create(kUrl)), request_(topic_name(lane, caller, "request")) {
    if (lcm_ == nullptr) return;
    lcm_subscribe(lcm_, topic_name(lane, caller, "reply").c_str(), take, &letter_);
  }
  ~LcmCaller() override {
    if (lcm_ != nullptr) lcm_destroy(lcm_);
  }
  [[nodiscard]] bool is_well() const noexcept { return lcm_ != nullptr; }

 protected:
  expected<void, std::string> send(const PeerMessage& request) override {
    if (lcm_publish(lcm_, request_.c_str(), &request, sizeof request) != 0) {
      return unexpected{std::string("LCM can't publish")};
    }
    return {};
  }

  bool receive(PeerMessage& reply, Duration patience) override {
    const auto patience_ms = std::chrono::duration_cast<std::chrono::milliseconds>(patience);
    letter_.is_new = false;
    if (lcm_handle_timeout(lcm_, static_cast<int>(patience_ms.count())) <= 0) return false;
    reply = letter_.message;
    return letter_.is_new;
  }

 private:
  lcm_t* lcm_;
  std::string request_;
  Letter letter_{};
};

constexpr const char* kEventChannel = "rtpm_bench_events";

/// A publisher, and subscribers with an instance and a thread each.
class LcmSide final : public PeerEventSide {
 public:
  LcmSide() : supplier_(lcm_create(kUrl)) {}
  ~LcmSide() override {
    is_stopping_ = true;
    threads_.clear();
    for (const auto& consumer : consumers_)
      lcm_destroy(consumer->lcm);
    if (supplier_ != nullptr) lcm_destroy(supplier_);
  }
  [[nodiscard]] bool is_well() const noexcept { return supplier_ != nullptr; }

  [[nodiscard]] expected<void, std::string> begin(int consumer_count, EventBoard& board) {
    for (int i = 0; i < consumer_count; ++i) {
      lcm_t* const lcm = lcm_create(kUrl);
      if (lcm == nullptr) return unexpected{std::string("LCM has no more instances")};
      auto& consumer = *consumers_.emplace_back(
          std::make_unique<Consumer>(Consumer{consumers_.size(), &board, lcm}));
      lcm_subscribe(lcm, kEventChannel, note, &consumer);
      auto thread = start_consumer([this, lcm] {
        while (!is_stopping_)
          lcm_handle_timeout(lcm, 100);
      });
      if (!thread) return unexpected{thread.error()};
      threads_.push_back(std::move(*thread));
    }
    return {};
  }

  expected<void, std::string> push(const EventStamp& stamp) override {
    if (lcm_publish(supplier_, kEventChannel, &stamp, sizeof stamp) != 0) {
      return unexpected{std::string("LCM can't publish")};
    }
    return {};
  }

 private:
  struct Consumer {
    std::size_t number;
    EventBoard* board;
    lcm_t* lcm;
  };
  static void note(const lcm_recv_buf_t* buffer, const char*, void* user) {
    const auto& consumer = *static_cast<const Consumer*>(user);
    consumer.board->note(consumer.number,
                         {static_cast<const std::byte*>(buffer->data), buffer->data_size},
                         rt::now());
  }

  lcm_t* supplier_;
  std::vector<std::unique_ptr<Consumer>> consumers_{};
  std::atomic<bool> is_stopping_{false};
  std::vector<rt::Thread> threads_{};
};

// The kernel takes each datagram to all who joined the multicast group.
class LcmPeer final : public BrokerlessPeer {
 public:
  expected<std::unique_ptr<EventSide>, std::string> connect_events(const PeerLane&,
                                                                   const std::string&,
                                                                   int consumer_count,
                                                                   EventBoard& board) override {
    auto side = std::make_unique<LcmSide>();
    if (!side->is_well()) return unexpected{no_lcm()};
    if (auto begun = side->begin(consumer_count, board); !begun) return unexpected{begun.error()};
    return std::unique_ptr<EventSide>(std::move(side));
  }

  expected<void, std::string> serve(const PeerLane& lane,
                                    const Announce& publish_link_report) override {
    lcm_t* const lcm = lcm_create(kUrl);
    if (lcm == nullptr) return unexpected{no_lcm()};
    std::vector<Letter> letters(static_cast<std::size_t>(lane.connection_count));
    std::vector<std::string> replies;
    for (int caller = 0; caller < lane.connection_count; ++caller) {
      lcm_subscribe(lcm, topic_name(lane.index, caller, "request").c_str(), take,
                    &letters[static_cast<std::size_t>(caller)]);
      replies.push_back(topic_name(lane.index, caller, "reply"));
    }
    publish_link_report("by name");
    while (lcm_handle(lcm) == 0) {
      for (std::size_t caller = 0; caller < letters.size(); ++caller) {
        Letter& letter = letters[caller];
        if (!std::exchange(letter.is_new, false)) continue;
        answer(letter.message);
        lcm_publish(lcm, replies[caller].c_str(), &letter.message, sizeof letter.message);
      }
    }
    return unexpected{std::string("LCM's server ended")};
  }

  expected<std::unique_ptr<Caller>, std::string> connect(const PeerLane& lane,
                                                         const std::string&) override {
    auto caller = std::make_unique<LcmCaller>(lane.index, caller_counts_[lane.index]++);
    if (!caller->is_well()) return unexpected{no_lcm()};
    if (auto found = caller->find_server(); !found) return unexpected{found.error()};
    return std::unique_ptr<Caller>(std::move(caller));
  }

 private:
  [[nodiscard]] static std::string no_lcm() {
    return "LCM does not start; it needs an interface with multicast. Remedy: ip link set lo "
           "multicast on && ip route add 224.0.0.0/4 dev lo.";
  }
  std::array<int, kPeerLaneCount> caller_counts_{};
};

}  // namespace

std::unique_ptr<Peer> make_peer() {
  return std::make_unique<LcmPeer>();
}

}  // namespace rtpm::bench
