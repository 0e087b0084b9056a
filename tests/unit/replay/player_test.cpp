#include "rtpm/replay/player.hpp"

#include <gtest/gtest.h>

#include <mutex>

#include "recorded_run.hpp"
#include "rtpm/events/consumer.hpp"
#include "rtpm/events/hub_server.hpp"
#include "rtpm/gvd/client.hpp"
#include "rtpm/rt/clock.hpp"

// A player and its clients in one process.
namespace rtpm::replay {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

class PlayerTest : public testing::Test {
 protected:
  void play(PlayerConfig config) {
    config.server.realtime = rt::RealtimeMode::kOff;
    auto player = Player::create(node_, recorded_, std::move(config));
    ASSERT_TRUE(player) << player.error().text();
    player_ = std::move(*player);
    ASSERT_TRUE(player_->start());
  }
  [[nodiscard]] gvd::DeviceClient open() {
    auto client = gvd::DeviceClient::open(node_, player_->served().at(0).url);
    RTPM_ASSERT(client.has_value(), "the device could not be opened");
    return std::move(*client);
  }
  static Recorded run(std::size_t count) {
    Recorded recorded;
    recorded.devices.push_back(lever(count));
    recorded.length = recorded.devices[0].times.back();
    return recorded;
  }

  rpc::Node node_{{.default_deadline = seconds{5}}};
  Recorded recorded_ = run(20);
  std::unique_ptr<Player> player_;
};

TEST_F(PlayerTest, DescribesADeviceAsItWasRecorded) {
  play({.end = End::kHold});
  const gvd::DeviceClient client = open();
  EXPECT_EQ(client.descriptor().model, "scripted");
  EXPECT_EQ(client.descriptor().limits.force_newton_max, 8);
  EXPECT_EQ(client.descriptor().rate_hz, 1000);
  EXPECT_EQ(client.operator_priority(), Priority{28000});
}

/// Its device's own server judges commands, so a few cases show that one stands there.
TEST_F(PlayerTest, RefusesCommandsAsTheDeviceWould) {
  play({.end = End::kHold});
  gvd::DeviceClient client = open();
  const auto outcome_of = [&](double newton) {
    const auto set = client.set_force({newton, 0, 0});
    return set ? gvd::DeviceOutcome::kDone : set.error();
  };
  EXPECT_EQ(outcome_of(1), gvd::DeviceOutcome::kNotHolder);
  ASSERT_TRUE(client.acquire());
  EXPECT_EQ(outcome_of(1), gvd::DeviceOutcome::kDone);
  EXPECT_EQ(outcome_of(std::nan("")), gvd::DeviceOutcome::kNotFinite);
  ASSERT_TRUE(client.emergency_stop());
  EXPECT_EQ(outcome_of(1), gvd::DeviceOutcome::kEmergencyStop);
  EXPECT_EQ(client.emergency_stop(gvd::StopScope::kSystem).error(),
            gvd::DeviceOutcome::kNotInSystem);
  EXPECT_EQ(player_->status().refused_count, 3u);
}

TEST_F(PlayerTest, TakesNoCommandWhileTheRecordedDeviceWasNotActive) {
  driver::Sample inactive = gvd::from_wire(recorded_.devices[0].samples.back());
  inactive.lifecycle = driver::Lifecycle::kInactive;
  recorded_.devices[0].samples.back() = gvd::to_wire(inactive);
  play({.speed = 1000, .end = End::kHold});
  gvd::DeviceClient client = open();
  EXPECT_TRUE(await([&] {
    if (!client.acquire()) return false;
    const auto set = client.set_force({1, 0, 0});
    return !set && set.error() == gvd::DeviceOutcome::kNotActive;
  }));
}

TEST_F(PlayerTest, EndsTheLeaseOfADeviceThatIsGone) {
  play({.is_stepped = true, .farewell = seconds{20}});
  gvd::DeviceClient client = open();
  ASSERT_TRUE(client.acquire());
  for (int i = 0; i < 21; ++i)
    ASSERT_TRUE(client.read());
  EXPECT_TRUE(await([&] { return *client.lease_state() == gvd::LeaseState::kDeviceLost; }));
}

TEST_F(PlayerTest, EndsWithItsDevicesGone) {
  play({.speed = 10, .farewell = seconds{20}});
  gvd::DeviceClient client = open();
  EXPECT_TRUE(await([&] {
    const auto sample = client.read();
    return sample && sample->lifecycle == driver::Lifecycle::kFault &&
           sample->faults.has(driver::Fault::kDeviceGone);
  }));
  EXPECT_EQ(client.read()->sequence, 119u);
}

TEST_F(PlayerTest, RefusesAnInvalidSpeed) {
  for (const double speed : {0.0, -1.0, 1e9, std::nan("")}) {
    const auto player = Player::create(node_, recorded_, {.speed = speed});
    ASSERT_FALSE(player);
    EXPECT_NE(player.error().text().find("0.001 to 1000"), std::string::npos);
  }
}

class Heard final : public events::EventHandler {
 public:
  void on_events(std::span<const events::EventView> events) override {
    const std::lock_guard lock(mutex_);
    for (const events::EventView& event : events) {
      headers_.push_back(event.header);
      payloads_.push_back(recording::text_of(event.payload));
    }
  }
  [[nodiscard]] std::size_t count() {
    const std::lock_guard lock(mutex_);
    return headers_.size();
  }
  std::vector<events::EventHeader> headers_{};
  std::vector<std::string> payloads_{};

 private:
  std::mutex mutex_{};
};

TEST_F(PlayerTest, PushesTheEventsWithTheirTypeSourceAndBytes) {
  recorded_.sources = {{.topic = "lab/lever/sampled",
                        .type_name = "rtpm.device.Sampled",
                        .type = gvd::kSampled,
                        .source = gvd::source_of("lab/lever"),
                        .schema_id = device::SampledEvent::kSchemaId,
                        .priority = 12000,
                        .device = "lab/lever"},
                       {.topic = "lab.Other/7", .type = 77, .source = 7, .priority = 500}};
  for (std::size_t i = 0; i < 20; ++i) {
    const auto bytes = rpc::struct_bytes(recorded_.devices[0].samples[i]);
    recorded_.events.push_back({0, milliseconds{i}, recorded_.payloads.size(), bytes.size()});
    recorded_.payloads.insert(recorded_.payloads.end(), bytes.begin(), bytes.end());
  }
  recorded_.events.push_back({1, milliseconds{19}, 0, 5});

  rpc::ServerConfig server;
  server.realtime = rt::RealtimeMode::kOff;
  auto served = events::HubServer::create(node_, {.server = server, .name = ""});
  ASSERT_TRUE(served) << served.error().text();
  Heard heard;
  auto consumer = events::Consumer::create(
      node_, (*served)->url(),
      {.name = "test", .filter = events::everything(), .realtime = rt::RealtimeMode::kOff}, heard);
  ASSERT_TRUE(consumer) << consumer.error().text();
  play({.hub = (*served)->url(), .end = End::kHold});
  EXPECT_EQ(player_->unknown_types(), std::vector<std::string>{"77"});
  ASSERT_TRUE(await([&] { return heard.count() >= 21; }));
  consumer->reset();
  std::size_t next = 0;
  for (std::size_t i = 0; i < heard.headers_.size(); ++i) {
    const events::EventHeader& header = heard.headers_[i];
    if (header.type == 77) {
      EXPECT_EQ(header.source, 7u);
      EXPECT_EQ(heard.payloads_[i].size(), 5u);
      EXPECT_EQ(header.priority, Priority{500});
      continue;
    }
    EXPECT_EQ(header.source, gvd::source_of("lab/lever"));
    EXPECT_EQ(header.priority, Priority{12000});
    ASSERT_LT(next, 20u);
    EXPECT_EQ(heard.payloads_[i], bytes_of(recorded_.devices[0].samples[next])) << next;
    ++next;
  }
  EXPECT_EQ(next, 20u);
}

}  // namespace
}  // namespace rtpm::replay
