#include "rtpm/gvd/holder.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <device.rtpm.hpp>
#include <holder.rtpm.hpp>
#include <memory>
#include <string>

#include "rtpm/device_sim/sim_driver.hpp"
#include "rtpm/gvd/client.hpp"
#include "rtpm/gvd/server.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rpc/server.hpp"

/// The name of a lease's holder, over the loopback network.
namespace rtpm::gvd {
namespace {

using std::chrono::seconds;

class Holder : public ::testing::Test {
 protected:
  void SetUp() override {
    auto driver = device_sim::SimDriver::create({});
    ASSERT_TRUE(driver);
    DeviceServerConfig config;
    config.thread.realtime = rt::RealtimeMode::kOff;
    // On a loaded machine, too.
    config.cycle.lease.silence_max = seconds{60};
    auto device = DeviceServer::create(std::move(*driver), std::move(config));
    ASSERT_TRUE(device);
    device_ = std::move(*device);
    auto server = rpc::Server::create(
        {.lanes = {{.name = "low"}, {.name = "high", .low = 16384, .priority = 16384}},
         .realtime = rt::RealtimeMode::kOff});
    ASSERT_TRUE(server);
    server_ = std::move(*server);
    ASSERT_TRUE(server_->add("lab/arm0", device_->servant()));
    ASSERT_TRUE(server_->add(holder_path("lab/arm0"), device_->holder_servant()));
    ASSERT_TRUE(device_->start());
    ASSERT_TRUE(server_->start());
    url_ = server_->url("lab/arm0");
    auto stub = device::LeaseHolderClient::bind(node_, holder_path(url_));
    ASSERT_TRUE(stub) << stub.error().text();
    stub_ = std::make_unique<device::LeaseHolderClient>(std::move(*stub));
  }
  DeviceClient open() {
    auto client = DeviceClient::open(node_, url_);
    RTPM_ASSERT(client.has_value(), "the device could not be opened");
    return std::move(*client);
  }
  /// The holder's name; "-" if the lease is free.
  std::string name() {
    const auto reply = stub_->holder();
    if (!reply) return std::string(to_string(reply.error()));
    return (*reply)->is_held() ? (*reply)->name()->str() : "-";
  }
  device::OutcomeCode introduce(std::uint64_t lease, const std::string& name) {
    device::IntroduceRequestT request;
    request.lease = lease;
    request.name = name;
    const auto reply = stub_->introduce(request);
    return reply ? reply->code() : device::OutcomeCode::TooMany;
  }

  std::unique_ptr<DeviceServer> device_;
  std::unique_ptr<rpc::Server> server_;
  std::string url_;
  rpc::Node node_{{.default_deadline = seconds{5}}};
  std::unique_ptr<device::LeaseHolderClient> stub_;
};

TEST_F(Holder, IsTheProgramAndHostOfTheClient) {
  EXPECT_EQ(own_holder_name().rfind("gvd_test on ", 0), 0u) << own_holder_name();
  EXPECT_EQ(name(), "-");
  DeviceClient client = open();
  ASSERT_TRUE(client.acquire(seconds{10}));
  EXPECT_EQ(name(), own_holder_name());
  ASSERT_TRUE(client.release());
  EXPECT_EQ(name(), "-");
}

TEST_F(Holder, HasNoNameOfTheFormerOne) {
  DeviceClient client = open();
  ASSERT_TRUE(client.acquire(seconds{10}));
  auto stub = device::DeviceClient::bind(node_, url_);
  ASSERT_TRUE(stub);
  rpc::CallOptions options;
  options.priority = client.operator_priority();
  const auto lease = stub->take_over({}, options);
  ASSERT_TRUE(lease);
  EXPECT_EQ(name(), "") << "it has not introduced itself";
  EXPECT_EQ(introduce(lease->id(), "Anna"), device::OutcomeCode::Done);
  EXPECT_EQ(name(), "Anna");
  // Without the lease nobody is named.
  EXPECT_EQ(introduce(lease->id() + 1, "Eve"), device::OutcomeCode::NotHolder);
  EXPECT_EQ(introduce(0, "Eve"), device::OutcomeCode::NotHolder);
  EXPECT_EQ(name(), "Anna");
}

TEST_F(Holder, HasAPrintableNameOfLimitedLength) {
  auto stub = device::DeviceClient::bind(node_, url_);
  ASSERT_TRUE(stub);
  const auto lease = stub->acquire();
  ASSERT_TRUE(lease);
  ASSERT_EQ(introduce(lease->id(), "a\n\x1b[2J" + std::string(5000, 'x')),
            device::OutcomeCode::Done);
  EXPECT_EQ(name().rfind("a\\n\\x1b[2Jxxx", 0), 0u) << name();
  EXPECT_LE(name().size(), kHolderNameSizeMax + 16);
}

TEST_F(Holder, IsNotMissedByAClientOfAnOlderServer) {
  auto server = rpc::Server::create({.realtime = rt::RealtimeMode::kOff});
  ASSERT_TRUE(server);
  ASSERT_TRUE((*server)->add("lab/old", device_->servant()));
  ASSERT_TRUE((*server)->start());
  auto client = DeviceClient::open(node_, (*server)->url("lab/old"));
  ASSERT_TRUE(client);
  EXPECT_TRUE(client->acquire(seconds{10}));
  EXPECT_EQ(name(), "");
}

}  // namespace
}  // namespace rtpm::gvd
