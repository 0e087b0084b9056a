#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <memory>
#include <string>
#include <thread>

#include "rtpm/configuration/client.hpp"
#include "rtpm/configuration/manager.hpp"
#include "rtpm/rpc/server.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/test/temporary_folder.hpp"
#include "samples.hpp"

// The manager's service and its client, connected by a real server.
namespace rtpm::gvd {
namespace {

using namespace std::chrono_literals;
using enum ConfigurationOutcome;

class ConfigurationService : public testing::Test {
 protected:
  ConfigurationService() {
    rpc::ServerConfig config;
    config.realtime = rt::RealtimeMode::kOff;
    server_ = *rpc::Server::create(config);
    auto manager = ConfigurationManager::create(device_, {.settings_folder = folder_});
    EXPECT_TRUE(manager) << manager.error().text();
    manager_ = std::move(*manager);
    EXPECT_TRUE(server_->add(configuration_path("arm"), manager_->servant()));
    EXPECT_TRUE(server_->start());
    ConfigurationClientOptions options;
    options.bind.deadline = 20s;
    options.call.deadline = 20s;
    auto client = ConfigurationClient::open(node_, server_->url("arm"), options);
    EXPECT_TRUE(client) << client.error().text();
    client_ = std::make_unique<ConfigurationClient>(std::move(*client));
  }
  ~ConfigurationService() override {
    server_->stop();
    manager_.reset();
  }

  test::TemporaryFolder temporary_;
  std::string folder_ = temporary_.path();
  test::SampleDevice device_{};
  std::unique_ptr<rpc::Server> server_;
  std::unique_ptr<ConfigurationManager> manager_;
  rpc::Node node_{};
  std::unique_ptr<ConfigurationClient> client_;
};

TEST_F(ConfigurationService, ListsEveryFactOfEveryParameter) {
  const auto listed = client_->list();
  ASSERT_TRUE(listed) << listed.error().words.text();
  EXPECT_EQ(listed->model, "test arm");
  EXPECT_EQ(listed->serial, "t-1");
  EXPECT_TRUE(listed->is_persistent);
  EXPECT_FALSE(listed->is_unsaved || listed->is_active);
  ASSERT_EQ(listed->parameters.size(), device_.specs.size());
  for (std::size_t i = 0; i < device_.specs.size(); ++i) {
    const driver::ParameterSpec& spec = device_.specs[i];
    const driver::ParameterSpec& read = listed->parameters[i].spec;
    EXPECT_EQ(read.name, spec.name);
    EXPECT_EQ(read.type, spec.type);
    EXPECT_EQ(read.unit, spec.unit);
    EXPECT_EQ(read.low, spec.low);
    EXPECT_EQ(read.high, spec.high);
    EXPECT_EQ(read.choices, spec.choices);
    EXPECT_EQ(read.vector_size, spec.vector_size);
    EXPECT_EQ(read.default_value, spec.default_value);
    EXPECT_EQ(read.description, spec.description);
    EXPECT_EQ(read.mutability, spec.mutability);
    EXPECT_EQ(listed->parameters[i].value, spec.default_value);
  }
}

TEST_F(ConfigurationService, AppliesReadsBackAndResets) {
  const std::uint64_t first = client_->list()->revision;
  const auto applied =
      client_->apply(first, {{"mode", std::string("fast")}, {"filter.taps", std::int64_t{3}}});
  ASSERT_TRUE(applied) << applied.error().words.text();
  EXPECT_NE(applied->revision, first);
  EXPECT_EQ(client_->get({"mode"})->settings[0].value, driver::ParameterValue(std::string("fast")));
  EXPECT_EQ(client_->get()->settings.size(), device_.specs.size());
  EXPECT_TRUE(client_->list()->is_unsaved);
  const auto reset = client_->reset(applied->revision, {"mode"});
  ASSERT_TRUE(reset);
  EXPECT_EQ(client_->get({"mode"})->settings[0].value, driver::ParameterValue(std::string("slow")));
}

TEST_F(ConfigurationService, RefusesWithTheParametersName) {
  const std::uint64_t revision = client_->list()->revision;
  const auto expect = [&](const driver::ParameterSetting& setting, ConfigurationOutcome outcome) {
    const auto applied = client_->apply(revision, {setting});
    ASSERT_FALSE(applied) << setting.name;
    EXPECT_EQ(applied.error().outcome, outcome) << to_string(applied.error().outcome);
    EXPECT_EQ(applied.error().parameter, setting.name);
    EXPECT_FALSE(applied.error().words.remedy.empty());
  };
  device_.active = true;
  expect({"no.such", 1.0}, kUnknownParameter);
  expect({"filter.taps", 1.0}, kWrongType);
  expect({"filter.taps", std::int64_t{17}}, kOutOfRange);
  expect({"firmware", std::string("2")}, kReadOnly);
  expect({"encoder.offset_m", std::vector<double>{0, 0, 0}}, kWrongState);
  EXPECT_EQ(client_->get({"no.such"}).error().outcome, kUnknownParameter);
  EXPECT_EQ(client_->apply(revision - 1, {{"filter.on", false}}).error().outcome, kStaleRevision);
  EXPECT_EQ(client_->list()->revision, revision);
}

TEST_F(ConfigurationService, LetsOneOfManyWritersWinEachRevision) {
  std::atomic<int> won{0};
  std::atomic<int> told{0};
  constexpr int kRounds = 20;
  const auto write = [&](std::int64_t taps) {
    for (int i = 0; i < kRounds; ++i) {
      const auto listed = client_->list();
      const auto applied =
          client_->apply(listed->revision, {{"filter.taps", 1 + (taps + 2 * i) % 16}});
      if (applied) {
        ++won;
      } else if (applied.error().outcome == kStaleRevision) {
        ++told;
      }
    }
  };
  const std::uint64_t before = client_->list()->revision;
  std::thread first(write, 0);
  std::thread second(write, 1);
  first.join();
  second.join();
  EXPECT_EQ(won + told, 2 * kRounds);
  EXPECT_LE(client_->list()->revision - before, static_cast<std::uint64_t>(won));
  EXPECT_GE(won.load(), kRounds);
}

TEST_F(ConfigurationService, FailsWithoutAServer) {
  server_->stop();
  const auto listed = client_->list();
  ASSERT_FALSE(listed);
  EXPECT_EQ(listed.error().outcome, kCallFailed);
  EXPECT_NE(listed.error().words.text(), "");
}

}  // namespace
}  // namespace rtpm::gvd
