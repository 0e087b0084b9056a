#include "rtpm/gvd/stop_keeper.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "rtpm/gvd/server.hpp"
#include "rtpm/test/os.hpp"
#include "scripted_driver.hpp"
#include "stops/stop_file.hpp"

namespace rtpm::gvd {
namespace {

using rtpm::test::await;

using namespace std::chrono_literals;

class Listener final : public DeviceListener {
 public:
  void report(std::string_view text) override {
    const std::lock_guard lock(mutex_);
    texts_.emplace_back(text);
  }
  [[nodiscard]] bool has(std::string_view words) {
    const std::lock_guard lock(mutex_);
    return std::ranges::any_of(
        texts_, [words](const std::string& text) { return text.find(words) != std::string::npos; });
  }

 private:
  std::mutex mutex_{};
  std::vector<std::string> texts_{};
};

class KeptStops : public ::testing::Test {
 protected:
  /// One run of a program with one device.
  struct Program {
    Program(const std::string& folder, Listener& listener, const std::string& serial = "s-1")
        : keeper({.folder = folder, .listener = &listener}) {
      auto driver = std::make_unique<test::ScriptedDriver>();
      driver->descriptor.serial = serial;
      DeviceServerConfig config;
      config.cycle.stop_memory = &keeper.add("lab/arm0", driver->describe());
      config.thread.realtime = rt::RealtimeMode::kOff;
      auto made = DeviceServer::create(std::move(driver), config);
      RTPM_ASSERT(made.has_value(), "a server");
      server = std::move(*made);
      keeper.attach(*server);
      RTPM_ASSERT(keeper.start().has_value(), "a thread");
      RTPM_ASSERT(server->start().has_value(), "a device");
    }
    ~Program() { keeper.stop(); }
    StopKeeper keeper;
    std::unique_ptr<DeviceServer> server{};
  };

  void SetUp() override { std::filesystem::remove_all(folder_); }
  void TearDown() override { std::filesystem::remove_all(folder_); }
  [[nodiscard]] StopFile file() const { return {folder_, "scripted", "s-1"}; }
  [[nodiscard]] StopState kept() const { return file().load().value_or(StopState{}); }

  std::string folder_ = testing::TempDir() + "rtpm_stops_" +
                        testing::UnitTest::GetInstance()->current_test_info()->name();
  Listener listener_{};
};

TEST_F(KeptStops, OutliveTheirServer) {
  {
    Program program(folder_, listener_);
    EXPECT_FALSE(program.server->is_stopped());
    program.server->emergency_stop();
    EXPECT_TRUE(await([&] { return kept().is_stopped; })) << "without the program's orderly end";
  }
  Program next(folder_, listener_);
  EXPECT_TRUE(next.server->is_stopped());
  ASSERT_TRUE(await([&] { return next.server->newest().has_value(); }));
  EXPECT_TRUE(next.server->newest()->faults.has(driver::Fault::kEmergencyStop))
      << "in its first sample";
  EXPECT_TRUE(listener_.has("lab/arm0: it was stopped before this program began"));
}

TEST_F(KeptStops, ApplyToOneUnitOfADevice) {
  {
    Program program(folder_, listener_);
    program.server->emergency_stop();
  }
  Program other(folder_, listener_, "s-2");
  EXPECT_FALSE(other.server->is_stopped());
}

TEST_F(KeptStops, AreObeyedOnceForTheSystemEvenByTheNextServer) {
  {
    Program program(folder_, listener_);
    EXPECT_TRUE(program.keeper.obey(7));
    EXPECT_TRUE(program.server->is_stopped());
    EXPECT_EQ(program.keeper.obeyed(), 7u);
    EXPECT_FALSE(program.keeper.obey(7));
  }
  ASSERT_TRUE(file().save({.is_stopped = false, .obeyed = kept().obeyed}));
  Program next(folder_, listener_);
  EXPECT_FALSE(next.keeper.obey(7)) << "the device was rearmed since";
  EXPECT_FALSE(next.server->is_stopped());
  EXPECT_EQ(next.keeper.obeyed(), 0u);
  EXPECT_TRUE(next.keeper.obey(8));
  EXPECT_TRUE(next.server->is_stopped());
}

TEST_F(KeptStops, CountAsStopsIfUnreadable) {
  std::filesystem::create_directories(folder_);
  for (const std::string content :
       {"", "rtpm-stop 2\nrearmed\n", "rtpm-stop 1\nrearm", "rtpm-stop 1\nrearmed\nobeyed 12x\n"}) {
    std::ofstream(file().path(), std::ios::trunc) << content;
    Program program(folder_, listener_);
    EXPECT_TRUE(program.server->is_stopped()) << content;
  }
  EXPECT_TRUE(listener_.has("does not say whether the device is stopped"));
}

TEST_F(KeptStops, ActAndAreReportedIfUnwritable) {
  // A file takes the folder's place.
  std::ofstream(folder_) << "no folder";
  Program program(folder_, listener_);
  program.server->emergency_stop();
  EXPECT_TRUE(program.server->is_stopped());
  EXPECT_TRUE(await([&] { return listener_.has("IT ENDS WITH THIS PROGRAM"); }));
  std::filesystem::remove_all(folder_);
  EXPECT_TRUE(await([&] { return kept().is_stopped; })) << "it is tried again";
}

TEST(StopFiles, KeepWhatTheyAreGiven) {
  const std::string folder = testing::TempDir() + "rtpm_stop_files";
  std::filesystem::remove_all(folder);
  const StopFile file(folder + "/deep", "m", "a/b");
  EXPECT_EQ(*file.load(), StopState{}) << "without a file";
  StopState state{.is_stopped = true};
  for (std::uint64_t id = 1; id <= StopState::kObeyedCountMax; ++id)
    state.obeyed.push_back(id << 40);
  ASSERT_TRUE(file.save(state));
  EXPECT_EQ(*file.load(), state);
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace rtpm::gvd
