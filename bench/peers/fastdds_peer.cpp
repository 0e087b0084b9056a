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

/// The first lane's domain. The default domain, which other programs of the host may use, is left
/// alone. Each lane has a domain of its own: where participants of one process share a domain, a
/// thread of high priority spins for a lock that one of low priority holds.
constexpr std::uint32_t kDomain = 98;

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

dds::DomainParticipant* participant_of(const PeerLane& lane, TopicRole role) {
  if (role == TopicRole::kSupplier) {
    eprosima::fastrtps::LibrarySettingsAttributes settings;
    settings.intraprocess_delivery = eprosima::fastrtps::INTRAPROCESS_OFF;
    eprosima::fastrtps::xmlparser::XMLProfileManager::library_settings(settings);
    return make_participant(lane);
  }
  // One for all callers or consumers of a lane.
  static std::array<dds::DomainParticipant*, kPeerLaneCount> participants{};
  auto*& participant = participants[lane.index];
  if (participant == nullptr) participant = make_participant(lane);
  return participant;
}

template <class Qos>
Qos qos_of(bool is_shared, std::int32_t depth) {
  Qos qos;
  qos.reliability().kind = dds::RELIABLE_RELIABILITY_QOS;
  qos.history().kind = dds::KEEP_LAST_HISTORY_QOS;
  qos.history().depth = depth;
  qos.endpoint().history_memory_policy = eprosima::fastrtps::rtps::PREALLOCATED_MEMORY_MODE;
  if (is_shared) {
    qos.data_sharing().automatic();
  } else {
    qos.data_sharing().off();
  }
  return qos;
}

struct FastDds {
  static constexpr const char* kName = "Fast DDS";
  static constexpr const char* kRemedy = "its log says why";

  struct Context {
    Context(const PeerLane& lane, TopicRole role)
        : is_shared(lane.transport == "shm"), participant(participant_of(lane, role)) {}
    template <class Sample>
    [[nodiscard]] dds::Topic* topic(const std::string& name) const {
      if (participant == nullptr) return nullptr;
      dds::TypeSupport(new PlainType<Sample>).register_type(participant);
      auto* const known = dynamic_cast<dds::Topic*>(participant->lookup_topicdescription(name));
      if (known != nullptr) return known;
      return participant->create_topic(name, PlainType<Sample>::kName, dds::TOPIC_QOS_DEFAULT);
    }
    bool wait(Duration patience) {
      dds::ConditionSeq active;
      const eprosima::fastrtps::Duration_t in_seconds(
          std::chrono::duration<double>(patience).count());
      return waiting.wait(active, patience == Duration::max()
                                      ? eprosima::fastrtps::c_TimeInfinite
                                      : in_seconds) == ReturnCode_t::RETCODE_OK;
    }
    bool is_shared;
    dds::DomainParticipant* participant;
    dds::WaitSet waiting{};
  };

  template <class Sample>
  struct Reader {
    Reader(Context& context, const std::string& name, int depth) {
      auto* const topic = context.topic<Sample>(name);
      if (topic == nullptr) return;
      reader = context.participant->create_subscriber(dds::SUBSCRIBER_QOS_DEFAULT)
                   ->create_datareader(topic, qos_of<dds::DataReaderQos>(context.is_shared, depth));
      if (reader == nullptr) return;
      reader->get_statuscondition().set_enabled_statuses(dds::StatusMask::data_available());
      context.waiting.attach_condition(reader->get_statuscondition());
    }
    [[nodiscard]] bool is_well() const { return reader != nullptr; }
    [[nodiscard]] bool take(Sample& to) const {
      dds::SampleInfo info;
      return reader->take_next_sample(&to, &info) == ReturnCode_t::RETCODE_OK && info.valid_data;
    }
    dds::DataReader* reader = nullptr;
  };

  template <class Sample>
  struct Writer {
    Writer(Context& context, const std::string& name, int depth) {
      auto* const topic = context.topic<Sample>(name);
      if (topic == nullptr) return;
      writer = context.participant->create_publisher(dds::PUBLISHER_QOS_DEFAULT)
                   ->create_datawriter(topic, qos_of<dds::DataWriterQos>(context.is_shared, depth));
    }
    [[nodiscard]] bool is_well() const { return writer != nullptr; }
    bool write(Sample sample) const { return writer->write(&sample); }
    dds::DataWriter* writer = nullptr;
  };
};

}  // namespace

const Peer kPeer = kTopicPeer<FastDds>;

}  // namespace rtpm::bench
