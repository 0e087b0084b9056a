#include "rtpm/gvd/stop_delivery.hpp"

#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "rtpm/gvd/client.hpp"
#include "rtpm/gvd/server.hpp"
#include "rtpm/gvd/system_stop.hpp"
#include "rtpm/names/directory.hpp"
#include "rtpm/names/servant.hpp"
#include "rtpm/rpc/server.hpp"
#include "scripted_driver.hpp"
#include "served_hub.hpp"

namespace rtpm::gvd {
namespace {

using namespace std::chrono_literals;
using events::test::await;
using events::test::ServedHub;

constexpr const char* kDevice = "rtpm.device.Device";

/// A server with one object, at an address where a test may serve again.
std::unique_ptr<rpc::Server> serve(rpc::Servant& servant, std::string_view path,
                                   std::uint16_t port = 0) {
  auto server = rpc::Server::create({.port = port, .realtime = rt::RealtimeMode::kOff});
  RTPM_ASSERT(server.has_value(), "a server is made");
  RTPM_ASSERT((*server)->add(path, servant).has_value() && (*server)->start().has_value(),
              "it serves");
  return std::move(*server);
}

class Arm {
 public:
  Arm() {
    DeviceServerConfig config;
    config.thread.realtime = rt::RealtimeMode::kOff;
    auto device = DeviceServer::create(std::make_unique<test::ScriptedDriver>(), std::move(config));
    RTPM_ASSERT(device.has_value() && (*device)->start().has_value(), "a device starts");
    device_ = std::move(*device);
    start();
  }
  void start(std::uint16_t port = 0) {
    server_ = serve(device_->servant(), "arm", port);
    port_ = server_->port();
  }
  /// Ends like a server that was killed.
  void end() { server_.reset(); }
  [[nodiscard]] std::uint16_t port() const noexcept { return port_; }
  [[nodiscard]] std::string url() const {
    return "rtpm://127.0.0.1:" + std::to_string(port_) + "/arm";
  }
  [[nodiscard]] bool is_stopped() {
    rpc::Node node;
    auto client = DeviceClient::open(node, url());
    if (!client) return false;
    const auto sample = client->read();
    return sample && sample->faults.has(driver::Fault::kEmergencyStop);
  }

 private:
  std::unique_ptr<DeviceServer> device_{};
  std::unique_ptr<rpc::Server> server_{};
  std::uint16_t port_ = 0;
};

/// A registry in which tests bind any names.
class Registry {
 public:
  Registry() : servant_(names::make_servant()), server_(serve(*servant_, names::kRegistryPath)) {}
  void bind(const std::string& name, const std::string& url, const std::string& interface = kDevice,
            Duration lease = 10s) {
    names::Claim claim{.name = name, .url = url, .interface = interface, .owner = {++owner_, 1}};
    claim.lease = lease;
    claim.allows_takeover = true;
    ASSERT_TRUE(names::Directory(node_, this->url()).rebind(claim));
  }
  void unbind(const std::string& name) {
    names::Directory directory(node_, url());
    const auto entry = directory.resolve(name);
    ASSERT_TRUE(entry);
    ASSERT_TRUE(directory.unbind(name, {1, 1}, entry->revision));
  }
  [[nodiscard]] std::string url() const {
    return "rtpm://127.0.0.1:" + std::to_string(server_->port()) + "/" +
           std::string(names::kRegistryPath);
  }

 private:
  rpc::Node node_{};
  std::uint64_t owner_ = 0;
  std::unique_ptr<rpc::Servant> servant_;
  std::unique_ptr<rpc::Server> server_;
};

/// An address that never answers, like a hanging process.
class Silence {
 public:
  explicit Silence(std::uint16_t port = 0) : socket_(::socket(AF_INET, SOCK_DGRAM, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    address.sin_port = htons(port);
    socklen_t size = sizeof address;
    auto* const generic = reinterpret_cast<sockaddr*>(&address);
    RTPM_ASSERT(::bind(socket_, generic, size) == 0, "an address is free");
    ::getsockname(socket_, generic, &size);
    port_ = ntohs(address.sin_port);
  }
  Silence(const Silence&) = delete;
  Silence& operator=(const Silence&) = delete;
  ~Silence() { ::close(socket_); }
  [[nodiscard]] std::string url(const std::string& path) const {
    return "rtpm://127.0.0.1:" + std::to_string(port_) + "/" + path;
  }

 private:
  int socket_;
  std::uint16_t port_ = 0;
};

class Stops : public testing::Test {
 protected:
  /// Delivers to both registries, given as a list of URLs.
  [[nodiscard]] StopDeliveryConfig both() const {
    return {.where = mine_.url() + "," + other_.url()};
  }
  [[nodiscard]] StopDeliveryConfig mine() const { return {.where = mine_.url()}; }

  rpc::Node node_{};
  Registry mine_{};
  Registry other_{};
  Arm arm_{};
  Arm second_{};
};

TEST_F(Stops, ReachEveryServerOfANameThatIsBoundTwice) {
  mine_.bind("lab/arm0", arm_.url());
  other_.bind("lab/arm0", second_.url());
  StopDelivery delivery(node_, both());
  const StopReport report = delivery.stop("lab/arm0");
  ASSERT_EQ(report.devices.size(), 2u);
  EXPECT_TRUE(report.is_complete());
  EXPECT_TRUE(arm_.is_stopped());
  EXPECT_TRUE(second_.is_stopped());
  EXPECT_TRUE(delivery.owed().empty());
}

TEST_F(Stops, ReachAnsweringServersBesideHungOnes) {
  const Silence hung;
  const Silence registry;
  mine_.bind("lab/arm0", arm_.url());
  mine_.bind("lab/hung", hung.url("arm"));
  mine_.bind("lab/not_a_device", second_.url(), "lab.Camera");
  other_.bind("lab/arm0", hung.url("other"));
  StopDeliveryConfig config = both();
  config.where += "," + registry.url("rtpm/names");
  StopDelivery delivery(node_, config);
  const StopReport report = delivery.stop();
  ASSERT_EQ(report.devices.size(), 3u);
  EXPECT_EQ(report.stopped_count(), 1u);
  EXPECT_TRUE(arm_.is_stopped());
  EXPECT_FALSE(second_.is_stopped());
  for (const StopResult& result : report.devices)
    EXPECT_EQ(result.is_stopped, result.target.url == arm_.url()) << result.target.url;
  EXPECT_EQ(delivery.owed().size(), 2u);
  ASSERT_EQ(report.notes.size(), 1u) << "the registry that hangs";
  EXPECT_NE(report.notes[0].find(registry.url("rtpm/names")), std::string::npos);
  EXPECT_FALSE(report.search_error);
}

TEST_F(Stops, GoThroughHubsToServersThatNoNameServiceHas) {
  class Devices final : public SystemStopDevices {
   public:
    bool obey(std::uint64_t id) noexcept override {
      if (obeyed_.exchange(id) == id) return false;
      ++stop_count;
      return true;
    }
    std::uint64_t obeyed() const noexcept override { return obeyed_; }
    std::atomic<int> stop_count{0};

   private:
    std::atomic<std::uint64_t> obeyed_{0};
  } devices;
  ServedHub hub;
  SystemStopConfig config{.hub = hub.url(), .retry = 10ms, .realtime = rt::RealtimeMode::kOff};
  const auto others = SystemStop::start(node_, &devices, config);
  ASSERT_TRUE(others);
  ASSERT_TRUE(await([&] { return (*others)->is_subscribed(); }));
  mine_.bind("rtpm/events", hub.url(), "rtpm.events.Hub");
  StopDelivery delivery(node_, mine());
  const StopReport report = delivery.stop();
  EXPECT_TRUE(report.devices.empty());
  EXPECT_EQ(report.told_hub_count, 1u);
  EXPECT_TRUE(await([&] { return devices.stop_count == 1; }));
}

TEST_F(Stops, StayPendingForADeviceWhoseNameExpiresUntilItIsBack) {
  mine_.bind("lab/arm0", arm_.url());
  StopDelivery delivery(node_, mine());
  delivery.remember({"lab/arm0", arm_.url()});
  arm_.end();
  mine_.unbind("lab/arm0");
  {
    const Silence hung(arm_.port());
    const StopReport report = delivery.stop();
    ASSERT_EQ(report.devices.size(), 1u) << "it was seen, and has no name any more";
    EXPECT_FALSE(report.devices[0].is_stopped);
    EXPECT_EQ(delivery.retry().stopped_count(), 0u);
  }
  EXPECT_EQ(delivery.retry().stopped_count(), 0u);
  ASSERT_EQ(delivery.owed().size(), 1u);
  arm_.start(arm_.port());
  EXPECT_EQ(delivery.retry().stopped_count(), 1u);
  EXPECT_TRUE(arm_.is_stopped());
  EXPECT_TRUE(delivery.owed().empty());
  EXPECT_TRUE(delivery.retry().devices.empty());
}

TEST_F(Stops, GoToServersThatAreLostToTheirRegistry) {
  mine_.bind("lab/arm0", arm_.url(), kDevice, 100ms);
  const Silence hung;
  mine_.bind("lab/hung", hung.url("arm"), kDevice, 100ms);
  ASSERT_TRUE(await([&] {
    const auto names = names::Directory(node_, mine_.url()).list();
    return names && names->empty();
  }));
  StopDelivery delivery(node_, mine());
  const StopReport report = delivery.stop();
  ASSERT_EQ(report.devices.size(), 2u) << "a tool that has never seen them";
  EXPECT_TRUE(report.devices[0].is_stopped);
  EXPECT_TRUE(arm_.is_stopped());
  EXPECT_FALSE(report.devices[1].is_stopped);
  EXPECT_EQ(report.devices[1].target.device, "lab/hung");
}

TEST_F(Stops, FollowADeviceThatComesBackElsewhere) {
  mine_.bind("lab/arm0", arm_.url());
  arm_.end();
  StopDelivery delivery(node_, mine());
  EXPECT_EQ(delivery.stop().stopped_count(), 0u);
  arm_.start();
  mine_.bind("lab/arm0", arm_.url());
  EXPECT_EQ(delivery.retry().stopped_count(), 1u);
  EXPECT_TRUE(arm_.is_stopped());
  EXPECT_TRUE(delivery.owed().empty()) << "nothing listens at the former address";
}

// Another server with the same name does not substitute for the one that hangs.
TEST_F(Stops, StayPendingForAHungServerEvenIfAnotherHasItsName) {
  const Silence hung;
  mine_.bind("lab/arm0", hung.url("arm"));
  StopDelivery delivery(node_, mine());
  EXPECT_EQ(delivery.stop("lab/arm0").stopped_count(), 0u);
  mine_.bind("lab/arm0", arm_.url());
  EXPECT_EQ(delivery.retry().stopped_count(), 1u);
  ASSERT_EQ(delivery.owed().size(), 1u);
  EXPECT_EQ(delivery.owed()[0].target.url, hung.url("arm"));
  EXPECT_EQ(delivery.retry().devices.size(), 1u) << "the one that was stopped may be rearmed";
  delivery.dismiss("lab/arm0");
  EXPECT_TRUE(delivery.owed().empty());
}

TEST_F(Stops, SayWhyNoNameServiceAnswers) {
  const Silence registry;
  StopDelivery delivery(node_, {.where = registry.url("rtpm/names")});
  const StopReport report = delivery.stop();
  EXPECT_TRUE(report.devices.empty());
  ASSERT_TRUE(report.search_error);
  EXPECT_NE(report.search_error->text().find(registry.url("rtpm/names")), std::string::npos);
}

TEST_F(Stops, NeedNoNameForAUrl) {
  StopDelivery delivery(node_, mine());
  const StopReport report = delivery.stop(arm_.url());
  ASSERT_EQ(report.devices.size(), 1u);
  EXPECT_TRUE(report.is_complete()) << report.devices[0].why;
  EXPECT_TRUE(arm_.is_stopped());
}

}  // namespace
}  // namespace rtpm::gvd
