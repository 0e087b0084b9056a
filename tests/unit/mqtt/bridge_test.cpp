#include "bridge.hpp"

#include <gtest/gtest.h>
#include <mosquitto.h>
#include <signal.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstring>
#include <fstream>
#include <mutex>
#include <optional>

#include "rtpm/test/free_port.hpp"
#include "rtpm/test/process.hpp"
#include "served_hub.hpp"

// The bridge between a hub and a broker, with the test's own mosquitto (ev-6).
namespace rtpm::mqtt {
namespace {

using rtpm::test::free_port;

using namespace std::chrono_literals;
using namespace rtpm::events;
using namespace rtpm::events::test;
using rtpm::test::Process;

constexpr const char* kBrokerProgram = "/usr/sbin/mosquitto";
constexpr const char* kOpensslProgram = "/usr/bin/openssl";

/// A client of the broker that writes down the messages it receives.
class Client final : public Broker::Listener {
 public:
  void start(std::uint16_t port, std::vector<std::string> subscriptions) {
    BrokerConfig config{.port = port};
    config.subscriptions = std::move(subscriptions);
    auto made = Broker::create(std::move(config), *this);
    ASSERT_TRUE(made) << made.error().text();
    broker = std::move(*made);
    ASSERT_TRUE(await([&] { return broker->is_connected(); })) << broker->reason();
  }
  void on_message(const Message& message) override {
    const std::lock_guard lock(mutex);
    messages.push_back(message);
  }
  [[nodiscard]] std::size_t count() {
    const std::lock_guard lock(mutex);
    return messages.size();
  }
  [[nodiscard]] Message at(std::size_t i) {
    const std::lock_guard lock(mutex);
    return messages.at(i);
  }

  std::mutex mutex;
  std::vector<Message> messages;
  std::unique_ptr<Broker> broker{};
};

class EventBridge : public testing::Test {
 protected:
  void SetUp() override {
    if (access(kBrokerProgram, X_OK) != 0) {
      GTEST_SKIP() << "needs the broker " << kBrokerProgram << " (Debian package mosquitto)";
    }
    port_ = free_port();
    start_broker();
  }
  void TearDown() override {
    for (const std::string& each : files_)
      unlink(each.c_str());
  }
  /// A file of this test, which is removed with it.
  [[nodiscard]] std::string file(const std::string& name) {
    return files_.emplace_back(testing::TempDir() + "rtpm-" + std::to_string(port_) + "-" + name);
  }
  void start_broker(const std::string& more = "") {
    const std::string configuration = file("mosquitto.conf");
    std::ofstream(configuration) << "listener " << port_ << " 127.0.0.1\nallow_anonymous true\n"
                                 << more;
    process_.emplace(std::vector<std::string>{kBrokerProgram, "-c", configuration});
  }
  /// Lets openssl create a key and a certificate for the host with that name or address.
  [[nodiscard]] bool make_certificate(const std::string& key, const std::string& certificate,
                                      const std::string& host) {
    Process program({kOpensslProgram, "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "1",
                     "-keyout", key, "-out", certificate, "-subj", "/CN=rtpm-test", "-addext",
                     "subjectAltName=" + host});
    const auto end = program.wait(kPatience);
    // Mosquitto reads the key as its own user.
    return end && end->exit_code == 0 && chmod(key.c_str(), 0644) == 0;
  }
  void stop_broker() {
    process_->send_signal(SIGKILL);
    EXPECT_TRUE(process_->wait(kPatience));
    process_.reset();
  }
  [[nodiscard]] std::unique_ptr<Bridge> make_bridge(const ServedHub& hub, BridgeConfig config = {},
                                                    std::uint32_t queue_capacity = 1024) {
    config.hub = hub.url();
    config.realtime = rt::RealtimeMode::kOff;
    config.deadline = kPatience;
    auto bridge = Bridge::create(
        node_, config,
        {.port = port_, .queue_capacity = queue_capacity, .retry_max = Duration{50ms}});
    EXPECT_TRUE(bridge) << bridge.error().text();
    if (!bridge) return nullptr;
    EXPECT_TRUE(await([&] { return (*bridge)->broker().is_connected(); }))
        << (*bridge)->broker().reason();
    return std::move(*bridge);
  }
  /// Publishes like a client that knows nothing of RTPM.
  void publish_plainly(const std::string& topic, const std::string& text) const {
    mosquitto* const client = mosquitto_new(nullptr, true, nullptr);
    ASSERT_EQ(mosquitto_connect(client, "127.0.0.1", port_, 10), MOSQ_ERR_SUCCESS);
    ASSERT_EQ(mosquitto_loop_start(client), MOSQ_ERR_SUCCESS);
    ASSERT_EQ(mosquitto_publish(client, nullptr, topic.c_str(), static_cast<int>(text.size()),
                                text.data(), 1, false),
              MOSQ_ERR_SUCCESS);
    ASSERT_TRUE(await([&] { return !mosquitto_want_write(client); }));
    mosquitto_disconnect(client);
    mosquitto_loop_stop(client, false);
    mosquitto_destroy(client);
  }

  std::uint16_t port_ = 0;
  std::vector<std::string> files_{};
  std::optional<Process> process_{};
  rpc::Node node_{};
  Recorder recorder_{};
};

TEST_F(EventBridge, PublishesEventsUnderTheirTopics) {
  ServedHub hub;
  Client client;
  client.start(port_, {"rtpm/#"});
  const auto bridge = make_bridge(hub, {.wanted = {{kPose, 3}, {kButton, std::nullopt}}});
  const auto supplier = make_supplier(node_, hub);
  push(*supplier, kPose, 2);
  push(*supplier, kPose, 3, {.x = 1.5});
  push(*supplier, kGaze);
  push(*supplier, kButton, 7);
  ASSERT_TRUE(await([&] { return client.count() >= 2; })) << bridge->report();
  EXPECT_EQ(client.at(0).topic, "rtpm/5/3");
  EXPECT_EQ(client.at(0).schema_id, kPoseSchema);
  EXPECT_EQ(client.at(0).hops, 1);
  EXPECT_EQ(client.at(0).id, bridge->broker().id());
  PosePayload pose;
  ASSERT_EQ(client.at(0).payload.size(), sizeof pose);
  std::memcpy(&pose, client.at(0).payload.data(), sizeof pose);
  EXPECT_EQ(pose.x, 1.5);
  EXPECT_EQ(client.at(1).topic, "rtpm/6/7");
  EXPECT_EQ(bridge->counters().to_broker_count, 2U) << "the others did not leave the hub";
}

// ev-6.1-1 and ev-6.1-2
TEST_F(EventBridge, TurnsMessagesIntoEvents) {
  ServedHub hub;
  const auto bridge = make_bridge(hub, {.mappings = {{"lab/temperature", {100, 3}}}});
  const auto consumer = make_consumer(node_, hub, recorder_, everything());
  publish_plainly("rtpm/5/2", "hello");
  ASSERT_TRUE(recorder_.await_deliveries(1)) << bridge->report();
  EXPECT_EQ(recorder_.text(), "5.2#1");
  EXPECT_TRUE(recorder_.await([](const Recorder& it) {
    return it.last_payload_.size() == 5 && it.last_header_.hops_left == 0;
  }));
  publish_plainly("rtpm/none/2", "hello");
  ASSERT_TRUE(await([&] { return bridge->counters().unknown_topic_count == 1; }));
  publish_plainly("lab/temperature", "21.5");
  ASSERT_TRUE(recorder_.await_deliveries(2));
  EXPECT_EQ(recorder_.text(), "5.2#1 100.3#1");
}

// ev-6.2-1
TEST_F(EventBridge, NeverReturnsItsOwnMessages) {
  ServedHub hub;
  Client client;
  client.start(port_, {"rtpm/#"});
  // Events from the broker have hops left, so that only the rule keeps them back.
  const auto bridge = make_bridge(hub, {.hops = 5});
  const auto consumer = make_consumer(node_, hub, recorder_, everything());
  const auto supplier = make_supplier(node_, hub);
  push(*supplier, kPose, 1);
  ASSERT_TRUE(recorder_.await_deliveries(1));
  ASSERT_TRUE(await([&] { return client.count() == 1; }));
  publish_plainly("rtpm/6/1", "from elsewhere");
  ASSERT_TRUE(recorder_.await_deliveries(2));
  ASSERT_TRUE(await([&] { return bridge->counters().own_count == 1; })) << bridge->report();
  push(*supplier, kGaze, 1);
  ASSERT_TRUE(await([&] { return client.count() == 3; }));
  EXPECT_EQ(client.at(1).topic, "rtpm/6/1") << "as it was published, and not again";
  EXPECT_EQ(client.at(2).topic, "rtpm/7/1");
  EXPECT_EQ(recorder_.text(), "5.1#1 6.1#1 7.1#1");
  EXPECT_EQ(bridge->counters().pushed_count, 1U);
}

// ev-6.2-2
TEST_F(EventBridge, JoinsTwoSitesByOneHop) {
  ServedHub here;
  ServedHub there;
  const auto near = make_bridge(here);
  const auto far = make_bridge(there);
  const auto consumer = make_consumer(node_, there, recorder_, everything());
  const auto supply = [&](std::uint8_t hops) {
    return Supplier::create(node_, here.url(), {.hops = hops, .deadline = kPatience}).value();
  };
  const auto stays = supply(0);
  const auto goes = supply(1);
  const auto goes_on = supply(2);
  push(*stays, kPose, 0);
  push(*goes, kPose, 1);
  push(*goes_on, kPose, 2);
  ASSERT_TRUE(recorder_.await_deliveries(2)) << near->report() << "\n" << far->report();
  EXPECT_EQ(recorder_.text(), "5.1#1 5.2#1");
  EXPECT_EQ(recorder_.last_header_.hops_left, 1);
  // The far bridge does not return its own events to the broker, although they have a hop left.
  ASSERT_TRUE(await([&] { return far->counters().own_count == 1; }));
  EXPECT_EQ(far->counters().to_broker_count, 0U);
  Client client;
  client.start(port_, {});
  client.broker->publish("rtpm/6/1", {}, 0, 0);
  ASSERT_TRUE(await([&] {
    return near->counters().hops_spent_count == 1 && far->counters().hops_spent_count == 1;
  }));
}

// ev-6.2-3
TEST_F(EventBridge, KeepsABoundedQueueUntilItReconnects) {
  ServedHub hub;
  const auto bridge = make_bridge(hub, {}, 10);
  const auto supplier = make_supplier(node_, hub);
  stop_broker();
  ASSERT_TRUE(await([&] { return !bridge->broker().is_connected(); }));
  for (int i = 0; i < 100; ++i)
    push(*supplier, kPose, 1);
  ASSERT_TRUE(await([&] { return bridge->counters().to_broker_count == 100; })) << bridge->report();
  EXPECT_EQ(bridge->broker().counters().overflow_count, 90U);
  EXPECT_FALSE(bridge->broker().reason().empty());
  start_broker();
  ASSERT_TRUE(await([&] { return bridge->broker().counters().published_count == 10; }));
  EXPECT_EQ(bridge->broker().counters().connection_count, 2U);
}

TEST_F(EventBridge, ContinuesAfterARestartOfTheHub) {
  ServedHub hub;
  Client client;
  client.start(port_, {"rtpm/#"});
  const auto bridge = make_bridge(hub, {.hops = 5});
  hub.stop();
  hub.start();
  const auto supplier = make_supplier(node_, hub);
  ASSERT_TRUE(await([&] {
    push(*supplier, kPose, 1);
    return client.count() > 0;
  })) << bridge->report();
  // The bridge recognizes its own events after the restart, too.
  ASSERT_TRUE(await([&] {
    publish_plainly("rtpm/6/1", "from elsewhere");
    return bridge->counters().own_count > 0;
  })) << bridge->report();
  const std::lock_guard lock(client.mutex);
  for (const Message& each : client.messages)
    EXPECT_TRUE(each.topic == "rtpm/5/1" || each.id.empty()) << each.topic;
}

TEST_F(EventBridge, ProgramReportsItsCounters) {
  ServedHub hub;
  Client client;
  client.start(port_, {"site/#"});
  Process program({RTPM_EVENT_BRIDGE, "--hub", hub.url(), "--port", std::to_string(port_),
                   "--prefix", "site", "--realtime", "off", "--direction", "to-broker", "--events",
                   "5"});
  ASSERT_TRUE(program.wait_for_output("connected to the broker\n", kPatience)) << program.errors();
  const auto supplier = make_supplier(node_, hub);
  push(*supplier, kButton);
  push(*supplier, kPose, 4);
  ASSERT_TRUE(await([&] { return client.count() == 1; }));
  EXPECT_EQ(client.at(0).topic, "site/5/4");
  program.send_signal(SIGTERM);
  const auto end = program.wait(kPatience);
  ASSERT_TRUE(end);
  EXPECT_EQ(end->exit_code, 0);
  rtpm::test::expect_text(end->output, {"to_broker 1 published 1 "});
}

class EventBridgeTls : public EventBridge {
 protected:
  void SetUp() override {
    EventBridge::SetUp();
    if (IsSkipped()) return;
    if (access(kOpensslProgram, X_OK) != 0) {
      GTEST_SKIP() << "needs " << kOpensslProgram << " (Debian package openssl)";
    }
    stop_broker();
  }
  /// Starts the broker with a certificate of its own for `host`.
  void start_secured(const std::string& host) {
    const std::string key = file("key.pem");
    certificate_ = file("certificate.pem");
    ASSERT_TRUE(make_certificate(key, certificate_, host));
    start_broker("certfile " + certificate_ + "\nkeyfile " + key + "\n");
  }
  [[nodiscard]] std::unique_ptr<Broker> connect(const std::string& ca_file) {
    auto broker =
        Broker::create({.port = port_, .ca_file = ca_file, .retry_max = Duration{50ms}}, ignored_);
    EXPECT_TRUE(broker) << broker.error().text();
    return broker ? std::move(*broker) : nullptr;
  }
  struct Ignorer final : Broker::Listener {
    void on_message(const Message&) override {}
  } ignored_{};
  std::string certificate_{};
};

TEST_F(EventBridgeTls, BridgesThroughAnEncryptedConnection) {
  start_secured("IP:127.0.0.1");
  ServedHub hub;
  Process program({RTPM_EVENT_BRIDGE, "--hub", hub.url(), "--port", std::to_string(port_),
                   "--ca-file", certificate_, "--realtime", "off"});
  ASSERT_TRUE(program.wait_for_output("connected to the broker\n", kPatience)) << program.errors();
  const auto consumer = make_consumer(node_, hub, recorder_, everything());
  const auto other = connect(certificate_);
  ASSERT_TRUE(await([&] { return other->is_connected(); })) << other->reason();
  // The event is larger than one TLS record.
  const std::vector<std::byte> large(40'000, std::byte{7});
  other->publish("rtpm/5/2", large, kPoseSchema, 2);
  ASSERT_TRUE(recorder_.await_deliveries(1)) << program.errors();
  EXPECT_EQ(recorder_.text(), "5.2#1");
  EXPECT_EQ(recorder_.last_payload_, large);
}

TEST_F(EventBridgeTls, RefusesABrokerThatItCannotTrust) {
  start_secured("IP:127.0.0.1");
  const std::string others_key = file("others-key.pem");
  const std::string others_certificate = file("others-certificate.pem");
  ASSERT_TRUE(make_certificate(others_key, others_certificate, "IP:127.0.0.1"));
  const auto trusting = connect(certificate_);
  ASSERT_TRUE(await([&] { return trusting->is_connected(); })) << trusting->reason();
  for (const std::string& wrong : {others_certificate, std::string()}) {
    const auto broker = connect(wrong);
    // Clients without trust or TLS have tried and failed.
    ASSERT_TRUE(await([&] { return broker->reason() != "it is being connected"; }));
    EXPECT_FALSE(broker->is_connected());
    EXPECT_EQ(broker->counters().connection_count, 0U);
  }
}

TEST_F(EventBridgeTls, RefusesACertificateOfAnotherHost) {
  start_secured("DNS:elsewhere.example");
  // Ensures that a refusal does not come from a broker that is still starting.
  ASSERT_TRUE(await([&] {
    mosquitto* const client = mosquitto_new(nullptr, true, nullptr);
    const int result = mosquitto_connect(client, "127.0.0.1", port_, 10);
    mosquitto_destroy(client);
    return result == MOSQ_ERR_SUCCESS;
  }));
  const auto broker = connect(certificate_);
  ASSERT_TRUE(await([&] { return broker->reason() != "it is being connected"; }));
  EXPECT_FALSE(broker->is_connected());
  EXPECT_EQ(broker->counters().connection_count, 0U);
}

TEST_F(EventBridgeTls, NamesAnUnusableCertificateFile) {
  const auto broker = Broker::create({.port = port_, .ca_file = "/nowhere/ca.pem"}, ignored_);
  ASSERT_FALSE(broker);
  rtpm::test::expect_text(broker.error().text(), {"/nowhere/ca.pem"});
}

TEST(EventBridgeProgram, NamesAnInvalidOption) {
  for (const auto& [flag, value] : std::initializer_list<std::pair<std::string, std::string>>{
           {"--events", "pose"}, {"--map", "lab=1"}, {"--prefix", "rtpm/#"}}) {
    Process program({RTPM_EVENT_BRIDGE, flag, value});
    const auto end = program.wait(kPatience);
    ASSERT_TRUE(end);
    EXPECT_EQ(end->exit_code, 2);
    EXPECT_NE(end->errors.find(flag), std::string::npos) << end->errors;
  }
}

}  // namespace
}  // namespace rtpm::mqtt
