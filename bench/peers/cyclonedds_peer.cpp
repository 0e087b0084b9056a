#include <dds/dds.h>
#include <peer_dds.h>

#include <cstdlib>
#include <cstring>

#include "topics.hpp"

// Cyclone DDS: a request and a reply topic for each caller, reliable, of which the last sample
// counts, as its own round-trip example has it, and wait sets as there. Samples are delivered by
// the thread that receives them, which is the default for such topics. Only the loopback interface
// is used, without multicast. Threads of a domain are those of the process, started by the first
// lane's participant, with the high priority; each lane's thread answers its own requests. Shared
// memory would need iceoryx's daemon, RouDi, beside the peer's programs, and is not used.
// Its events have no broker: each goes straight from the supplier to the consumers. The supplier is
// of another domain of the same program, which outside has the same number: within one domain,
// samples would be passed on without any transport.
namespace rtpm::bench {
namespace {

constexpr const char* kConfiguration =
    "<CycloneDDS><Domain><General><Interfaces><NetworkInterface name=\"lo\"/></Interfaces>"
    "<AllowMulticast>false</AllowMulticast></General><Discovery><ParticipantIndex>auto"
    "</ParticipantIndex><Peers><Peer address=\"127.0.0.1\"/></Peers><ExternalDomainId>97"
    "</ExternalDomainId></Discovery></Domain></CycloneDDS>";
/// The default domain's, which other programs of the host may use, is left alone.
constexpr dds_domainid_t kDomain = 97;
constexpr dds_domainid_t kSupplierDomain = 96;
constexpr const char* kEventTopic = "rtpm_bench_events";

auto failure(const char* what, dds_return_t code) {
  return failure_of("Cyclone DDS", what, dds_strretcode(code));
}

dds_entity_t participant() {
  static const dds_entity_t kParticipant = [] {
    setenv("CYCLONEDDS_URI", kConfiguration, 1);
    return dds_create_participant(kDomain, nullptr, nullptr);
  }();
  return kParticipant;
}

/// Of samples, as many as `depth` are kept until they are taken.
dds_qos_t* qos_of(int depth) {
  dds_qos_t* const qos = dds_create_qos();
  dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, DDS_SECS(1));
  dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, depth);
  return qos;
}

template <class Sample>
Outcome write(dds_entity_t writer, const Sample& sample) {
  if (const dds_return_t code = dds_write(writer, &sample)) return failure("write", code);
  return {};
}

/// A topic's reader, with what waits for it.
struct Reader {
  Reader(const std::string& name, const dds_topic_descriptor_t& type, int depth) {
    const dds_entity_t topic =
        dds_create_topic(participant(), &type, name.c_str(), nullptr, nullptr);
    reader = dds_create_reader(participant(), topic, qos_of(depth), nullptr);
    condition = dds_create_readcondition(reader, DDS_ANY_STATE);
    waiting = dds_create_waitset(participant());
    dds_waitset_attach(waiting, condition, 0);
  }
  /// Takes what is there; false if that is nothing.
  template <class Sample>
  [[nodiscard]] bool take(Sample& to) const {
    void* sample = &to;
    dds_sample_info_t info{};
    return dds_take(reader, &sample, &info, 1, 1) > 0 && info.valid_data;
  }
  [[nodiscard]] bool wait(dds_duration_t patience) const {
    dds_attach_t triggered = 0;
    return dds_waitset_wait(waiting, &triggered, 1, patience) > 0;
  }
  dds_entity_t reader = 0;
  dds_entity_t condition = 0;
  dds_entity_t waiting = 0;
};

/// One end of a caller's two topics.
struct End {
  End(const std::string& reads, const std::string& writes)
      : reader(reads, peer_DdsMessage_desc, 1) {
    const dds_entity_t out =
        dds_create_topic(participant(), &peer_DdsMessage_desc, writes.c_str(), nullptr, nullptr);
    writer = dds_create_writer(participant(), out, qos_of(1), nullptr);
  }
  [[nodiscard]] bool is_well() const noexcept { return reader.reader > 0 && writer > 0; }
  Reader reader;
  dds_entity_t writer = 0;
};

Outcome serve(const PeerLane& lane, const Announce& announce) {
  std::vector<End> ends;
  const dds_entity_t waiting = dds_create_waitset(participant());
  for (int caller = 0; caller < lane.connection_count; ++caller) {
    const End& end =
        ends.emplace_back(topic_name(lane, caller, "request"), topic_name(lane, caller, "reply"));
    if (!end.is_well()) return failure("topic", end.writer);
    dds_waitset_attach(waiting, end.reader.condition, caller);
  }
  announce("by name");
  std::vector<dds_attach_t> triggered(ends.size());
  for (peer_DdsMessage message{};;) {
    const dds_return_t count =
        dds_waitset_wait(waiting, triggered.data(), triggered.size(), DDS_INFINITY);
    for (dds_return_t i = 0; i < count; ++i) {
      const End& end = ends[static_cast<std::size_t>(triggered[static_cast<std::size_t>(i)])];
      if (!end.reader.take(message)) continue;
      answer(message.work_ns);
      dds_write(end.writer, &message);
    }
  }
}

expected<Exchange, std::string> connect(const PeerLane& lane, const std::string&) {
  const End end(topic_name(lane, lane.caller, "reply"), topic_name(lane, lane.caller, "request"));
  if (!end.is_well()) return failure("topic", end.writer);
  static_assert(sizeof(peer_DdsMessage) == sizeof(PeerMessage));
  return find_server(
      {.send = [end](const PeerMessage& request) { return write(end.writer, request); },
       .receive =
           [end](PeerMessage& reply, Duration patience) {
             return end.reader.wait(patience.count()) && end.reader.take(reply);
           }});
}

expected<Push, std::string> connect_supplier(const PeerLane&, const std::string&) {
  static_assert(sizeof(peer_DdsEvent) == sizeof(EventStamp));
  dds_create_domain(kSupplierDomain, kConfiguration);
  const dds_entity_t supplier = dds_create_participant(kSupplierDomain, nullptr, nullptr);
  const dds_entity_t topic =
      dds_create_topic(supplier, &peer_DdsEvent_desc, kEventTopic, nullptr, nullptr);
  const dds_entity_t writer = dds_create_writer(supplier, topic, qos_of(kEventQueueMax), nullptr);
  if (writer < 0) return failure("topic", writer);
  return [writer](const EventStamp& stamp) { return write(writer, stamp); };
}

expected<Consume, std::string> connect_consumer(const PeerLane&, const std::string&, Note& note) {
  const Reader reader(kEventTopic, peer_DdsEvent_desc, kEventQueueMax);
  if (reader.reader < 0) return failure("topic", reader.reader);
  return [reader, &note] {
    EventStamp stamp;
    while (reader.wait(DDS_INFINITY)) {
      while (reader.take(stamp))
        note(&stamp, sizeof stamp);
    }
  };
}

}  // namespace

const Peer kPeer{.serve = serve,
                 .connect = connect,
                 .connect_supplier = connect_supplier,
                 .connect_consumer = connect_consumer};

}  // namespace rtpm::bench
