#include <fastdds/rtps/transport/shared_mem/SharedMemTransportDescriptor.h>
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <fastrtps/attributes/LibrarySettingsAttributes.h>
#include <fastrtps/xmlparser/XMLProfileManager.h>
#include <cstring>
#include <fastdds/dds/core/condition/WaitSet.hpp>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/TopicDataType.hpp>

#include "topics.hpp"

// Fast DDS: a request and a reply topic for each caller, reliable, of which the last sample counts.
// Its documentation's chapters on real time and on shared memory: a bounded, plain type, memory
// preallocated, synchronous publication (the default), and one transport only: UDP, or shared
// memory with data sharing, by which readers take samples where the writer put them. Each lane has
// a participant of its own, whose threads have the lane's priority.
// Its events have no broker: each goes straight from the supplier's participant to the consumers'.
// Delivery within a process, which would leave out the transport, is turned off for them.
namespace rtpm::bench {
namespace {

namespace dds = eprosima::fastdds::dds;
namespace rtps = eprosima::fastdds::rtps;
using eprosima::fastrtps::rtps::SerializedPayload_t;

/// Of the first lane. The default domain, which other programs of the host may use, is left alone.
/// Each lane has a domain of its own: what participants of one process and domain tell each other
/// has a thread of high priority spin for a lock of a low one's.
constexpr std::uint32_t kDomain = 98;
constexpr const char* kEventTopic = "rtpm_bench_events";

/// A plain struct as it lies in memory, behind the header that every serialised sample has.
template <class Plain>
class PlainType final : public dds::TopicDataType {
 public:
  PlainType() {
    setName(kName);
    m_typeSize = kHeaderSize + sizeof(Plain);
    m_isGetKeyDefined = false;
  }
  bool serialize(void* data, SerializedPayload_t* payload) override {
    constexpr std::uint8_t kLittleEndian[kHeaderSize]{0, 1, 0, 0};
    std::memcpy(payload->data, kLittleEndian, kHeaderSize);
    std::memcpy(payload->data + kHeaderSize, data, sizeof(Plain));
    payload->encapsulation = CDR_LE;
    payload->length = m_typeSize;
    return true;
  }
  bool deserialize(SerializedPayload_t* payload, void* data) override {
    if (payload->length < m_typeSize) return false;
    std::memcpy(data, payload->data + kHeaderSize, sizeof(Plain));
    return true;
  }
  std::function<std::uint32_t()> getSerializedSizeProvider(void*) override {
    return [size = m_typeSize] { return size; };
  }
  void* createData() override { return new Plain; }
  void deleteData(void* data) override { delete static_cast<Plain*>(data); }
  bool getKey(void*, eprosima::fastrtps::rtps::InstanceHandle_t*, bool) override { return false; }
  [[nodiscard]] bool is_bounded() const override { return true; }
  [[nodiscard]] bool is_plain() const override { return true; }

  static constexpr const char* kName =
      sizeof(Plain) == sizeof(PeerMessage) ? "PeerMessage" : "EventStamp";

 private:
  static constexpr std::uint32_t kHeaderSize = 4;
};

dds::DomainParticipant* make_participant(const PeerLane& lane) {
  dds::DomainParticipantQos qos;
  qos.transport().use_builtin_transports = false;
  if (lane.transport == "shm") {
    qos.transport().user_transports.push_back(
        std::make_shared<rtps::SharedMemTransportDescriptor>());
  } else {
    auto udp = std::make_shared<rtps::UDPv4TransportDescriptor>();
    udp->interfaceWhiteList.emplace_back("127.0.0.1");
    qos.transport().user_transports.push_back(udp);
  }
  return dds::DomainParticipantFactory::get_instance()->create_participant(
      kDomain + static_cast<std::uint32_t>(lane.index), qos);
}

/// `depth`: of samples that are kept until they are taken.
template <class Qos>
Qos qos_of(const PeerLane& lane, std::int32_t depth) {
  Qos qos;
  qos.reliability().kind = dds::RELIABLE_RELIABILITY_QOS;
  qos.history().kind = dds::KEEP_LAST_HISTORY_QOS;
  qos.history().depth = depth;
  qos.endpoint().history_memory_policy = eprosima::fastrtps::rtps::PREALLOCATED_MEMORY_MODE;
  if (lane.transport == "shm") {
    qos.data_sharing().automatic();
  } else {
    qos.data_sharing().off();
  }
  return qos;
}

template <class Plain>
dds::Topic* make_topic(dds::DomainParticipant* participant, const std::string& name) {
  if (participant == nullptr) return nullptr;
  dds::TypeSupport(new PlainType<Plain>).register_type(participant);
  return participant->create_topic(name, PlainType<Plain>::kName, dds::TOPIC_QOS_DEFAULT);
}

template <class Plain>
dds::DataWriter* make_writer(const PeerLane& lane, dds::DomainParticipant* participant,
                             const std::string& name, std::int32_t depth) {
  auto* const topic = make_topic<Plain>(participant, name);
  if (topic == nullptr) return nullptr;
  return participant->create_publisher(dds::PUBLISHER_QOS_DEFAULT)
      ->create_datawriter(topic, qos_of<dds::DataWriterQos>(lane, depth));
}

dds::DataReader* make_reader(const PeerLane& lane, dds::DomainParticipant* participant,
                             dds::TopicDescription* topic, std::int32_t depth) {
  if (topic == nullptr) return nullptr;
  auto* const reader = participant->create_subscriber(dds::SUBSCRIBER_QOS_DEFAULT)
                           ->create_datareader(topic, qos_of<dds::DataReaderQos>(lane, depth));
  if (reader != nullptr) {
    reader->get_statuscondition().set_enabled_statuses(dds::StatusMask::data_available());
  }
  return reader;
}

template <class Plain>
bool take(dds::DataReader* reader, Plain& to) {
  dds::SampleInfo info;
  return reader->take_next_sample(&to, &info) == ReturnCode_t::RETCODE_OK && info.valid_data;
}

template <class Plain>
Outcome write(dds::DataWriter* writer, Plain sample) {
  if (!writer->write(&sample)) return failure_of("Fast DDS", "write");
  return {};
}

/// One end of a caller's two topics.
struct End {
  End(const PeerLane& lane, dds::DomainParticipant* participant, const std::string& reads,
      const std::string& writes)
      : reader(make_reader(lane, participant, make_topic<PeerMessage>(participant, reads), 1)),
        writer(make_writer<PeerMessage>(lane, participant, writes, 1)) {}
  [[nodiscard]] bool is_well() const noexcept { return reader != nullptr && writer != nullptr; }
  dds::DataReader* reader;
  dds::DataWriter* writer;
};

Outcome serve(const PeerLane& lane, const Announce& announce) {
  auto* const participant = make_participant(lane);
  std::vector<End> ends;
  dds::WaitSet waiting;
  for (int caller = 0; caller < lane.connection_count; ++caller) {
    const End& end = ends.emplace_back(lane, participant, topic_name(lane, caller, "request"),
                                       topic_name(lane, caller, "reply"));
    if (!end.is_well()) return failure_of("Fast DDS", "topic");
    waiting.attach_condition(end.reader->get_statuscondition());
  }
  announce("by name");
  for (PeerMessage message;;) {
    dds::ConditionSeq active;
    waiting.wait(active, eprosima::fastrtps::c_TimeInfinite);
    for (const End& end : ends) {
      while (take(end.reader, message)) {
        answer(message.work_ns);
        end.writer->write(&message);
      }
    }
  }
}

expected<Exchange, std::string> connect(const PeerLane& lane, const std::string&) {
  // One for all callers of a lane.
  static std::array<dds::DomainParticipant*, kPeerLaneCount> participants{};
  auto*& participant = participants[lane.index];
  if (participant == nullptr) participant = make_participant(lane);
  const End end(lane, participant, topic_name(lane, lane.caller, "reply"),
                topic_name(lane, lane.caller, "request"));
  if (!end.is_well()) return failure_of("Fast DDS", "topic");
  auto waiting = std::make_shared<dds::WaitSet>();
  waiting->attach_condition(end.reader->get_statuscondition());
  return find_server(
      {.send = [end](const PeerMessage& request) { return write(end.writer, request); },
       .receive =
           [end, waiting](PeerMessage& reply, Duration patience) {
             const MonotonicTime give_up = rt::now() + patience;
             const eprosima::fastrtps::Duration_t in_seconds(
                 std::chrono::duration<double>(patience).count());
             while (!take(end.reader, reply)) {
               if (rt::now() > give_up) return false;
               dds::ConditionSeq active;
               waiting->wait(active, in_seconds);
             }
             return true;
           }});
}

expected<Push, std::string> connect_supplier(const PeerLane& lane, const std::string&) {
  eprosima::fastrtps::LibrarySettingsAttributes settings;
  settings.intraprocess_delivery = eprosima::fastrtps::INTRAPROCESS_OFF;
  eprosima::fastrtps::xmlparser::XMLProfileManager::library_settings(settings);
  auto* const writer =
      make_writer<EventStamp>(lane, make_participant(lane), kEventTopic, kEventQueueMax);
  if (writer == nullptr) return failure_of("Fast DDS", "topic");
  return [writer](const EventStamp& stamp) { return write(writer, stamp); };
}

expected<Consume, std::string> connect_consumer(const PeerLane& lane, const std::string&,
                                                Note& note) {
  static auto* const kParticipant = make_participant(lane);
  static auto* const kTopic = make_topic<EventStamp>(kParticipant, kEventTopic);
  auto* const reader = make_reader(lane, kParticipant, kTopic, kEventQueueMax);
  if (reader == nullptr) return failure_of("Fast DDS", "topic");
  return [reader, &note] {
    dds::WaitSet waiting;
    waiting.attach_condition(reader->get_statuscondition());
    for (EventStamp stamp;;) {
      dds::ConditionSeq active;
      waiting.wait(active, eprosima::fastrtps::c_TimeInfinite);
      while (take(reader, stamp))
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
