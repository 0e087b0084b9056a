#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>
#include <optional>
#include <string>

#include "etcd_node.hpp"
#include "fixture.hpp"
#include "rtpm/test/os.hpp"

// A console beside two registries that share their names in etcd.
namespace rtpm::system_test {
namespace {

class SharedRegistries : public ConsoleSystem {
 protected:
  void SetUp() override {
    if (storage_test::EtcdNode::shared() == nullptr) GTEST_SKIP() << storage_test::kNoEtcd;
    ConsoleSystem::SetUp();
  }
  bool start_registry() override {
    const std::string store = storage_test::EtcdNode::shared()->fresh_url();
    for (std::optional<Daemon>* const one : {&registry_, &second_}) {
      *one = start_daemon("rtpm-registryd",
                          {"--port", "0", "--realtime", realtime_, "--store", store});
      if (!*one) return false;
    }
    registry_->url += "," + second_->url;
    return true;
  }
  std::optional<Daemon> second_{};
};

TEST_F(SharedRegistries, LetADeviceEndInOrder) {
  const auto client = connect_to_arm();
  devices_->process.send_signal(SIGTERM);
  ASSERT_TRUE(devices_->process.wait(kPatience));
  const Json state =
      client->await_state([](const Json& one) { return device_in(one, "lab/arm0").is_null(); });
  EXPECT_TRUE(state["not_stopped"].empty());
}

TEST_F(SharedRegistries, KeepADeviceThatWasKilledAsLostUntilItIsDismissed) {
  const auto client = connect_to_arm();
  devices_->process.send_signal(SIGKILL);
  ASSERT_TRUE(devices_->process.wait(kPatience));
  const auto lost_count = [&] {
    const Json names = Json::parse(rtpm({"list", "--json"}).output, nullptr, false);
    return std::ranges::count_if(names, [](const Json& name) {
      return name.value("is_lost", false) && name["name"] == "lab/arm0";
    });
  };
  EXPECT_TRUE(test::await([&] { return lost_count() > 0; }));
  EXPECT_EQ(lost_count(), 1) << "once, although both registries have lost it";
  static_cast<void>(client->await_state(
      [](const Json& state) { return device_in(state, "lab/arm0")["lost_for_s"].is_number(); }));
  EXPECT_EQ(client->call("console/dismiss", {{"device", "lab/arm0"}}), Json({{"ok", true}}));
  static_cast<void>(client->await_state(
      [](const Json& state) { return device_in(state, "lab/arm0").is_null(); }));
  EXPECT_TRUE(test::await([&] { return lost_count() == 0; }));
}

}  // namespace
}  // namespace rtpm::system_test
