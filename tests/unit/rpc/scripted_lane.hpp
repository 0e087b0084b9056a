#pragma once

#include <algorithm>
#include <atomic>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "lane/lane.hpp"
#include "noting_servant.hpp"
#include "one_port.hpp"
#include "rtpm/test/echo_server.hpp"
#include "rtpm/transport/tcp.hpp"
#include "rtpm/transport/udp.hpp"
#include "rtpm/wire/client_channel.hpp"
#include "virtual_time.hpp"

// A lane with scripted sources and time: nothing depends on the system or on chance.
namespace rtpm::rpc::test {

/// One peer's connection, without a socket: the script says which frames have arrived.
class ScriptedConnection final : public transport::Connection {
 public:
  ScriptedConnection(int number, int& lane_taken_count)
      : number_(number), lane_taken_count_(lane_taken_count) {}

  expected<void, transport::IoError> send(ConstBytes frame, MonotonicTime) noexcept override {
    const rt::AllowAllocationScope is_allowed;
    sent.emplace_back(frame.begin(), frame.end());
    return {};
  }
  bool has_spare_capacity(std::size_t) noexcept override { return has_capacity; }
  expected<MutableBytes, transport::IoError> receive() noexcept override {
    const rt::AllowAllocationScope is_allowed;
    if (received.empty()) return unexpected{transport::IoError::kNothing};
    last_taken = ++lane_taken_count_;
    ++taken_count;
    if (is_endless) return MutableBytes(received.front());
    current_ = std::move(received.front());
    received.pop_front();
    return MutableBytes(current_);
  }
  bool has_buffered() const noexcept override { return false; }
  wire::PeerAddress host() const noexcept override {
    return {0, static_cast<std::uint64_t>(number_), 0};
  }
  int descriptor() const noexcept override { return number_; }

  std::deque<Bytes> received;  ///< Frames that the lane has not read.
  std::vector<Bytes> sent;
  bool is_endless = false;   ///< The first frame repeats for ever.
  bool has_capacity = true;  ///< Whether items can be sent.
  int taken_count = 0;
  int last_taken = 0;  ///< Its index among all of the lane's frames.

 private:
  int number_;
  int& lane_taken_count_;
  Bytes current_;
};

/// Reports the connections that have frames, in the order of their addition. Where a lane would
/// sleep, `on_sleep` may change everything; then virtual time advances to the next event.
class ScriptedWaitSet final : public transport::WaitSet {
 public:
  bool add(int descriptor, SourceTag tag, transport::Trigger) noexcept override {
    const rt::AllowAllocationScope is_allowed;
    tags_[descriptor] = tag;
    return true;
  }
  void remove(int descriptor) noexcept override {
    const rt::AllowAllocationScope is_allowed;
    tags_.erase(descriptor);
  }
  std::size_t wait(MonotonicTime until, std::span<SourceTag> ready,
                   transport::WaitLock*) noexcept override {
    const rt::AllowAllocationScope is_allowed;
    ++wait_count;
    std::size_t count = report(ready);
    if (count > 0 || until == transport::kAlready) return count;
    is_asleep = true;
    if (on_sleep) on_sleep(until);
    const MonotonicTime begin = rt::now();
    VirtualTime::sleep(until, [&] { return is_rung_ || has_frames(); });
    slept += rt::now() - begin;
    is_asleep = false;
    return report(ready);
  }
  void ring() noexcept override { is_rung_ = true; }

  std::function<void(MonotonicTime until)> on_sleep;
  std::map<int, ScriptedConnection*> connections;
  int wait_count = 0;
  bool is_asleep = false;
  Duration slept{0};

 private:
  bool has_frames() const {
    return std::ranges::any_of(connections,
                               [](const auto& each) { return !each.second->received.empty(); });
  }
  std::size_t report(std::span<SourceTag> ready) {
    std::size_t count = 0;
    if (is_rung_.exchange(false)) ready[count++] = transport::kDoorbell;
    for (const auto& [descriptor, tag] : tags_) {
      const auto found = connections.find(descriptor);
      const bool has_frames = found != connections.end() && !found->second->received.empty();
      if (has_frames && count < ready.size()) ready[count++] = tag;
    }
    return count;
  }

  std::map<int, SourceTag> tags_;
  std::atomic<bool> is_rung_{false};
};

/// A lane that serves a servant as object 1, and its script, which runs on the lane's thread.
class ScriptedLane {
 public:
  explicit ScriptedLane(rt::WaitStrategy strategy) {
    EXPECT_TRUE(objects_.add("echo", servant, {}, Priority{Priority::kHighest}));
    config_.lanes.resize(1);
    config_.lanes.front().wait.strategy = strategy;
    config_.session_count_max = 128;
    config_.message_size_max = 4096;
    config_.large_message_count_max = 0;
    config_.deferred_call_count_max = 4;
    config_.stream_count_max = 4;
    config_.stream_byte_max = 4096;
    config_.local_oneway_count_max = 0;
    LaneSetup setup;
    setup.server = &config_;
    setup.epoch = 1;
    setup.objects = &objects_;
    setup.acceptor_bell = &acceptor_;
    setup.slot = &slot_;
    const auto listener = transport::TcpListener::open("127.0.0.1", 0);
    auto set = std::make_unique<ScriptedWaitSet>();
    wait_set = set.get();
    lane = std::make_unique<Lane>(setup, one_port(listener->port()), std::move(set));
  }
  /// Serves another object, number 2.
  void add(Servant& other) {
    EXPECT_TRUE(objects_.add("other", other, {}, Priority{Priority::kHighest}));
  }
  /// Runs the lane until the script stops it.
  void run() {
    EXPECT_TRUE(lane->start(rt::RealtimeMode::kOff, nullptr));
    lane->join();
  }
  /// A connection that the lane takes over; the test may use it as long as the lane has it.
  ScriptedConnection& connect() {
    const int number = 1'000'000 + static_cast<int>(wait_set->connections.size());
    auto connection = std::make_unique<ScriptedConnection>(number, taken_count_);
    ScriptedConnection& seen = *connection;
    wait_set->connections[number] = &seen;
    std::unique_ptr<transport::Connection> stream = std::move(connection);
    EXPECT_TRUE(lane->adopt(stream));
    return seen;
  }

  NotingServant servant;
  ScriptedWaitSet* wait_set = nullptr;
  std::unique_ptr<Lane> lane;

 private:
  ServerConfig config_;
  ObjectTable objects_;
  ScriptedWaitSet acceptor_;
  LaneSlot slot_;
  int taken_count_ = 0;
};

/// The client's end of a scripted connection.
class ScriptedClient {
 public:
  /// Sends the client's HELLO.
  explicit ScriptedClient(ScriptedConnection& connection)
      : connection_(connection),
        buffer_(wire::kHeaderSize + 1024),
        channel_({.medium = wire::Medium::kStream,
                  .client_epoch = 77,
                  .channel = 1,
                  .message_size_max = 4096},
                 buffer_) {
    const ConstBytes hello =
        channel_.open(Priority{0}, rt::now() + rtpm::test::kPatience, rt::now());
    connection.received.emplace_back(hello.begin(), hello.end());
  }
  /// Begins a call, once the lane has answered the HELLO. Each call has the next number.
  void begin(std::uint16_t method, std::uint32_t stream_window = 0,
             std::uint32_t budget_us = 60'000'000, std::uint32_t service = 1) {
    if (call_id_ == 0) {
      ASSERT_FALSE(connection_.sent.empty());
      const auto event = channel_.on_frame(connection_.sent.front(), rt::now());
      EXPECT_EQ(event.kind, wire::ChannelEvent::Kind::kReady);
    }
    wire::Header header;
    header.kind = wire::FrameKind::kCall;
    header.session = channel_.session();
    header.call_id = ++call_id_;
    header.service = service;
    header.method = method;
    header.item = stream_window;
    header.budget_us = budget_us;
    Bytes frame(wire::kHeaderSize);
    wire::encode(header, frame.data());
    connection_.received.push_back(std::move(frame));
  }

 private:
  ScriptedConnection& connection_;
  Bytes buffer_;
  wire::ClientChannel channel_;
  std::uint32_t call_id_ = 0;
};

}  // namespace rtpm::rpc::test
