#include "cyclone/participant.hpp"

#include <dds/dds.h>

#include <chrono>
#include <cstdlib>
#include <cstring>
#include <string_view>
#include <utility>

#include "cyclone/opaque_type.hpp"
#include "rtpm/ros2/message.hpp"
#include "rtpm/ros2/messages.hpp"
#include "rtpm/ros2/names.hpp"

// Replaces the library's own function. Cyclone DDS 0.10.2 reads the answers that other participants
// give each other about their types, and crashes at some of those of Fast DDS. RTPM's topics have no
// type information, so that no answer is of use here.
extern "C" void ddsi_tl_handle_reply(struct ddsi_domaingv* /*domain*/,
                                     struct ddsi_serdata* /*reply*/) {}

namespace rtpm::ros2 {
namespace {

/// How long a write waits for a slow reliable subscriber.
constexpr dds_duration_t kBlockMax = DDS_MSECS(10);
constexpr std::size_t kTakeMax = 16;

SetupError dds_error(std::string what, dds_return_t result) {
  return {std::move(what), dds_strretcode(-result), {}};
}

struct QosFree {
  void operator()(dds_qos_t* qos) const noexcept { dds_delete_qos(qos); }
};
using Qos = std::unique_ptr<dds_qos_t, QosFree>;

Qos make_qos() {
  return Qos(dds_create_qos());
}

void set_user_data(dds_qos_t* qos, const std::string& text) {
  dds_qset_userdata(qos, text.data(), text.size());
}

Qos qos_of(const Topic& topic, const Quality& quality) {
  Qos qos = make_qos();
  dds_qset_reliability(qos.get(),
                       quality.reliability == Reliability::kReliable ? DDS_RELIABILITY_RELIABLE
                                                                     : DDS_RELIABILITY_BEST_EFFORT,
                       kBlockMax);
  dds_qset_durability(
      qos.get(), quality.is_latched ? DDS_DURABILITY_TRANSIENT_LOCAL : DDS_DURABILITY_VOLATILE);
  dds_qset_history(qos.get(), DDS_HISTORY_KEEP_LAST, quality.depth);
  // Late subscribers get as many messages as are kept.
  dds_qset_durability_service(qos.get(), 0, DDS_HISTORY_KEEP_LAST, quality.depth,
                              DDS_LENGTH_UNLIMITED, DDS_LENGTH_UNLIMITED, DDS_LENGTH_UNLIMITED);
  dds_qset_writer_data_lifecycle(qos.get(), false);
  if (!topic.hash.empty()) set_user_data(qos.get(), "typehash=" + topic.hash + ";");
  return qos;
}

/// Cyclone DDS's configuration for the domain, to which CYCLONEDDS_URI adds.
std::string configuration_of(const Domain& domain) {
  // Without key hashes Fast DDS 3.2 misses the end of endpoints.
  std::string text = "<Internal><GenerateKeyhash>true</GenerateKeyhash></Internal>";
  if (domain.range == DiscoveryRange::kLocalhost) {
    text +=
        "<General><Interfaces><NetworkInterface address=\"127.0.0.1\"/></Interfaces>"
        "<AllowMulticast>false</AllowMulticast></General>"
        "<Discovery><ParticipantIndex>auto</ParticipantIndex>"
        "<MaxAutoParticipantIndex>32</MaxAutoParticipantIndex>"
        "<Peers><Peer address=\"127.0.0.1\"/></Peers></Discovery>";
  }
  const char* const uri = std::getenv("CYCLONEDDS_URI");
  return uri == nullptr || *uri == '\0' ? text : text + "," + uri;
}

std::array<std::uint8_t, 16> guid_of(dds_entity_t entity) {
  dds_guid_t guid{};
  std::array<std::uint8_t, 16> bytes{};
  if (dds_get_guid(entity, &guid) == DDS_RETCODE_OK)
    std::memcpy(bytes.data(), guid.v, bytes.size());
  return bytes;
}

}  // namespace

// ---- Publisher and Subscription -----------------------------------------------------------------

Publisher::~Publisher() {
  participant_.remove_writer(writer_);
}

bool Publisher::publish(ConstBytes cdr) {
  return dds_writecdr(writer_, make_opaque_sample(type_, cdr)) == DDS_RETCODE_OK;
}

Subscription::~Subscription() {
  participant_.remove_reader(reader_);
}

std::uint64_t Subscription::lost_count() const {
  dds_sample_lost_status_t status{};
  static_cast<void>(dds_get_sample_lost_status(reader_, &status));
  return status.total_count;
}

// ---- Participant --------------------------------------------------------------------------------

expected<std::unique_ptr<Participant>, SetupError> Participant::create(const Domain& domain,
                                                                       std::string node) {
  std::unique_ptr<Participant> made(new Participant(std::move(node)));
  if (auto joined = made->join(domain); !joined) return unexpected{std::move(joined.error())};
  return made;
}

expected<void, SetupError> Participant::join(const Domain& domain) {
  const std::string what = "the ROS 2 domain " + std::to_string(domain.id) + " can't be joined";
  domain_ = dds_create_domain(domain.id, configuration_of(domain).c_str());
  if (domain_ < 0) return unexpected{dds_error(what, domain_)};
  const Qos qos = make_qos();
  set_user_data(qos.get(), "enclave=/;");
  participant_ = dds_create_participant(domain.id, qos.get(), nullptr);
  if (participant_ < 0) return unexpected{dds_error(what, participant_)};
  wait_set_ = dds_create_waitset(participant_);
  if (wait_set_ < 0) return unexpected{dds_error(what, wait_set_)};
  static_cast<void>(dds_waitset_attach(wait_set_, wait_set_, 0));
  const Topic graph{"ros_discovery_info", std::string(ParticipantEntitiesInfo::kType),
                    type_hash<ParticipantEntitiesInfo>()};
  const auto writer = add(graph.name, graph, {.is_latched = true, .depth = 1}, 0, true);
  if (!writer) return unexpected{writer.error()};
  graph_ = std::make_unique<Publisher>(*this, writer->entity, writer->type);
  publish_graph();
  auto thread = rt::Thread::start({.name = "rtpm-ros2-in"}, [this] { run(); });
  if (!thread) return unexpected{std::move(thread.error())};
  thread_ = std::move(*thread);
  return {};
}

Participant::~Participant() {
  is_stopping_ = true;
  if (wait_set_ > 0) static_cast<void>(dds_waitset_set_trigger(wait_set_, true));
  thread_.join();
  graph_.reset();
  if (domain_ > 0) static_cast<void>(dds_delete(domain_));
}

expected<Participant::Endpoint, SetupError> Participant::add(const std::string& dds_name,
                                                             const Topic& topic,
                                                             const Quality& quality,
                                                             std::uint32_t size_max,
                                                             bool is_writer) {
  const std::string what =
      topic.name + (is_writer ? " can't be published" : " can't be subscribed");
  ddsi_sertype* type = make_opaque_type(dds_type(topic.type), size_max);
  const dds_entity_t dds_topic =
      dds_create_topic_sertype(participant_, dds_name.c_str(), &type, nullptr, nullptr, nullptr);
  if (dds_topic < 0) {
    ddsi_sertype_unref(type);
    return unexpected{dds_error(what, dds_topic)};
  }
  const Qos qos = qos_of(topic, quality);
  const dds_entity_t entity = is_writer
                                  ? dds_create_writer(participant_, dds_topic, qos.get(), nullptr)
                                  : dds_create_reader(participant_, dds_topic, qos.get(), nullptr);
  // The endpoint keeps the topic.
  static_cast<void>(dds_delete(dds_topic));
  if (entity < 0) return unexpected{dds_error(what, entity)};
  return Endpoint{entity, type};
}

expected<std::unique_ptr<Publisher>, SetupError> Participant::publish(const Topic& topic,
                                                                      const Quality& quality) {
  const auto writer = add("rt" + topic.name, topic, quality, 0, true);
  if (!writer) return unexpected{writer.error()};
  {
    const std::lock_guard lock(graph_mutex_);
    writers_[writer->entity] = guid_of(writer->entity);
  }
  publish_graph();
  return std::make_unique<Publisher>(*this, writer->entity, writer->type);
}

expected<std::unique_ptr<Subscription>, SetupError> Participant::subscribe(
    const Topic& topic, const Quality& quality, std::uint32_t size_max, ReceivedHandler handler) {
  const auto reader = add("rt" + topic.name, topic, quality, size_max, false);
  if (!reader) return unexpected{reader.error()};
  // Ready as long as messages wait, unlike the status of the reader.
  const dds_entity_t has_data = dds_create_readcondition(reader->entity, DDS_ANY_STATE);
  if (has_data < 0) {
    static_cast<void>(dds_delete(reader->entity));
    return unexpected{dds_error(topic.name + " can't be subscribed", has_data)};
  }
  {
    const std::lock_guard lock(handler_mutex_);
    handlers_[reader->entity] = std::move(handler);
  }
  static_cast<void>(dds_waitset_attach(wait_set_, has_data, reader->entity));
  {
    const std::lock_guard lock(graph_mutex_);
    readers_[reader->entity] = guid_of(reader->entity);
  }
  publish_graph();
  return std::make_unique<Subscription>(*this, reader->entity);
}

void Participant::remove_writer(std::int32_t writer) {
  static_cast<void>(dds_delete(writer));
  {
    const std::lock_guard lock(graph_mutex_);
    if (writers_.erase(writer) == 0) return;  // That of the graph itself.
  }
  publish_graph();
}

void Participant::remove_reader(std::int32_t reader) {
  {
    const std::lock_guard lock(handler_mutex_);
    handlers_.erase(reader);
    static_cast<void>(dds_delete(reader));
  }
  {
    const std::lock_guard lock(graph_mutex_);
    readers_.erase(reader);
  }
  publish_graph();
}

// ROS 2 learns from this which node an endpoint belongs to.
void Participant::publish_graph() {
  const std::lock_guard lock(graph_mutex_);
  NodeEntitiesInfo node{.node_namespace = {"/"}, .node_name = {node_}};
  for (const auto& [entity, guid] : readers_)
    node.reader_gid_seq.push_back({guid});
  for (const auto& [entity, guid] : writers_)
    node.writer_gid_seq.push_back({guid});
  std::vector<std::byte> bytes;
  encode(ParticipantEntitiesInfo{.gid = {guid_of(participant_)},
                                 .node_entities_info_seq = {std::move(node)}},
         bytes);
  static_cast<void>(graph_->publish(bytes));
}

void Participant::run() {
  std::array<dds_attach_t, kTakeMax> ready{};
  while (!is_stopping_) {
    const dds_return_t count = dds_waitset_wait(wait_set_, ready.data(), ready.size(), DDS_SECS(1));
    for (dds_return_t i = 0; i < count && std::cmp_less(i, ready.size()); ++i) {
      const auto reader = static_cast<std::int32_t>(ready[static_cast<std::size_t>(i)]);
      const std::lock_guard lock(handler_mutex_);
      const auto found = handlers_.find(reader);
      if (found != handlers_.end()) receive(reader, found->second);
    }
  }
}

void Participant::receive(std::int32_t reader, const ReceivedHandler& handler) {
  std::array<ddsi_serdata*, kTakeMax> samples{};
  std::array<dds_sample_info_t, kTakeMax> infos{};
  // Beyond one batch the reader stays ready, so that no topic holds up the others.
  const dds_return_t count =
      dds_takecdr(reader, samples.data(), kTakeMax, infos.data(), DDS_ANY_STATE);
  for (dds_return_t i = 0; i < count; ++i) {
    const auto at = static_cast<std::size_t>(i);
    if (infos[at].valid_data)
      handler({.cdr = cdr_of(samples[at]), .source_time_ns = infos[at].source_timestamp});
    ddsi_serdata_unref(samples[at]);
  }
}

}  // namespace rtpm::ros2
