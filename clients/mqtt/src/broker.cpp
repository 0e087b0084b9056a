#include "broker.hpp"

#include <mosquitto.h>
#include <mqtt_protocol.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdlib>
#include <cstring>
#include <utility>

#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/host.hpp"

namespace rtpm::mqtt {
namespace {

using namespace std::chrono_literals;

constexpr Duration kRetryFirst = 20ms;
// Retry interval for a full connection, as the wait set only reports readability.
constexpr Duration kWriteInterval = 1ms;
constexpr Duration kMiscInterval = 250ms;
constexpr int kKeepAlive_s = 10;
constexpr const char* kIdName = "rtpm-bridge";
constexpr const char* kSchemaName = "rtpm-schema";
constexpr const char* kHopsName = "rtpm-hops";
constexpr transport::SourceTag kSocket{transport::SourceKind{1}};

/// Manages libmosquitto's global state.
struct Library {
  Library() { mosquitto_lib_init(); }
  Library(const Library&) = delete;
  Library& operator=(const Library&) = delete;
  ~Library() { mosquitto_lib_cleanup(); }
};

std::string hex_of(std::uint64_t value) {
  std::array<char, 16> text{};
  const auto end = std::to_chars(text.data(), text.data() + text.size(), value, 16).ptr;
  return {text.data(), end};
}

template <class T>
T number_of(const std::string& text, int base) {
  T value{};
  const auto read = std::from_chars(text.data(), text.data() + text.size(), value, base);
  return read.ec == std::errc{} ? value : T{};
}

// The value of a user property; empty if absent.
std::string property_of(const mosquitto_property* properties, std::string_view wanted) {
  const mosquitto_property* at = properties;
  bool is_next = false;
  while (at != nullptr) {
    char* name = nullptr;
    char* value = nullptr;
    at = mosquitto_property_read_string_pair(at, MQTT_PROP_USER_PROPERTY, &name, &value, is_next);
    if (at == nullptr) break;
    const bool is_it = name != nullptr && wanted == name;
    std::string text = is_it && value != nullptr ? value : "";
    std::free(name);
    std::free(value);
    if (is_it) return text;
    is_next = true;
  }
  return {};
}

}  // namespace

std::string make_id() {
  return "rtpm-" + hex_of(rt::random_u64());
}

class Broker::Callbacks {
 public:
  static void on_connect(mosquitto* client, void* self, int why, int /*flags*/,
                         const mosquitto_property* /*properties*/) {
    auto& broker = *static_cast<Broker*>(self);
    if (why != 0) return broker.set_reason(mosquitto_reason_string(why));
    broker.missing_count_ = broker.config_.subscriptions.size();
    for (const std::string& each : broker.config_.subscriptions) {
      // Excludes own and retained messages.
      mosquitto_subscribe_v5(client, nullptr, each.c_str(), 0,
                             MQTT_SUB_OPT_NO_LOCAL | MQTT_SUB_OPT_SEND_RETAIN_NEVER, nullptr);
    }
    if (broker.missing_count_ == 0) broker.note_connected();
  }
  static void on_subscribe(mosquitto* /*client*/, void* self, int /*message*/, int count,
                           const int* granted, const mosquitto_property* /*properties*/) {
    auto& broker = *static_cast<Broker*>(self);
    constexpr int kFirstError = 128;
    const bool is_refused =
        std::any_of(granted, granted + count, [](int each) { return each >= kFirstError; });
    if (is_refused) return broker.set_reason("the broker refuses a subscription");
    if (broker.missing_count_ > 0 && --broker.missing_count_ == 0) broker.note_connected();
  }
  static void on_disconnect(mosquitto* /*client*/, void* self, int why,
                            const mosquitto_property* /*properties*/) {
    auto& broker = *static_cast<Broker*>(self);
    broker.is_connected_ = false;
    broker.set_reason(mosquitto_strerror(why));
  }
  static void on_message(mosquitto* /*client*/, void* self, const mosquitto_message* its,
                         const mosquitto_property* properties) {
    auto& broker = *static_cast<Broker*>(self);
    {
      const std::lock_guard lock(broker.mutex_);
      ++broker.counters_.received_count;
    }
    Message message;
    message.topic = its->topic;
    const auto* const begin = static_cast<const std::byte*>(its->payload);
    if (its->payloadlen > 0) message.payload.assign(begin, begin + its->payloadlen);
    message.id = property_of(properties, kIdName);
    message.schema_id = number_of<std::uint64_t>(property_of(properties, kSchemaName), 16);
    message.hops = number_of<std::uint8_t>(property_of(properties, kHopsName), 10);
    broker.listener_.on_message(message);
  }
};

void Broker::Free::operator()(mosquitto* client) const noexcept {
  mosquitto_destroy(client);
}

Broker::Broker(BrokerConfig config, Listener& listener,
               std::unique_ptr<transport::WaitSet> wait_set)
    : config_(std::move(config)),
      listener_(listener),
      id_(config_.id.empty() ? make_id() : config_.id),
      wait_set_(std::move(wait_set)),
      queue_(std::max(config_.queue_capacity, 1U)) {}

expected<std::unique_ptr<Broker>, SetupError> Broker::create(BrokerConfig config,
                                                             Listener& listener) {
  auto wait_set = transport::WaitSet::open(1);
  if (!wait_set) return unexpected{std::move(wait_set.error())};
  std::unique_ptr<Broker> broker(new Broker(std::move(config), listener, std::move(*wait_set)));
  if (auto begun = broker->begin(); !begun) return unexpected{std::move(begun.error())};
  return broker;
}

expected<void, SetupError> Broker::begin() {
  static const Library kLibrary;
  client_.reset(mosquitto_new(id_.c_str(), /*clean_session=*/true, this));
  if (!client_) return setup_error("libmosquitto has no memory for a client");
  mosquitto* const client = client_.get();
  mosquitto_int_option(client, MOSQ_OPT_PROTOCOL_VERSION, MQTT_PROTOCOL_V5);
  mosquitto_int_option(client, MOSQ_OPT_TCP_NODELAY, 1);
  mosquitto_connect_v5_callback_set(client, &Callbacks::on_connect);
  mosquitto_disconnect_v5_callback_set(client, &Callbacks::on_disconnect);
  mosquitto_subscribe_v5_callback_set(client, &Callbacks::on_subscribe);
  mosquitto_message_v5_callback_set(client, &Callbacks::on_message);
  if (!config_.user.empty()) {
    mosquitto_username_pw_set(client, config_.user.c_str(), config_.password.c_str());
  }
  if (!config_.ca_file.empty()) {
    const int set =
        mosquitto_tls_set(client, config_.ca_file.c_str(), nullptr, nullptr, nullptr, nullptr);
    if (set != MOSQ_ERR_SUCCESS) {
      return setup_error("the certificates in '" + config_.ca_file + "' can't be used",
                         mosquitto_strerror(set));
    }
  }
  auto thread = rt::Thread::start({.name = "rtpm-mqtt", .realtime = rt::RealtimeMode::kOff},
                                  [this] { run(); });
  if (!thread) return unexpected{std::move(thread.error())};
  thread_ = std::move(*thread);
  return {};
}

Broker::~Broker() {
  is_stopping_ = true;
  wait_set_->ring();
  if (thread_.is_running()) thread_.join();
}

void Broker::publish(const std::string& topic, ConstBytes payload, std::uint64_t schema_id,
                     std::uint8_t hops) {
  {
    const std::lock_guard lock(mutex_);
    if (queue_size_ == queue_.size()) {
      queue_begin_ = (queue_begin_ + 1) % queue_.size();
      --queue_size_;
      ++counters_.overflow_count;
    }
    // ev-6.2-3. Slots reuse their memory.
    Message& place = queue_[(queue_begin_ + queue_size_++) % queue_.size()];
    place.topic = topic;
    place.payload.assign(payload.begin(), payload.end());
    place.schema_id = schema_id;
    place.hops = hops;
  }
  wait_set_->ring();
}

BrokerCounters Broker::counters() const {
  const std::lock_guard lock(mutex_);
  return counters_;
}

std::string Broker::reason() const {
  const std::lock_guard lock(mutex_);
  return reason_;
}

void Broker::note_connected() {
  {
    const std::lock_guard lock(mutex_);
    ++counters_.connection_count;
    reason_.clear();
  }
  is_connected_ = true;
}

void Broker::set_reason(std::string reason) {
  const std::lock_guard lock(mutex_);
  reason_ = std::move(reason);
}

void Broker::run() {
  std::array<transport::SourceTag, 4> tags{};
  Duration pause = kRetryFirst;
  while (!is_stopping_) {
    if (!connect()) {
      const MonotonicTime until = rt::now() + pause;
      while (!is_stopping_ && rt::now() < until)
        static_cast<void>(wait_set_->wait(until, tags));
      pause = std::min(2 * pause, config_.retry_max);
      continue;
    }
    talk();
    // The client library may have closed it.
    wait_set_->remove(socket_);
    const bool was_connected = is_connected_.exchange(false);
    pause = was_connected ? kRetryFirst : std::min(2 * pause, config_.retry_max);
    if (is_stopping_) break;
    static_cast<void>(wait_set_->wait(rt::now() + pause, tags));
  }
  mosquitto_disconnect(client_.get());
}

bool Broker::connect() {
  const int result = mosquitto_connect_bind_v5(client_.get(), config_.host.c_str(), config_.port,
                                               kKeepAlive_s, nullptr, nullptr);
  if (result != MOSQ_ERR_SUCCESS) {
    set_reason(result == MOSQ_ERR_ERRNO ? std::strerror(errno) : mosquitto_strerror(result));
    return false;
  }
  socket_ = mosquitto_socket(client_.get());
  return socket_ >= 0 && wait_set_->add(socket_, kSocket, transport::Trigger::kLevel);
}

// Runs until the connection ends.
void Broker::talk() {
  std::array<transport::SourceTag, 4> tags{};
  mosquitto* const client = client_.get();
  MonotonicTime next_misc{};
  while (!is_stopping_) {
    if (is_connected_) publish_waiting();
    const bool is_full = mosquitto_want_write(client);
    const MonotonicTime until = rt::now() + (is_full ? kWriteInterval : kMiscInterval);
    const std::size_t count = wait_set_->wait(until, tags);
    const bool can_read =
        std::find(tags.begin(), tags.begin() + count, kSocket) != tags.begin() + count;
    if (can_read && mosquitto_loop_read(client, 16) != MOSQ_ERR_SUCCESS) return;
    if (is_full && mosquitto_loop_write(client, 16) != MOSQ_ERR_SUCCESS) return;
    if (rt::now() < next_misc) continue;
    next_misc = rt::now() + kMiscInterval;
    if (mosquitto_loop_misc(client) != MOSQ_ERR_SUCCESS) return;
  }
}

// Sends while the connection accepts data immediately; other messages wait in the bounded queue
// here.
void Broker::publish_waiting() {
  Message message;
  while (!mosquitto_want_write(client_.get())) {
    {
      const std::lock_guard lock(mutex_);
      if (queue_size_ == 0) return;
      std::swap(message, queue_[queue_begin_]);
      queue_begin_ = (queue_begin_ + 1) % queue_.size();
      --queue_size_;
    }
    mosquitto_property* properties = nullptr;
    const auto add = [&](const char* name, const std::string& value) {
      mosquitto_property_add_string_pair(&properties, MQTT_PROP_USER_PROPERTY, name, value.c_str());
    };
    add(kIdName, id_);
    add(kSchemaName, hex_of(message.schema_id));
    add(kHopsName, std::to_string(message.hops));
    const int result = mosquitto_publish_v5(client_.get(), nullptr, message.topic.c_str(),
                                            static_cast<int>(message.payload.size()),
                                            message.payload.data(), 0, config_.retains, properties);
    mosquitto_property_free_all(&properties);
    const std::lock_guard lock(mutex_);
    ++(result == MOSQ_ERR_SUCCESS ? counters_.published_count : counters_.refused_count);
  }
}

}  // namespace rtpm::mqtt
