#include <gtest/gtest.h>
#include <signal.h>

#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <optional>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "programs.hpp"
#include "rtpm/names/directory.hpp"
#include "rtpm/names/lapsed.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/test/os.hpp"

// A registry with a database that is killed again and again while names come and go.
namespace rtpm::system_test {
namespace {

using namespace std::chrono_literals;

/// Rounds of the storm: RTPM_STORM_ROUNDS, otherwise a few.
int round_count() {
  const char* const text = std::getenv("RTPM_STORM_ROUNDS");
  return text == nullptr ? 20 : std::atoi(text);
}

/// One caller's knowledge of its own name: the acknowledged state, and the state that it has since
/// asked for without an answer.
struct Known {
  std::string acknowledged{};              ///< URL; empty if not bound.
  std::optional<std::string> asked_for{};  ///< nullopt if nothing is under way.
};

class Storm {
 public:
  static constexpr int kCallerCount = 3;
  static constexpr int kNamesPerCaller = 8;

  /// Binds and unbinds until the registry no longer answers.
  void run(const std::string& registry_url, std::uint64_t seed) {
    std::vector<std::thread> callers;
    for (int caller = 0; caller < kCallerCount; ++caller) {
      callers.emplace_back([this, caller, registry_url, seed] {
        rpc::Node node{{.wait = {.strategy = rt::WaitStrategy::kBlock}}};
        names::Directory directory(node, registry_url, 300ms);
        std::mt19937_64 random(seed * 16 + static_cast<std::uint64_t>(caller));
        while (change_one(directory, caller, random)) {
        }
      });
    }
    for (std::thread& caller : callers)
      caller.join();
  }

  /// Compares with the registry's current names, which become the known state.
  void check(const std::string& registry_url) {
    rpc::Node node{{.wait = {.strategy = rt::WaitStrategy::kBlock}}};
    names::Directory directory(node, registry_url);
    const auto entries = directory.list();
    ASSERT_TRUE(entries) << entries.error().text();
    std::map<std::string, std::string> found;
    for (const names::NameEntry& entry : *entries)
      found[entry.name] = entry.url;
    for (auto& [name, known] : known_) {
      const std::string url = found.contains(name) ? found[name] : "";
      const bool is_right =
          url == known.acknowledged || (known.asked_for && url == *known.asked_for);
      EXPECT_TRUE(is_right) << name << " is '" << url << "', acknowledged was '"
                            << known.acknowledged << "'";
      known = {url, std::nullopt};
      found.erase(name);
    }
    EXPECT_TRUE(found.empty()) << found.begin()->first << " was never bound";
  }

  [[nodiscard]] std::uint64_t acknowledged_count() const { return acknowledged_count_; }

 private:
  /// Whether the change was acknowledged.
  bool change_one(names::Directory& directory, int caller, std::mt19937_64& random) {
    const std::string name =
        "c" + std::to_string(caller) + "/n" + std::to_string(random() % kNamesPerCaller);
    Known& known = known_.at(name);
    const names::Owner owner{.id = static_cast<std::uint64_t>(caller) + 1, .epoch = 1};
    expected<void, names::DirectoryError> done{};
    if (!known.acknowledged.empty() && random() % 2 == 0) {
      known.asked_for = "";
      done = directory.unbind(name, owner);
    } else {
      known.asked_for = "rtpm://10.0.0.1:1/v" + std::to_string(random());
      names::Claim claim{name, *known.asked_for, "lab.Arm", owner};
      claim.is_permanent = true;
      const auto bound = directory.bind(claim);
      if (!bound) done = unexpected{bound.error()};
    }
    if (!done) {
      EXPECT_FALSE(done.error().outcome) << done.error().text();
      return false;
    }
    known = {*known.asked_for, std::nullopt};
    ++acknowledged_count_;
    return true;
  }

  static std::map<std::string, Known> all_names() {
    std::map<std::string, Known> names;
    for (int caller = 0; caller < kCallerCount; ++caller) {
      for (int i = 0; i < kNamesPerCaller; ++i)
        names["c" + std::to_string(caller) + "/n" + std::to_string(i)];
    }
    return names;
  }

  /// Each caller changes its own names only, so the map itself stays as it is.
  std::map<std::string, Known> known_ = all_names();
  std::atomic<std::uint64_t> acknowledged_count_ = 0;
};

TEST(NamesStorm, LosesNoAcknowledgedNameAndBringsNoneBackWhenTheRegistryIsKilled) {
  std::string folder = (std::filesystem::temp_directory_path() / "rtpm-storm-XXXXXX").string();
  ASSERT_NE(::mkdtemp(folder.data()), nullptr);
  const std::vector<std::string> arguments{"--port", "0",       "--realtime",
                                           "off",    "--store", folder + "/names.db"};
  Storm storm;
  std::mt19937_64 random(42);
  for (int round = 0; round < round_count() && !testing::Test::HasFailure(); ++round) {
    auto registry = start_daemon("rtpm-registryd", arguments);
    ASSERT_TRUE(registry);
    storm.check(registry->url);
    std::thread killer([&, pause = std::chrono::milliseconds(5 + random() % 120)] {
      rt::sleep_until(rt::now() + pause);
      registry->process.send_signal(SIGKILL);
    });
    storm.run(registry->url, static_cast<std::uint64_t>(round));
    killer.join();
    ASSERT_TRUE(registry->process.wait(kPatience));
  }
  RecordProperty("acknowledged", static_cast<int>(storm.acknowledged_count()));
  std::printf("%d rounds, %llu acknowledged changes\n", round_count(),
              static_cast<unsigned long long>(storm.acknowledged_count()));
  EXPECT_GT(storm.acknowledged_count(), 0u);
  std::filesystem::remove_all(folder);
}

TEST(LostNames, AreStillLostWhenTheRegistryWasKilledUntilTheyAreDismissed) {
  std::string folder = (std::filesystem::temp_directory_path() / "rtpm-lost-XXXXXX").string();
  ASSERT_NE(::mkdtemp(folder.data()), nullptr);
  std::optional<Daemon> registry;
  const auto start = [&] {
    if (registry) {
      registry->process.send_signal(SIGKILL);
      ASSERT_TRUE(registry->process.wait(kPatience));
    }
    const std::string port = registry ? std::to_string(registry->port()) : "0";
    registry = start_daemon("rtpm-registryd",
                            {"--port", port, "--realtime", "off", "--store", folder + "/names.db"});
    ASSERT_TRUE(registry);
  };
  ASSERT_NO_FATAL_FAILURE(start());
  rpc::Node node{{.wait = {.strategy = rt::WaitStrategy::kBlock}}};
  const auto lost = [&] {
    return names::ask_for_lapsed(node, registry->url, rt::now() + kPatience).names;
  };
  const names::Claim claim{"lab/arm0", "rtpm://10.0.0.1:1/arm", "lab.Arm", {1, 1}, 1s};
  const auto bound = names::Directory(node, registry->url).bind(claim);
  ASSERT_TRUE(bound) << bound.error().text();
  // Its lease ends while the registry is dead, or when it has just started again.
  ASSERT_NO_FATAL_FAILURE(start());
  ASSERT_TRUE(test::await([&] { return !lost().empty(); }));
  const names::LapsedName before = lost().front();
  EXPECT_EQ(before.revision, bound->revision);

  ASSERT_NO_FATAL_FAILURE(start());
  ASSERT_EQ(lost().size(), 1u);
  const names::LapsedName after = lost().front();
  EXPECT_EQ(after.name, "lab/arm0");
  EXPECT_EQ(after.url, "rtpm://10.0.0.1:1/arm");
  EXPECT_EQ(after.revision, bound->revision);
  EXPECT_GE(after.lapsed_for, before.lapsed_for) << "since the same time";
  EXPECT_NE(run_program("rtpm", {"list", "--registry", registry->url}).output.find("LOST"),
            std::string::npos);
  EXPECT_TRUE(names::dismiss(node, after));

  ASSERT_NO_FATAL_FAILURE(start());
  EXPECT_TRUE(lost().empty());
  std::filesystem::remove_all(folder);
}

// The daemon's own behaviour with a database.
TEST(RegistryDaemon, DumpsAndLoadsAndKeepsPermanentNames) {
  std::string folder = (std::filesystem::temp_directory_path() / "rtpm-dump-XXXXXX").string();
  ASSERT_NE(::mkdtemp(folder.data()), nullptr);
  const std::string file = folder + "/names.db";
  rpc::Node node{{.wait = {.strategy = rt::WaitStrategy::kBlock}}};
  for (int start = 0; start < 2; ++start) {
    auto registry =
        start_daemon("rtpm-registryd", {"--port", "0", "--realtime", "off", "--store", file});
    ASSERT_TRUE(registry);
    names::Directory directory(node, registry->url);
    names::Claim claim{"lab/arm0", "rtpm://10.0.0.1:1/arm", "lab.Arm", {1, 1}};
    claim.is_permanent = true;
    if (start == 0) {
      const auto bound = directory.bind(claim);
      ASSERT_TRUE(bound) << bound.error().text();
    }
    const auto entry = directory.resolve("lab/arm0");
    ASSERT_TRUE(entry) << entry.error().text();
    EXPECT_TRUE(entry->is_permanent);
    expect_one_sentence(run_program("rtpm-registryd", {"--store", file, "--dump"}), 1,
                        {"another program has it open"});
    registry->process.send_signal(SIGTERM);
    ASSERT_TRUE(registry->process.wait(kPatience));
  }
  const auto dumped = run_program("rtpm-registryd", {"--store", file, "--dump"});
  EXPECT_EQ(dumped.exit_code, 0) << dumped.errors;
  EXPECT_NE(dumped.output.find("\"name\": \"lab/arm0\""), std::string::npos) << dumped.output;
  expect_one_sentence(run_program("rtpm-registryd", {"--dump"}), 1, {"--store FILE"});
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace rtpm::system_test
