#include "rtpm/rpc/lane_table.hpp"

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <functional>
#include <optional>
#include <random>
#include <string>
#include <thread>

#include "rtpm/test/child.hpp"
#include "rtpm/test/echo_server.hpp"

namespace rtpm::rpc {
namespace {

using namespace test;

/// The table of this process's server at this port.
std::optional<LaneTable> own_table(std::uint16_t port) {
  for (LaneTable& table : LaneTable::find()) {
    if (table.process_id() == getpid() && table.port() == port) return std::move(table);
  }
  return std::nullopt;
}

TEST(LaneTable, ShowsServersThatAreOpenToTheNetwork) {
  ServerConfig config = quiet_config();
  config.host = "any";
  config.security.is_insecure = true;
  const EchoServer server(config);
  const auto table = own_table(server.server->port());
  ASSERT_TRUE(table);
  EXPECT_TRUE(table->is_open_to_network());
}

TEST(LaneTable, ShowsEachLaneAndItsCounters) {
  ServerConfig config = quiet_config({quiet_lane(), quiet_lane(20'000)});
  config.lanes[1].name = "fast";
  config.lanes[0].schedule = rt::Schedule::kTimeShared;
  EchoServer server(config);
  Node node(quiet_node());
  Binding binding = bind_echo(node, server, {.warm_up = {0, 30'000}});
  for (int i = 0; i < 5; ++i)
    ASSERT_TRUE(binding.call(echo::kEcho, {}, {.priority = 30'000}));
  const auto table = own_table(server.server->port());
  ASSERT_TRUE(table);
  EXPECT_TRUE(table->is_known());
  EXPECT_TRUE(table->is_alive());
  EXPECT_EQ(table->version(), kLaneTableVersion);
  EXPECT_EQ(table->server_name(), "test");
  EXPECT_EQ(table->host(), "127.0.0.1");
  EXPECT_FALSE(table->is_open_to_network());
  const auto lanes = table->read();
  ASSERT_EQ(lanes.size(), 2u);
  EXPECT_EQ(lanes[0].name, "lane-0");
  EXPECT_EQ(lanes[0].band_low, 0);
  EXPECT_EQ(lanes[0].band_high, 19'999);
  EXPECT_EQ(lanes[0].schedule, "time-shared");
  EXPECT_EQ(lanes[1].name, "fast");
  EXPECT_EQ(lanes[1].band_high, Priority::kHighest);
  EXPECT_EQ(lanes[1].priority, 20'000);
  EXPECT_EQ(lanes[1].wait, "block");
  EXPECT_EQ(lanes[1].schedule, "fifo");
  // A lane counts a call after sending its answer, so the last call may still be missing.
  ASSERT_TRUE(await([&] {
    const auto sample = table->read()[1].sample;
    return sample && sample->counters.call_count == 5;
  }));
  const LaneSample sample = *table->read()[1].sample;
  EXPECT_GE(sample.cycle_count, 5u);
  EXPECT_GT(sample.longest_cycle_ns, 0);
  EXPECT_GT(sample.last_cycle_end_ns, 0);
}

TEST(LaneTable, CountsDroppedFrames) {
  EchoServer server;
  RawPeer peer(Transport::kUdp, server.server->port());
  const auto table = own_table(server.server->port());
  ASSERT_TRUE(table);
  peer.send(Bytes(100));
  EXPECT_TRUE(await([&] {
    const auto sample = table->read()[0].sample;
    return sample && sample->counters.frames.dropped_for(wire::DropReason::kBadMagic) == 1;
  }));
}

TEST(LaneTable, ShowsSinceWhenAMethodRuns) {
  EchoServer server;
  Node node(quiet_node());
  Binding binding = bind_echo(node, server);
  const auto table = own_table(server.server->port());
  ASSERT_TRUE(table);
  const MonotonicTime before = rt::now();
  std::thread caller([&] { static_cast<void>(binding.call(echo::kHold, {})); });
  ASSERT_TRUE(await([&] { return server.servant.gate().inside_count() == 1; }));
  const MonotonicTime since = table->read()[0].busy_since;
  EXPECT_EQ(table->read()[0].busy_count, 1u);
  EXPECT_GE(since, before);
  EXPECT_LE(since, rt::now());
  server.servant.gate().open();
  caller.join();
  EXPECT_TRUE(await([&] { return table->read()[0].busy_count == 0; }));
  EXPECT_EQ(table->read()[0].busy_since, MonotonicTime{});
}

TEST(LaneTable, IsReadableWhileItsServerIsStopped) {
  int port_pipe[2];
  ASSERT_EQ(pipe(port_pipe), 0);
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    EchoServer server;
    const std::uint16_t port = server.server->port();
    if (write(port_pipe[1], &port, sizeof port) != sizeof port) _exit(1);
    for (;;)
      pause();
  }
  std::uint16_t port = 0;
  ASSERT_EQ(read(port_pipe[0], &port, sizeof port), ssize_t{sizeof port});
  {
    Node node(quiet_node());
    const std::string url = "rtpm://127.0.0.1:" + std::to_string(port) + "/echo";
    auto binding = Binding::bind(node, url, echo::kInterface);
    ASSERT_TRUE(binding) << binding.error().text();
    ASSERT_TRUE(binding->call(echo::kEcho, {}));
    kill(child, SIGSTOP);
  }
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, WUNTRACED), child);
  auto tables = LaneTable::find();
  std::erase_if(tables, [&](const LaneTable& table) { return table.process_id() != child; });
  ASSERT_EQ(tables.size(), 1u);
  const auto lanes = tables[0].read();
  ASSERT_EQ(lanes.size(), 1u);
  ASSERT_TRUE(lanes[0].sample);
  EXPECT_GE(lanes[0].sample->cycle_count, 1u);
  kill(child, SIGKILL);
  ASSERT_EQ(waitpid(child, &status, 0), child);
  EXPECT_FALSE(tables[0].is_alive());
  EXPECT_EQ(tables[0].read().size(), 1u) << "what was mapped stays";
  for (const LaneTable& table : LaneTable::find())
    EXPECT_NE(table.process_id(), child);
  close(port_pipe[0]);
  close(port_pipe[1]);
}

// A table that another program publishes under the same name must not harm its readers.
class ForeignTable : public testing::Test {
 protected:
  static constexpr std::size_t kSize = sizeof(LaneTableHeader) + 2 * sizeof(LaneSlot);
  void SetUp() override {
    auto made = rt::PublicMemory::create(kLaneTableName, kSize);
    ASSERT_TRUE(made) << made.error().text();
    memory_ = std::move(*made);
    header_ = new (memory_.bytes().data()) LaneTableHeader;
    header_->version = kLaneTableVersion;
    header_->slot_size = sizeof(LaneSlot);
    header_->slot_count = 2;
    header_->port = 7;
    slots_ = reinterpret_cast<LaneSlot*>(memory_.bytes().data() + sizeof(LaneTableHeader));
    for (int i = 0; i < 2; ++i)
      new (&slots_[i]) LaneSlot;
    header_->magic = kLaneTableMagic;
  }
  /// The table as a reader finds it; reads as much of it as possible.
  static LaneTable found() {
    for (LaneTable& table : LaneTable::find()) {
      if (table.process_id() != getpid()) continue;
      static_cast<void>(table.read());
      return std::move(table);
    }
    ADD_FAILURE() << "the table is not found";
    std::abort();
  }

  rt::PublicMemory memory_;
  LaneTableHeader* header_ = nullptr;
  LaneSlot* slots_ = nullptr;
};

TEST_F(ForeignTable, IsUnknownWithAnotherVersionOrShape) {
  const auto is_known_after = [&](const std::function<void()>& change) {
    change();
    return found().is_known();
  };
  EXPECT_FALSE(is_known_after([&] { header_->magic = 1; }));
  header_->magic = kLaneTableMagic;
  EXPECT_FALSE(is_known_after([&] { header_->version = kLaneTableVersion + 1; }));
  EXPECT_EQ(found().version(), kLaneTableVersion + 1);
  header_->version = kLaneTableVersion;
  EXPECT_FALSE(is_known_after([&] { header_->slot_size = 1; }));
  header_->slot_size = sizeof(LaneSlot);
  for (const std::uint32_t count : {3u, 0u, 0xffff'ffffu})
    EXPECT_FALSE(is_known_after([&] { header_->slot_count = count; })) << count;
}

TEST_F(ForeignTable, ShowsNoTerminalControls) {
  std::ranges::fill(slots_[0].name, '\x1b');
  std::ranges::fill(header_->server_name, '\n');
  slots_[0].wait = 200;
  const LaneTable table = found();
  EXPECT_EQ(table.server_name(), std::string(64, '?'));
  EXPECT_EQ(table.read()[0].name, std::string(32, '?'));
  EXPECT_EQ(table.read()[0].wait, "unknown");
}

TEST_F(ForeignTable, IsReadableWithRandomContent) {
  std::mt19937 random(1);
  for (int round = 0; round < 200; ++round) {
    for (std::byte& byte : memory_.bytes().subspan(sizeof(LaneTableHeader)))
      byte = static_cast<std::byte>(random());
    for (const LaneReading& lane : found().read())
      EXPECT_LE(lane.name.size(), 32u);
  }
}

TEST(LaneTable, IsUnknownIfShorterThanAHeader) {
  const auto memory = rt::PublicMemory::create(kLaneTableName, 8);
  ASSERT_TRUE(memory);
  for (const LaneTable& table : LaneTable::find()) {
    EXPECT_FALSE(table.process_id() == getpid() && table.is_known());
  }
}

}  // namespace
}  // namespace rtpm::rpc
