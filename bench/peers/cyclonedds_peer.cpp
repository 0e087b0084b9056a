#include <dds/dds.h>
#include <peer_dds.h>

#include <atomic>
#include <cstdlib>
#include <cstring>
#include <span>
#include <vector>

#include "topic_caller.hpp"

// Cyclone DDS: a request and a reply topic for each caller, reliable, of which the last sample
// counts, as its own round-trip example has it, and wait sets as there. Samples are delivered by
// the thread that receives them, which is the default for such topics. Only the loopback interface
// is used, without multicast. Threads of a domain are those of the process, started by the first
// lane's participant, with the high priority; each lane's thread answers its own requests. Shared
// memory would need iceoryx's daemon, RouDi, beside the peer's programs, and is not used.
// Its events have no broker: each goes straight from the supplier to the consumers. These are of
// another domain of the same program, which outside has the same number: within one domain, samples
// would be passed on without any transport.
namespace rtpm::bench {
namespace {

constexpr const char* kConfiguration =
    "<CycloneDDS><Domain><General><Interfaces><NetworkInterface name=\"lo\"/></Interfaces>"
    "<AllowMulticast>false</AllowMulticast></General><Discovery><ParticipantIndex>auto"
    "</ParticipantIndex><Peers><Peer address=\"127.0.0.1\"/></Peers><ExternalDomainId>97"
    "</ExternalDomainId></Discovery></Domain></CycloneDDS>";

/// The default domain's, which other programs of the host may use, is left alone.
constexpr dds_domainid_t kDomain = 97;
/// Of suppliers, which outside is the same domain.
constexpr dds_domainid_t kSupplierDomain = 96;

dds_entity_t participant() {
  static const dds_entity_t kParticipant = [] {
    setenv("CYCLONEDDS_URI", kConfiguration, 1);
    return dds_create_participant(kDomain, nullptr, nullptr);
  }();
  return kParticipant;
}

/// One end of a caller's two topics.
struct End {
  End(const std::string& reads, const std::string& writes) {
    dds_qos_t* const qos = dds_create_qos();
    dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, DDS_SECS(1));
    dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, 1);
    const dds_entity_t in =
        dds_create_topic(participant(), &peer_DdsMessage_desc, reads.c_str(), nullptr, nullptr);
    const dds_entity_t out =
        dds_create_topic(participant(), &peer_DdsMessage_desc, writes.c_str(), nullptr, nullptr);
    reader = dds_create_reader(participant(), in, qos, nullptr);
    writer = dds_create_writer(participant(), out, qos, nullptr);
    condition = dds_create_readcondition(reader, DDS_ANY_STATE);
    dds_delete_qos(qos);
  }
  [[nodiscard]] bool is_well() const noexcept { return reader > 0 && writer > 0 && condition > 0; }

  /// Takes what is there; false if that is nothing.
  [[nodiscard]] bool take(peer_DdsMessage& message) const {
    void* sample = &message;
    dds_sample_info_t info{};
    return dds_take(reader, &sample, &info, 1, 1) > 0 && info.valid_data;
  }

  dds_entity_t reader = 0;
  dds_entity_t writer = 0;
  dds_entity_t condition = 0;
};

class CycloneCaller final : public TopicCaller {
 public:
  CycloneCaller(std::size_t lane, int caller)
      : end_(topic_name(lane, caller, "reply"), topic_name(lane, caller, "request")),
        waiting_(dds_create_waitset(participant())) {
    dds_waitset_attach(waiting_, end_.condition, 0);
  }
  [[nodiscard]] bool is_well() const noexcept { return end_.is_well(); }

 protected:
  expected<void, std::string> send(const PeerMessage& request) override {
    peer_DdsMessage message{};
    message.work_ns = request.work_ns;
    std::memcpy(message.values, request.values.data(), sizeof message.values);
    if (const dds_return_t code = dds_write(end_.writer, &message); code != DDS_RETCODE_OK) {
      return unexpected{std::string("Cyclone DDS can't write: ") + dds_strretcode(code)};
    }
    return {};
  }

  bool receive(PeerMessage& reply, Duration patience) override {
    peer_DdsMessage message{};
    dds_attach_t triggered = 0;
    if (dds_waitset_wait(waiting_, &triggered, 1, patience.count()) <= 0 || !end_.take(message)) {
      return false;
    }
    reply.work_ns = message.work_ns;
    std::memcpy(reply.values.data(), message.values, sizeof message.values);
    return true;
  }

 private:
  End end_;
  dds_entity_t waiting_;
};

/// Events that a queue holds before it loses some, as of the other peers.
constexpr std::int32_t kQueuedMax = 1024;
static_assert(sizeof(peer_DdsEvent) == sizeof(EventStamp));

/// A writer, and readers with a wait set and a thread each.
class CycloneSide final : public PeerEventSide {
 public:
  ~CycloneSide() override {
    is_stopping_ = true;
    threads_.clear();
    dds_delete(supplier_);
  }

  [[nodiscard]] expected<void, std::string> begin(int consumer_count, EventBoard& board) {
    const dds_entity_t consumers = participant();
    supplier_ = dds_create_domain(kSupplierDomain, kConfiguration);
    const dds_entity_t supplier = dds_create_participant(kSupplierDomain, nullptr, nullptr);
    dds_qos_t* const qos = dds_create_qos();
    dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, DDS_SECS(1));
    dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, kQueuedMax);
    writer_ = dds_create_writer(supplier, topic_of(supplier), qos, nullptr);
    const dds_entity_t topic = topic_of(consumers);
    for (int i = 0; i < consumer_count; ++i) {
      const dds_entity_t reader = dds_create_reader(consumers, topic, qos, nullptr);
      const dds_entity_t waiting = dds_create_waitset(consumers);
      dds_waitset_attach(waiting, dds_create_readcondition(reader, DDS_ANY_STATE), 0);
      if (reader < 0 || writer_ < 0) return unexpected{std::string("Cyclone DDS makes no topic")};
      auto thread =
          start_consumer([this, reader, waiting, &board, number = static_cast<std::size_t>(i)] {
            while (!is_stopping_)
              consume(reader, waiting, board, number);
          });
      if (!thread) return unexpected{thread.error()};
      threads_.push_back(std::move(*thread));
    }
    dds_delete_qos(qos);
    return {};
  }

  expected<void, std::string> push(const EventStamp& stamp) override {
    peer_DdsEvent event;
    std::memcpy(&event, &stamp, sizeof event);
    if (const dds_return_t code = dds_write(writer_, &event); code != DDS_RETCODE_OK) {
      return unexpected{std::string("Cyclone DDS can't write: ") + dds_strretcode(code)};
    }
    return {};
  }

 private:
  [[nodiscard]] static dds_entity_t topic_of(dds_entity_t participant) {
    return dds_create_topic(participant, &peer_DdsEvent_desc, "rtpm_bench_events", nullptr,
                            nullptr);
  }
  static void consume(dds_entity_t reader, dds_entity_t waiting, EventBoard& board,
                      std::size_t number) {
    dds_attach_t triggered = 0;
    if (dds_waitset_wait(waiting, &triggered, 1, DDS_MSECS(100)) <= 0) return;
    peer_DdsEvent event{};
    void* sample = &event;
    dds_sample_info_t info{};
    while (dds_take(reader, &sample, &info, 1, 1) > 0) {
      if (info.valid_data) board.note(number, std::as_bytes(std::span(&event, 1)), rt::now());
    }
  }

  dds_entity_t supplier_ = 0;  ///< Its domain.
  dds_entity_t writer_ = 0;
  std::atomic<bool> is_stopping_{false};
  std::vector<rt::Thread> threads_{};
};

class CyclonePeer final : public BrokerlessPeer {
 public:
  expected<std::unique_ptr<EventSide>, std::string> connect_events(const PeerLane&,
                                                                   const std::string&,
                                                                   int consumer_count,
                                                                   EventBoard& board) override {
    return begin_side<CycloneSide>(consumer_count, board);
  }

  expected<void, std::string> serve(const PeerLane& lane,
                                    const Announce& publish_link_report) override {
    std::vector<End> ends;
    const dds_entity_t waiting = dds_create_waitset(participant());
    for (int caller = 0; caller < lane.connection_count; ++caller) {
      const End& end = ends.emplace_back(topic_name(lane.index, caller, "request"),
                                         topic_name(lane.index, caller, "reply"));
      if (!end.is_well()) return unexpected{std::string("Cyclone DDS can't make its topics")};
      dds_waitset_attach(waiting, end.condition, caller);
    }
    publish_link_report("by name");
    std::vector<dds_attach_t> triggered(ends.size());
    peer_DdsMessage message{};
    for (;;) {
      const dds_return_t count =
          dds_waitset_wait(waiting, triggered.data(), triggered.size(), DDS_INFINITY);
      for (dds_return_t i = 0; i < count; ++i) {
        const End& end = ends[static_cast<std::size_t>(triggered[static_cast<std::size_t>(i)])];
        if (!end.take(message)) continue;
        answer({.work_ns = message.work_ns});
        dds_write(end.writer, &message);
      }
    }
  }

  expected<std::unique_ptr<Caller>, std::string> connect(const PeerLane& lane,
                                                         const std::string&) override {
    auto caller = std::make_unique<CycloneCaller>(lane.index, caller_counts_[lane.index]++);
    if (!caller->is_well()) return unexpected{std::string("Cyclone DDS can't make its topics")};
    if (auto found = caller->find_server(); !found) return unexpected{found.error()};
    return std::unique_ptr<Caller>(std::move(caller));
  }

 private:
  std::array<int, kPeerLaneCount> caller_counts_{};
};

}  // namespace

std::unique_ptr<Peer> make_peer() {
  return std::make_unique<CyclonePeer>();
}

}  // namespace rtpm::bench
