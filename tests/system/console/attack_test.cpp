#include <gtest/gtest.h>
#include <zstd.h>

#include <atomic>
#include <chrono>
#include <fstream>
#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "fixture.hpp"
#include "foreign.hpp"

// Under each attack on rtpm-console, a client with the token gets in and stops the devices, and a
// browser that was connected before keeps its connection.
namespace rtpm::system_test {
namespace {

/// Repeats an attack on a thread of its own, until it is ended.
class Attack {
 public:
  explicit Attack(std::function<void()> step) : step_(std::move(step)) {
    thread_ = std::thread([this] {
      while (!is_ending_) {
        step_();
        ++step_count_;
      }
    });
  }
  Attack(const Attack&) = delete;
  Attack& operator=(const Attack&) = delete;
  ~Attack() {
    is_ending_ = true;
    thread_.join();
  }
  [[nodiscard]] int step_count() const noexcept { return step_count_; }

 private:
  std::function<void()> step_;
  std::atomic<bool> is_ending_{false};
  std::atomic<int> step_count_{0};
  std::thread thread_{};
};

class ConsoleUnderAttack : public ConsoleSystem {
 protected:
  /// Stops the arm under the attack by a browser that was connected before, and by a new one.
  void expect_stops(const std::function<void()>& step) {
    const auto before = connect_to_arm();
    const Attack attack(step);
    while (attack.step_count() < 3)
      std::this_thread::yield();
    for (int i = 0; i < 3; ++i) {
      const auto late = connect();
      ASSERT_TRUE(late->web().is_accepted()) << late->web().answer();
      for (ConsoleClient* client : {late.get(), before.get()}) {
        const Json stopped = client->call("console/estop", Json::object());
        EXPECT_EQ(stopped["stopped"], Json::array({"lab/arm0"})) << stopped;
      }
    }
    EXPECT_TRUE(is_live(before->await_state([](const Json&) { return true; }), "lab/arm0"));
  }
  [[nodiscard]] std::uint16_t port() const { return console_->port; }
};

TEST_F(ConsoleUnderAttack, StopsDevicesDespiteReadOnlyConnections) {
  std::vector<std::unique_ptr<WebClient>> observers;
  expect_stops([&] {
    observers.push_back(std::make_unique<WebClient>(port(), WebClient::Options{}));
    for (const auto& observer : observers)
      static_cast<void>(observer->next(Duration{0}));
    if (observers.size() > 100) observers.erase(observers.begin());
  });
}

TEST_F(ConsoleUnderAttack, StopsDevicesDespiteSlowRequests) {
  std::vector<Socket> sockets;
  expect_stops([&] {
    sockets.emplace_back(port());
    for (Socket& socket : sockets)
      socket.send(sockets.size() % 7 == 0 ? "GET / HTTP/1.1\r\n" : "X");
    if (sockets.size() > 300) sockets.erase(sockets.begin());
  });
}

TEST_F(ConsoleUnderAttack, StopsDevicesDespiteAThousandSilentConnections) {
  std::vector<Socket> sockets;
  for (int i = 0; i < 900; ++i)
    sockets.emplace_back(port());
  expect_stops([&] {
    sockets.emplace_back(port());
    sockets.erase(sockets.begin());
  });
}

TEST_F(ConsoleUnderAttack, StopsDevicesDespiteDeeplyNestedFrames) {
  const std::string nested =
      R"({"op":"setParameters","parameters":[{"name":"lab/arm0.safety","value":)" +
      std::string(734, '[') + std::string(734, ']') + "}]}";
  expect_stops([&] {
    WebClient observer(port(), {});
    for (int i = 0; i < 8; ++i)
      observer.send_text(nested);
    static_cast<void>(observer.next(std::chrono::milliseconds{20}));
  });
  // With the token, the requests of calls are parsed, too.
  const auto client = connect();
  ASSERT_TRUE(client->await_service("lab/arm0/config/apply"));
  const std::string deep = std::string(10'000, '[') + std::string(10'000, ']');
  for (const char* service : {"lab/arm0/config/apply", "console/estop"}) {
    EXPECT_FALSE(client->call_text(service, "{\"x\":" + deep + "}")) << service;
  }
}

TEST_F(ConsoleUnderAttack, StopsDevicesDespiteManyFrames) {
  const std::string pad =
      R"({"op":"getParameters","parameterNames":[],"pad":")" + std::string(60'000, 'x') + "\"}";
  auto observer = std::make_unique<WebClient>(port(), WebClient::Options{});
  expect_stops([&] {
    if (!observer->send_text(pad)) {
      observer = std::make_unique<WebClient>(port(), WebClient::Options{});
    }
    while (observer->next(Duration{0})) {
    }
  });
}

/// A recording of some megabytes, without a summary, whose chunks unpack to 32 GB.
void put_bomb(const std::string& path) {
  using namespace recording::foreign;
  constexpr std::uint64_t kChunkSize = std::uint64_t{16} << 20;
  constexpr int kChunkCount = 2000;
  std::string records;
  while (records.size() < kChunkSize)
    records += message(1, 0, 5, std::string(4096, 'x'));
  std::string packed(ZSTD_compressBound(records.size()), '\0');
  packed.resize(ZSTD_compress(packed.data(), packed.size(), records.data(), records.size(), 1));
  std::ofstream file(path, std::ios::binary);
  file << header() << channel(1, 0, "a");
  for (int i = 0; i < kChunkCount; ++i)
    file << chunk(5, 5, "zstd", packed, records.size());
}

TEST_F(ConsoleUnderAttack, StopsDevicesDespiteARecordingThatUnpacksWithoutEnd) {
  put_bomb(folder_ + "/recordings/bomb.mcap");
  const auto reader = connect();
  const auto open = reader->begin_call("console/replay_open", {{"file", "bomb.mcap"}});
  expect_stops([&] {
    static_cast<void>(reader->begin_call("console/recordings", Json::object()));
    reader->read_one(std::chrono::milliseconds{20});
  });
  // The recording was still being read.
  EXPECT_FALSE(reader->call("console/replay_close", Json::object()).contains("failure"));
  const std::string why = reader->answer_of(open).value("failure", "");
  EXPECT_NE(why.find("it was stopped"), std::string::npos) << why;
}

}  // namespace
}  // namespace rtpm::system_test
