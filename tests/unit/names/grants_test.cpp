#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <fstream>
#include <mutex>
#include <string>
#include <vector>

#include "registry_fixture.hpp"
#include "rtpm/access/files.hpp"
#include "rtpm/names/directory.hpp"
#include "rtpm/names/watch.hpp"
#include "rtpm/test/os.hpp"
#include "rtpm/test/temporary_folder.hpp"

// A registry whose server checks grants: the grants on a name's path apply to it.
namespace rtpm::names {
namespace {

using namespace std::chrono_literals;

constexpr Owner kOwner{.id = 1, .epoch = 1};
constexpr Owner kOther{.id = 2, .epoch = 1};

Claim leased(std::string_view name, Owner owner = kOwner) {
  return {name, "rtpm://10.0.0.1:1/p", "lab.Arm", owner, 20s};
}

/// A registry that one server serves to all users, and another one by grants, here to this user.
class Granted : public testing::Test {
 protected:
  Granted() {
    for (const char* name : {"lab/arm0", "lab/cam/left", "secret/x"})
      EXPECT_TRUE(Directory(node_, open_.url()).bind(leased(name)));
    const std::string me = "uid:" + std::to_string(access::this_user());
    std::ofstream(folder_ + "/authorized") << me << " role=administer on=lab/arm0\n"
                                           << me << " role=observe on=lab/cam/*\n";
    server_ = test::serve(
        kRegistryPath, *registry_,
        {.name = "registry",
         .security = {.authorized_file = folder_ + "/authorized", .key_file = folder_ + "/key"}},
        rpc::ObjectOptions{.checks_callers = true});
  }
  std::unique_ptr<rpc::Servant> registry_ = make_servant();
  ServedRegistry open_{*registry_};
  const test::TemporaryFolder own_folder_;
  const std::string folder_ = own_folder_.path();
  std::unique_ptr<rpc::Server> server_;
  rpc::Node node_{{.wait = {.strategy = rt::WaitStrategy::kBlock}, .collocates = false}};
};

TEST_F(Granted, ChangesOnlyNamesThatTheCallerAdministers) {
  Directory directory(node_, server_->url(kRegistryPath));
  EXPECT_EQ(directory.bind(leased("lab/arm1")).error().outcome, Outcome::kDenied);
  EXPECT_EQ(directory.bind(leased("secret/y")).error().outcome, Outcome::kDenied);
  EXPECT_EQ(directory.rebind(leased("lab/cam/left", kOther)).error().outcome, Outcome::kDenied);
  EXPECT_EQ(directory.renew("lab/cam/left", kOwner, 20s).error().outcome, Outcome::kDenied);
  EXPECT_EQ(directory.unbind("secret/x", kOwner).error().outcome, Outcome::kDenied);
  EXPECT_TRUE(directory.renew("lab/arm0", kOwner, 20s));
  EXPECT_TRUE(directory.unbind("lab/arm0", kOwner));
  EXPECT_TRUE(directory.bind(leased("lab/arm0", kOther)));
}

TEST_F(Granted, ShowsOnlyNamesOnWhichTheCallerHasARole) {
  Directory directory(node_, server_->url(kRegistryPath));
  EXPECT_TRUE(directory.resolve("lab/arm0"));
  EXPECT_TRUE(directory.describe("lab/cam/left"));
  EXPECT_EQ(directory.resolve("secret/x").error().outcome, Outcome::kNotFound);
  EXPECT_EQ(directory.resolve("secret/none").error().outcome, Outcome::kNotFound);
  const auto listed = directory.list();
  ASSERT_TRUE(listed);
  ASSERT_EQ(listed->size(), 2u);
  EXPECT_EQ(listed->back().name, "lab/cam/left");
  const auto found = directory.find({});
  ASSERT_TRUE(found);
  EXPECT_EQ(found->entries.size(), 2u);
}

TEST_F(Granted, WatchesReportOnlyNamesOnWhichTheCallerHasARole) {
  std::mutex mutex;
  std::vector<std::string> reported;
  auto watch = NameWatch::start(node_, server_->url(kRegistryPath), {},
                                {.on_change = [&](const NameChange& change) {
                                  const std::lock_guard lock(mutex);
                                  reported.push_back(change.entry.name);
                                }});
  ASSERT_TRUE(watch) << watch.error().text();
  Directory open(node_, open_.url());
  ASSERT_TRUE(open.bind(leased("secret/y")));
  ASSERT_TRUE(open.bind(leased("lab/cam/right")));
  EXPECT_TRUE(test::await([&] {
    const std::lock_guard lock(mutex);
    return std::ranges::find(reported, "lab/cam/right") != reported.end();
  }));
  const std::lock_guard lock(mutex);
  EXPECT_EQ(reported, (std::vector<std::string>{"lab/arm0", "lab/cam/left", "lab/cam/right"}));
}

}  // namespace
}  // namespace rtpm::names
