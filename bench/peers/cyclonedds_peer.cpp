#include <dds/dds.h>
#include <peer_dds.h>

#include <cstdlib>

#include "topics.hpp"

// Cyclone DDS: a request and a reply topic for each caller, reliable, where only the last sample
// counts, and wait sets, like its own round-trip example. Samples are delivered by the thread that
// receives them, which is the default for such topics. Only the loopback interface is used, without
// multicast. A domain's threads are those of the process, started by the first lane's participant,
// with the high priority; each lane's thread answers its own requests. Shared memory would need
// iceoryx's daemon, RouDi, beside the peer's programs, and is not used.
// Its events have no broker: each goes straight from the supplier to the consumers. The supplier is
// in another domain of the same program, which has the same number outside: within one domain,
// samples would be passed on without any transport.
namespace rtpm::bench {
namespace {

constexpr const char* kConfiguration =
    "<CycloneDDS><Domain><General><Interfaces><NetworkInterface name=\"lo\"/></Interfaces>"
    "<AllowMulticast>false</AllowMulticast></General><Discovery><ParticipantIndex>auto"
    "</ParticipantIndex><Peers><Peer address=\"127.0.0.1\"/></Peers><ExternalDomainId>97"
    "</ExternalDomainId></Discovery></Domain></CycloneDDS>";
/// The default domain, which other programs of the host may use, is left alone.
constexpr dds_domainid_t kDomain = 97;
constexpr dds_domainid_t kSupplierDomain = 96;

dds_entity_t create_participant(dds_domainid_t domain) {
  dds_create_domain(domain, kConfiguration);
  return dds_create_participant(domain, nullptr, nullptr);
}

dds_entity_t participant_of(TopicRole role) {
  if (role == TopicRole::kSupplier) return create_participant(kSupplierDomain);
  static const dds_entity_t kParticipant = create_participant(kDomain);
  return kParticipant;
}

dds_qos_t* qos_of(int depth) {
  dds_qos_t* const qos = dds_create_qos();
  dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, DDS_SECS(1));
  dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, depth);
  return qos;
}

template <class Sample>
dds_entity_t create_topic(dds_entity_t participant, const std::string& name) {
  constexpr bool kIsMessage = std::is_same_v<Sample, PeerMessage>;
  static_assert(sizeof(Sample) == (kIsMessage ? sizeof(peer_DdsMessage) : sizeof(peer_DdsEvent)));
  return dds_create_topic(participant, kIsMessage ? &peer_DdsMessage_desc : &peer_DdsEvent_desc,
                          name.c_str(), nullptr, nullptr);
}

struct Cyclone {
  static constexpr const char* kName = "Cyclone DDS";
  static constexpr const char* kRemedy = "its log says why";

  struct Context {
    Context(const PeerLane&, TopicRole role) : participant(participant_of(role)) {}
    bool wait(Duration patience) const {
      static_assert(DDS_INFINITY == Duration::max().count());
      return dds_waitset_wait(waiting, nullptr, 0, patience.count()) > 0;
    }
    dds_entity_t participant;
    dds_entity_t waiting = dds_create_waitset(participant);
  };

  template <class Sample>
  struct Reader {
    Reader(const Context& context, const std::string& name, int depth)
        : reader(dds_create_reader(context.participant,
                                   create_topic<Sample>(context.participant, name), qos_of(depth),
                                   nullptr)) {
      dds_waitset_attach(context.waiting, dds_create_readcondition(reader, DDS_ANY_STATE), 0);
    }
    [[nodiscard]] bool is_well() const { return reader > 0; }
    [[nodiscard]] bool take(Sample& to) const {
      void* sample = &to;
      dds_sample_info_t info{};
      return dds_take(reader, &sample, &info, 1, 1) > 0 && info.valid_data;
    }
    dds_entity_t reader;
  };

  template <class Sample>
  struct Writer {
    Writer(const Context& context, const std::string& name, int depth)
        : writer(dds_create_writer(context.participant,
                                   create_topic<Sample>(context.participant, name), qos_of(depth),
                                   nullptr)) {}
    [[nodiscard]] bool is_well() const { return writer > 0; }
    bool write(const Sample& sample) const { return dds_write(writer, &sample) == DDS_RETCODE_OK; }
    dds_entity_t writer;
  };
};

}  // namespace

const Peer kPeer = kTopicPeer<Cyclone>;

}  // namespace rtpm::bench
