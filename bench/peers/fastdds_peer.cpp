#include <fastdds/rtps/transport/shared_mem/SharedMemTransportDescriptor.h>
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <fastrtps/attributes/LibrarySettingsAttributes.h>
#include <fastrtps/xmlparser/XMLProfileManager.h>
#include <atomic>
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
#include <span>
#include <vector>

#include "topic_caller.hpp"

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

/// Of the first lane. The default domain, which other programs of the host may use, is left alone.
/// Each lane has a domain of its own: what participants of one process and domain tell each other
/// has a thread of high priority spin for a lock of a low one's.
constexpr std::uint32_t kDomain = 98;

/// A plain struct as it lies in memory, behind the header that every serialised sample has.
template <class Plain>
class PlainType final : public dds::TopicDataType {
 public:
  explicit PlainType(const char* name) {
    setName(name);
    m_typeSize = kHeaderSize + sizeof(Plain);
    m_isGetKeyDefined = false;
  }
  bool serialize(void* data, eprosima::fastrtps::rtps::SerializedPayload_t* payload) override {
    constexpr std::array<std::uint8_t, kHeaderSize> kLittleEndian{0, 1, 0, 0};
    std::memcpy(payload->data, kLittleEndian.data(), kHeaderSize);
    std::memcpy(payload->data + kHeaderSize, data, sizeof(Plain));
    payload->encapsulation = CDR_LE;
    payload->length = m_typeSize;
    return true;
  }
  bool deserialize(eprosima::fastrtps::rtps::SerializedPayload_t* payload, void* data) override {
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
    participant->register_type(message_type);
    participant->register_type(event_type);
    publisher = participant->create_publisher(dds::PUBLISHER_QOS_DEFAULT);
    subscriber = participant->create_subscriber(dds::SUBSCRIBER_QOS_DEFAULT);
  }

  bool is_shared;
  dds::TypeSupport message_type{new PlainType<PeerMessage>("PeerMessage")};
  dds::TypeSupport event_type{new PlainType<EventStamp>("EventStamp")};
  dds::DomainParticipant* participant = nullptr;
  dds::Publisher* publisher = nullptr;
  dds::Subscriber* subscriber = nullptr;
};

/// `depth`: of samples that are kept until they are taken.
template <class Qos>
void set_up(Qos& qos, bool is_shared, std::int32_t depth) {
  qos.reliability().kind = dds::RELIABLE_RELIABILITY_QOS;
  qos.history().kind = dds::KEEP_LAST_HISTORY_QOS;
  qos.history().depth = depth;
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
    set_up(reader_qos, of.is_shared, 1);
    dds::DataWriterQos writer_qos;
    set_up(writer_qos, of.is_shared, 1);
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

/// Events that a queue holds before it loses some, as of the other peers.
constexpr std::int32_t kQueuedMax = 1024;
constexpr const char* kEventTopic = "rtpm_bench_events";

/// A writer, and readers with a wait set and a thread each.
class FastddsSide final : public PeerEventSide {
 public:
  explicit FastddsSide(const PeerLane& lane) : supplier_(lane), consumers_(lane) {}
  ~FastddsSide() override {
    is_stopping_ = true;
    threads_.clear();
  }

  [[nodiscard]] expected<void, std::string> begin(int consumer_count, EventBoard& board) {
    if (supplier_.participant == nullptr || consumers_.participant == nullptr) {
      return unexpected{std::string("Fast DDS can't make its participants")};
    }
    dds::DataWriterQos writer_qos;
    set_up(writer_qos, supplier_.is_shared, kQueuedMax);
    writer_ = supplier_.publisher->create_datawriter(topic_of(supplier_), writer_qos);
    auto* const topic = topic_of(consumers_);
    dds::DataReaderQos reader_qos;
    set_up(reader_qos, consumers_.is_shared, kQueuedMax);
    for (int i = 0; i < consumer_count; ++i) {
      auto* const reader = consumers_.subscriber->create_datareader(topic, reader_qos);
      if (reader == nullptr || writer_ == nullptr) {
        return unexpected{std::string("Fast DDS can't make its topic")};
      }
      reader->get_statuscondition().set_enabled_statuses(dds::StatusMask::data_available());
      auto thread = start_consumer([this, reader, &board, number = static_cast<std::size_t>(i)] {
        consume(*reader, board, number);
      });
      if (!thread) return unexpected{thread.error()};
      threads_.push_back(std::move(*thread));
    }
    return {};
  }

  expected<void, std::string> push(const EventStamp& stamp) override {
    EventStamp event = stamp;
    if (!writer_->write(&event)) return unexpected{std::string("Fast DDS can't write")};
    return {};
  }

 private:
  [[nodiscard]] static dds::Topic* topic_of(const Participant& of) {
    return of.participant->create_topic(kEventTopic, "EventStamp", dds::TOPIC_QOS_DEFAULT);
  }
  void consume(dds::DataReader& reader, EventBoard& board, std::size_t number) {
    dds::WaitSet waiting;
    waiting.attach_condition(reader.get_statuscondition());
    EventStamp stamp;
    dds::SampleInfo info;
    while (!is_stopping_) {
      dds::ConditionSeq active;
      waiting.wait(active, to_dds(std::chrono::milliseconds{100}));
      while (reader.take_next_sample(&stamp, &info) == ReturnCode_t::RETCODE_OK) {
        if (info.valid_data) board.note(number, std::as_bytes(std::span(&stamp, 1)), rt::now());
      }
    }
  }

  Participant supplier_;
  Participant consumers_;
  dds::DataWriter* writer_ = nullptr;
  std::atomic<bool> is_stopping_{false};
  std::vector<rt::Thread> threads_{};
};

class FastddsPeer final : public BrokerlessPeer {
 public:
  expected<std::unique_ptr<EventSide>, std::string> connect_events(const PeerLane& lane,
                                                                   const std::string&,
                                                                   int consumer_count,
                                                                   EventBoard& board) override {
    eprosima::fastrtps::LibrarySettingsAttributes settings;
    settings.intraprocess_delivery = eprosima::fastrtps::INTRAPROCESS_OFF;
    eprosima::fastrtps::xmlparser::XMLProfileManager::library_settings(settings);
    auto side = std::make_unique<FastddsSide>(lane);
    if (auto begun = side->begin(consumer_count, board); !begun) return unexpected{begun.error()};
    return std::unique_ptr<EventSide>(std::move(side));
  }

  expected<void, std::string> serve(const PeerLane& lane,
                                    const Announce& publish_link_report) override {
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
    publish_link_report("by name");
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
