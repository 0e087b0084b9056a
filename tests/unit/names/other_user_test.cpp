// A registry at the usual address that another user of this host has started.
#include <gtest/gtest.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cstdlib>
#include <fstream>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "registry_fixture.hpp"
#include "rtpm/discovery/scope.hpp"
#include "rtpm/names/directory.hpp"
#include "rtpm/names/registration.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/test/os.hpp"
#include "rtpm/test/other_hosts.hpp"
#include "rtpm/test/temporary_folder.hpp"
#include "rtpm/test/text.hpp"

namespace rtpm::names {
namespace {

using namespace std::chrono_literals;

constexpr const char* kUrl = "rtpm://127.0.0.1:4711/lab/arm0";
constexpr const char* kOtherUrl = "rtpm://127.0.0.1:4712/lab/arm0";
constexpr uid_t kStranger = 4242;

/// Changes the user of the calling thread only.
void become(uid_t user) {
  ASSERT_EQ(syscall(SYS_setresuid, static_cast<uid_t>(-1), user, static_cast<uid_t>(-1)), 0);
}

class OtherUser : public testing::Test {
 protected:
  void SetUp() override {
    if (geteuid() != 0) GTEST_SKIP() << "another user takes root";
    hosts_.emplace();
    if (!hosts_->is_there()) GTEST_SKIP() << test::OtherHosts::kMissing;
    setenv("XDG_RUNTIME_DIR", folder_.c_str(), 1);
    become(kStranger);
    strangers_.emplace(discovery::kRegistryPort);
    become(0);
    std::ofstream(known_servers_file()) << "";
  }
  void TearDown() override {
    strangers_.reset();
    unsetenv("XDG_RUNTIME_DIR");
    hosts_.reset();
  }
  [[nodiscard]] std::string known_servers_file() const { return folder_ + "/known_servers"; }
  [[nodiscard]] rpc::NodeConfig node_config() const {
    rpc::NodeConfig config{.wait = {.strategy = rt::WaitStrategy::kBlock}, .collocates = false};
    config.security.known_servers_file = known_servers_file();
    return config;
  }
  [[nodiscard]] expected<std::unique_ptr<Registration>, SetupError> create(rpc::Node& node) {
    return Registration::create(node, std::string(kThisHost), "lab/arm0", kUrl, "lab.Arm", 300ms,
                                [this](std::string_view sentence) {
                                  const std::lock_guard lock(mutex_);
                                  said_ += std::string(sentence) + "\n";
                                });
  }
  [[nodiscard]] bool was_said(std::string_view part) {
    const std::lock_guard lock(mutex_);
    return said_.find(part) != std::string::npos;
  }

  std::optional<test::OtherHosts> hosts_{};
  const test::TemporaryFolder own_folder_;
  const std::string folder_ = own_folder_.path();
  std::optional<ServedRegistry> strangers_{};
  std::mutex mutex_;
  std::string said_{};
};

TEST_F(OtherUser, GetsNoNamesOfThisUsersPrograms) {
  rpc::Node node(node_config());
  Directory at_stranger(node, strangers_->url());
  const auto registration = test::made(create(node));
  EXPECT_TRUE(registration->is_bound());
  EXPECT_TRUE(was_said("does not move to the registry at rtpm://127.0.0.1:7420/rtpm/names"));
  EXPECT_TRUE(was_said("local uid:4242"));
  EXPECT_EQ(at_stranger.resolve("lab/arm0").error().outcome, Outcome::kNotFound);
  EXPECT_EQ(Directory(node).resolve("lab/arm0")->url, kUrl) << "it serves its name itself";
  const auto bound = Directory(node).bind({"lab/x", kUrl, "lab.Arm", {7, 1}, 1s});
  ASSERT_FALSE(bound);
  test::expect_text(bound.error().text(), {"it is of user 4242"});
}

// The foreign registry binds the name of an existing server.
TEST_F(OtherUser, CannotTakeANameOrStopItsServerFromStarting) {
  rpc::Node node(node_config());
  Directory at_stranger(node, strangers_->url());
  ASSERT_TRUE(at_stranger.bind({"lab/arm0", kOtherUrl, "lab.Arm", {7, 1}, 1h}));
  const auto registration = test::made(create(node));
  Directory directory(node);
  const auto entry = directory.resolve("lab/arm0");
  ASSERT_TRUE(entry) << entry.error().text();
  EXPECT_EQ(entry->url, kUrl);
  ASSERT_FALSE(directory.notes().empty());
  test::expect_text(directory.notes().front(), {"is left out"});
  EXPECT_EQ(directory.list()->size(), 2u) << "a list shows both";
}

TEST_F(OtherUser, GetsNamesIfTrusted) {
  std::ofstream(known_servers_file()) << "local uid:4242\n";
  rpc::Node node(node_config());
  const auto registration = test::made(create(node));
  EXPECT_EQ(Directory(node, strangers_->url()).resolve("lab/arm0")->url, kUrl);
  EXPECT_TRUE(Directory(node).bind({"lab/x", kUrl, "lab.Arm", {7, 1}, 1s}));
}

// A name at a registry returns to its own program when that registry becomes another user's.
TEST_F(OtherUser, GetsNoNamesByReplacingTheRegistry) {
  strangers_->stop();
  strangers_.emplace(discovery::kRegistryPort);
  rpc::Node node(node_config());
  const auto registration = test::made(create(node));
  EXPECT_EQ(Directory(node, strangers_->url()).resolve("lab/arm0")->url, kUrl);
  strangers_->stop();
  become(kStranger);
  strangers_.emplace(discovery::kRegistryPort);
  become(0);
  EXPECT_TRUE(test::await([&] { return was_said("which this program serves itself"); }));
  EXPECT_EQ(Directory(node, strangers_->url()).resolve("lab/arm0").error().outcome,
            Outcome::kNotFound);
  EXPECT_EQ(Directory(node).resolve("lab/arm0")->url, kUrl);
}

}  // namespace
}  // namespace rtpm::names
