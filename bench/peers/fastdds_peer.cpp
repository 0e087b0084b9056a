#include <fastdds/rtps/transport/shared_mem/SharedMemTransportDescriptor.h>
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
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
#include <vector>

#include "topic_caller.hpp"

// Fast DDS: a request and a reply topic for each caller, reliable, of which the last sample counts.
// Its documentation's chapters on real time and on shared memory: a bounded, plain type, memory
// preallocated, synchronous publication (the default), and one transport only: UDP, or shared
// memory with data sharing, by which readers take samples where the writer put them. Each lane has
// a participant of its own, whose threads have the lane's priority.
namespace rtpm::bench {
namespace {

namespace dds = eprosima::fastdds::dds;
namespace rtps = eprosima::fastdds::rtps;

/// Of the first lane. The default domain, which other programs of the host may use, is left alone.
/// Each lane has a domain of its own: what participants of one process and domain tell each other
/// has a thread of high priority spin for a lock of a low one's.
constexpr std::uint32_t kDomain = 98;

/// A PeerMessage as it lies in memory, behind the header that every serialised sample has.
class MessageType final : public dds::TopicDataType {
 public:
  MessageType() {
    setName("PeerMessage");
    m_typeSize = kHeaderSize + sizeof(PeerMessage);
    m_isGetKeyDefined = false;
  }
  bool serialize(void* data, eprosima::fastrtps::rtps::SerializedPayload_t* payload) override {
    constexpr std::array<std::uint8_t, kHeaderSize> kLittleEndian{0, 1, 0, 0};
    std::memcpy(payload->data, kLittleEndian.data(), kHeaderSize);
    std::memcpy(payload->data + kHeaderSize, data, sizeof(PeerMessage));
    payload->encapsulation = CDR_LE;
    payload->length = m_typeSize;
    return true;
  }
  bool deserialize(eprosima::fastrtps::rtps::SerializedPayload_t* payload, void* data) override {
    if (payload->length < m_typeSize) return false;
    std::memcpy(data, payload->data + kHeaderSize, sizeof(PeerMessage));
    return true;
  }
  std::function<std::uint32_t()> getSerializedSizeProvider(void*) override {
    return [size = m_typeSize] { return size; };
  }
  void* createData() override { return new PeerMessage; }
  void deleteData(void* data) override { delete static_cast<PeerMessage*>(data); }
  bool getKey(void*, eprosima::fastrtps::rtps::InstanceHandle_t*, bool) override { return false; }
  [[nodiscard]] bool is_bounded() const override { return true; }
  [[nodiscard]] bool is_plain() const override { return true; }

 private:
  static constexpr std::uint32_t kHeaderSize = 4;
};

/// A participant with what its topics need; it lives until the process ends.
struct Participant {
  explicit Participant(const PeerLane& lane) : is_shared(lane.transport == "shm") {
    dds::DomainParticipantQos qos;
    qos.transport().use_builtin_transports = false;
    if (is_shared) {
      qos.transport().user_transports.push_back(
          std::make_shared<rtps::SharedMemTransportDescriptor>());
    } else {
      auto udp = std::make_shared<rtps::UDPv4TransportDescriptor>();
      udp->interfaceWhiteList.emplace_back("127.0.0.1");
      qos.transport().user_transports.push_back(udp);
    }
    participant = dds::DomainParticipantFactory::get_instance()->create_participant(
        kDomain + static_cast<std::uint32_t>(lane.index), qos);
    if (participant == nullptr) return;
    participant->register_type(type);
    publisher = participant->create_publisher(dds::PUBLISHER_QOS_DEFAULT);
    subscriber = participant->create_subscriber(dds::SUBSCRIBER_QOS_DEFAULT);
  }

  bool is_shared;
  dds::TypeSupport type{new MessageType};
  dds::DomainParticipant* participant = nullptr;
  dds::Publisher* publisher = nullptr;
  dds::Subscriber* subscriber = nullptr;
};

template <class Qos>
void set_up(Qos& qos, bool is_shared) {
  qos.reliability().kind = dds::RELIABLE_RELIABILITY_QOS;
  qos.history().kind = dds::KEEP_LAST_HISTORY_QOS;
  qos.history().depth = 1;
  qos.endpoint().history_memory_policy = eprosima::fastrtps::rtps::PREALLOCATED_MEMORY_MODE;
  if (is_shared) {
    qos.data_sharing().automatic();
  } else {
    qos.data_sharing().off();
  }
}

/// One end of a caller's two topics.
struct End {
  End(const Participant& of, const std::string& reads, const std::string& writes) {
    auto* const in = of.participant->create_topic(reads, "PeerMessage", dds::TOPIC_QOS_DEFAULT);
    auto* const out = of.participant->create_topic(writes, "PeerMessage", dds::TOPIC_QOS_DEFAULT);
    if (in == nullptr || out == nullptr) return;
    dds::DataReaderQos reader_qos;
    set_up(reader_qos, of.is_shared);
    dds::DataWriterQos writer_qos;
    set_up(writer_qos, of.is_shared);
    reader = of.subscriber->create_datareader(in, reader_qos);
    writer = of.publisher->create_datawriter(out, writer_qos);
    if (reader != nullptr) {
      reader->get_statuscondition().set_enabled_statuses(dds::StatusMask::data_available());
    }
  }
  [[nodiscard]] bool is_well() const noexcept { return reader != nullptr && writer != nullptr; }
  [[nodiscard]] bool take(PeerMessage& message) const {
    dds::SampleInfo info;
    return reader->take_next_sample(&message, &info) == ReturnCode_t::RETCODE_OK && info.valid_data;
  }
  dds::DataReader* reader = nullptr;
  dds::DataWriter* writer = nullptr;
};

eprosima::fastrtps::Duration_t to_dds(Duration duration) {
  return {static_cast<std::int32_t>(duration.count() / 1'000'000'000),
          static_cast<std::uint32_t>(duration.count() % 1'000'000'000)};
}

class FastddsCaller final : public TopicCaller {
 public:
  explicit FastddsCaller(const End& end) : end_(end) {
    waiting_.attach_condition(end_.reader->get_statuscondition());
  }

 protected:
  expected<void, std::string> send(const PeerMessage& request) override {
    PeerMessage message = request;
    if (!end_.writer->write(&message)) return unexpected{std::string("Fast DDS can't write")};
    return {};
  }

  bool receive(PeerMessage& reply, Duration patience) override {
    const MonotonicTime give_up = rt::now() + patience;
    while (!end_.take(reply)) {
      if (rt::now() > give_up) return false;
      dds::ConditionSeq active;
      waiting_.wait(active, to_dds(patience));
    }
    return true;
  }

 private:
  End end_;
  dds::WaitSet waiting_{};
};

class FastddsPeer final : public Peer {
 public:
  expected<void, std::string> serve(const PeerLane& lane, const Announce& announce) override {
    const auto& participant = *new Participant(lane);
    if (participant.participant == nullptr) {
      return unexpected{std::string("Fast DDS can't make its participant")};
    }
    std::vector<End> ends;
    dds::WaitSet waiting;
    for (int caller = 0; caller < lane.connection_count; ++caller) {
      const End& end = ends.emplace_back(participant, topic_name(lane.index, caller, "request"),
                                         topic_name(lane.index, caller, "reply"));
      if (!end.is_well()) return unexpected{std::string("Fast DDS can't make its topics")};
      waiting.attach_condition(end.reader->get_statuscondition());
    }
    announce("by name");
    for (PeerMessage message;;) {
      dds::ConditionSeq active;
      waiting.wait(active, eprosima::fastrtps::c_TimeInfinite);
      for (const End& end : ends) {
        while (end.take(message)) {
          answer(message);
          end.writer->write(&message);
        }
      }
    }
  }

  expected<std::unique_ptr<Caller>, std::string> connect(const PeerLane& lane,
                                                         const std::string&) override {
    auto& participant = participants_[lane.index];
    if (!participant) participant = std::make_unique<Participant>(lane);
    if (participant->participant == nullptr) {
      return unexpected{std::string("Fast DDS can't make its participant")};
    }
    const int number = caller_counts_[lane.index]++;
    const End end(*participant, topic_name(lane.index, number, "reply"),
                  topic_name(lane.index, number, "request"));
    if (!end.is_well()) return unexpected{std::string("Fast DDS can't make its topics")};
    auto caller = std::make_unique<FastddsCaller>(end);
    if (auto found = caller->find_server(); !found) return unexpected{found.error()};
    return std::unique_ptr<Caller>(std::move(caller));
  }

 private:
  std::array<std::unique_ptr<Participant>, kPeerLaneCount> participants_{};
  std::array<int, kPeerLaneCount> caller_counts_{};
};

}  // namespace

std::unique_ptr<Peer> make_peer() {
  return std::make_unique<FastddsPeer>();
}

}  // namespace rtpm::bench
