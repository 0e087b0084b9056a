#include <array>
#include <mutex>
#include <numeric>
#include <thread>
#include <vector>

#include "rtpm/rt/memory.hpp"
#include "suite.hpp"

// Oneways that are merely sent, in bursts, where nothing gets lost on the way.
namespace rtpm::rpc::test {
namespace {

constexpr MethodDescriptor kHold{1, "hold", 301, false, {}};
constexpr MethodDescriptor kNote{2, "note", 302, false, {}};
constexpr MethodDescriptor kLater{3, "later", 303, false, {}};
constexpr std::array kMethods{kHold, kNote, kLater};
constexpr InterfaceDescriptor kInterface{"test.Notes", 4713, "by hand", kMethods};

/// Records the numbers that it receives.
class NumberServant final : public Servant {
 public:
  const InterfaceDescriptor& interface() const noexcept override { return kInterface; }
  DispatchResult dispatch(std::uint16_t method_id, ConstBytes request, MutableBytes reply,
                          const CallContext& context) override {
    if (method_id == kHold.id) {
      gate.pass();
      return {};
    }
    if (method_id == kNote.id && request.empty()) return {};
    const std::lock_guard lock(mutex_);
    const rt::AllowAllocationScope is_allowed;
    if (method_id == kLater.id) {
      replies_.push_back(context.deferral->defer());
      return {};
    }
    int number = 0;
    std::memcpy(&number, request.data(), std::min(request.size(), sizeof number));
    numbers_.push_back(number);
    // An unread reply must not disturb waiting requests.
    std::ranges::fill(reply.first(100), std::byte{0xff});
    return {wire::Status::kOk, 100};
  }
  [[nodiscard]] std::vector<int> numbers() {
    const std::lock_guard lock(mutex_);
    return numbers_;
  }
  [[nodiscard]] std::vector<DeferredReply> replies() {
    const std::lock_guard lock(mutex_);
    return std::move(replies_);
  }
  echo::Gate gate;

 private:
  std::mutex mutex_;
  std::vector<int> numbers_;
  std::vector<DeferredReply> replies_;
};

std::vector<int> numbers_up_to(int count) {
  std::vector<int> numbers(static_cast<std::size_t>(count));
  std::iota(numbers.begin(), numbers.end(), 0);
  return numbers;
}

/// A lane with space for all that the tests send, whatever its kind.
LaneConfig roomy_lane(Priority low = 0) {
  LaneConfig lane = quiet_lane(low);
  if (buffered_requests() > 0) lane.buffered_request_max = 4096;
  return lane;
}

class Oneways : public TransportSuite {
 protected:
  void TearDown() override {
    servant_.gate.open();
    if (holder_.joinable()) holder_.join();
    if (server_) server_->stop();
    TransportSuite::TearDown();
  }
  void start(ServerConfig config = quiet_config({roomy_lane()}), NodeConfig node = node_config()) {
    auto created = Server::create(std::move(config));
    ASSERT_TRUE(created) << created.error().text();
    server_ = std::move(*created);
    ASSERT_TRUE(server_->add("notes", servant_));
    ASSERT_TRUE(server_->start());
    node_.emplace(std::move(node));
    auto bound = Binding::bind(*node_, server_->url("notes"), kInterface,
                               {.deadline = rtpm::test::kPatience});
    ASSERT_TRUE(bound) << bound.error().text();
    binding_.emplace(std::move(*bound));
    // Opens two channels now, because none can be opened while the lane is busy.
    const auto first = binding_->call(kNote, {});
    const auto second = binding_->call(kNote, {});
    ASSERT_TRUE(first && second);
  }
  /// Keeps the lane of that priority busy until the gate opens.
  void occupy(Priority priority = 0) {
    holder_ = std::thread(
        [this, priority] { EXPECT_TRUE(binding_->call(kHold, {}, {.priority = priority})); });
    ASSERT_TRUE(await([&] { return servant_.gate.inside_count() == 1; }));
  }
  [[nodiscard]] expected<void, CallError> send(int number, const CallOptions& options = {}) {
    return binding_->send(kNote, std::as_bytes(std::span(&number, 1)), wire::Delivery::kSent,
                          options);
  }
  /// Sends up to `count` of them, from number 0 on, until one is refused; returns how many were
  /// sent.
  [[nodiscard]] int send_up_to(int count, CallError& error) {
    for (int i = 0; i < count; ++i) {
      if (const auto sent = send(i); !sent) {
        error = sent.error();
        return i;
      }
    }
    return count;
  }
  [[nodiscard]] bool await_numbers(const std::vector<int>& numbers) {
    return await([&] { return servant_.numbers() == numbers; });
  }

  NumberServant servant_;
  std::unique_ptr<Server> server_;
  std::optional<Node> node_;
  std::optional<Binding> binding_;
  std::thread holder_;
};

INSTANTIATE_TEST_SUITE_P(Tcp, Oneways, testing::Values(Transport::kTcp));
INSTANTIATE_TEST_SUITE_P(SharedMemory, Oneways, testing::Values(Transport::kSharedMemory));
INSTANTIATE_TEST_SUITE_P(Local, Oneways, testing::Values(Transport::kLocal));

TEST_P(Oneways, RunInOrderAndBeforeTheNextCall) {
  start();
  occupy();
  CallError error{};
  EXPECT_EQ(send_up_to(500, error), 500) << to_string(error);
  EXPECT_TRUE(servant_.numbers().empty());
  servant_.gate.open();
  const int last = 500;
  EXPECT_TRUE(binding_->call(kNote, std::as_bytes(std::span(&last, 1))));
  EXPECT_EQ(servant_.numbers(), numbers_up_to(501));
}

TEST_P(Oneways, RunOnceEachFromManyThreads) {
  constexpr int kThreadCount = 4;
  constexpr int kCount = 500;
  start();
  std::array<std::thread, kThreadCount> threads;
  for (int t = 0; t < kThreadCount; ++t) {
    threads[static_cast<std::size_t>(t)] = std::thread([this, t] {
      for (int i = 0; i < kCount; ++i)
        EXPECT_TRUE(await([&] { return send(t * kCount + i).has_value(); }));
    });
  }
  for (std::thread& thread : threads)
    thread.join();
  EXPECT_TRUE(await([&] { return servant_.numbers().size() == kThreadCount * kCount; }));
  std::vector<int> numbers = servant_.numbers();
  std::ranges::sort(numbers);
  EXPECT_EQ(numbers, numbers_up_to(kThreadCount * kCount));
}

/// A promise of calls within a program only: a queue of oneways replaces the socket's buffer.
class LocalOneways : public Oneways {
 protected:
  static ServerConfig config_of(std::uint32_t count_max) {
    ServerConfig config = quiet_config({roomy_lane(0), roomy_lane(20'000)});
    config.local_oneway_count_max = count_max;
    return config;
  }
};

INSTANTIATE_TEST_SUITE_P(Local, LocalOneways, testing::Values(Transport::kLocal));

TEST_P(LocalOneways, AreRefusedAndCountedWithoutAFreeSlot) {
  start(config_of(8));
  occupy();
  CallError error{};
  EXPECT_EQ(send_up_to(9, error), 8);
  EXPECT_EQ(error, CallError::kOverload);
  EXPECT_TRUE(send(8, {.priority = 20'000})) << "the other lane has its own";
  EXPECT_TRUE(await_numbers({8}));
  servant_.gate.open();
  EXPECT_TRUE(await_numbers({8, 0, 1, 2, 3, 4, 5, 6, 7}));
  EXPECT_TRUE(await([&] { return server_->counters().overload_count == 1; }));
  EXPECT_TRUE(await([&] { return server_->counters().call_count == 12; }));
  EXPECT_TRUE(await([&] { return send(9).has_value(); })) << "the places are free again";
}

TEST_P(LocalOneways, AreCountedAsRefusedByALaneThatSleeps) {
  start(config_of(1));
  EXPECT_TRUE(binding_->send(kLater, {}, wire::Delivery::kSent));
  std::vector<DeferredReply> replies;
  EXPECT_TRUE(await([&] { return !(replies = servant_.replies()).empty(); }));
  const auto refused = send(0);
  ASSERT_FALSE(refused) << "what is answered later has its place until then";
  EXPECT_EQ(refused.error(), CallError::kOverload);
  EXPECT_TRUE(await([&] { return server_->counters().overload_count == 1; }));
  replies.front().complete(wire::Status::kOk);
  EXPECT_TRUE(await([&] { return send(1).has_value(); }));
  EXPECT_TRUE(await_numbers({1}));
}

TEST_P(LocalOneways, UseCallChannelsWithoutSlotsOfTheirOwn) {
  NodeConfig node = node_config();
  node.channel_count_max = 3;
  start(config_of(0), node);
  occupy();
  CallError error{};
  EXPECT_EQ(send_up_to(9, error), 2) << "the call that holds the lane has one";
  EXPECT_EQ(error, CallError::kNoChannel);
  servant_.gate.open();
  EXPECT_TRUE(await_numbers({0, 1}));
}

TEST_P(LocalOneways, UseCallChannelsInTheSameOrderWhenLarge) {
  start(config_of(8));
  occupy();
  EXPECT_TRUE(send(0));
  Bytes large(200'000);
  const int number = 1;
  std::memcpy(large.data(), &number, sizeof number);
  EXPECT_TRUE(binding_->send(kNote, large, wire::Delivery::kSent));
  EXPECT_TRUE(send(2));
  servant_.gate.open();
  EXPECT_TRUE(await_numbers({0, 1, 2}));
}

TEST_P(LocalOneways, EndWithTheServerWhileTheyWait) {
  start(config_of(8));
  occupy();
  CallError error{};
  EXPECT_EQ(send_up_to(8, error), 8);
  std::thread stopper([&] { server_->stop(); });
  servant_.gate.open();
  stopper.join();
  EXPECT_LE(servant_.numbers().size(), 8u);
  EXPECT_FALSE(send(0, {.deadline = std::chrono::milliseconds{20}}));
}

}  // namespace
}  // namespace rtpm::rpc::test
