#include "rtpm/rpc/tap.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "rtpm/rt/memory.hpp"
#include "rtpm/test/alloc_guard.hpp"
#include "rtpm/test/echo_server.hpp"
#include "rtpm/test/lock_guard.hpp"
#include "rtpm/test/serve.hpp"

// The tap of a server. The guards that this binary links abort if a lane allocates, or takes a lock
// without priority inheritance.
namespace rtpm::rpc {
namespace {

using namespace test;

/// A copy of a record that outlives its slot in the ring.
struct Kept {
  explicit Kept(const TappedCall& record) : call(record), request(text(call.request)) {
    reply = text(call.reply);
    call.request = call.reply = {};
  }
  static std::string text(ConstBytes bytes) {
    return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
  }
  TappedCall call;
  std::string request;
  std::string reply;
};

std::vector<Kept> read_all(CallTap& tap) {
  std::vector<Kept> list;
  while (const auto record = tap.next())
    list.emplace_back(*record);
  return list;
}

/// Waits for the next `count` records.
std::vector<Kept> read(CallTap& tap, std::size_t count) {
  std::vector<Kept> list;
  EXPECT_TRUE(await([&] {
    while (list.size() < count) {
      const auto record = tap.next();
      if (!record) return false;
      list.emplace_back(*record);
    }
    return true;
  })) << list.size()
      << " of " << count;
  return list;
}

class TapOverATransport : public testing::TestWithParam<Transport> {
 protected:
  EchoServer server_{};
  std::shared_ptr<CallTap> tap_ = server_.server->tap();
  Node node_{quiet_node(GetParam())};
  Binding binding_ = bind_echo(node_, server_);
};

INSTANTIATE_TEST_SUITE_P(All, TapOverATransport,
                         testing::Values(Transport::kUdp, Transport::kTcp, Transport::kSharedMemory,
                                         Transport::kLocal),
                         [](const auto& row) { return std::string(to_string(row.param)); });

TEST_P(TapOverATransport, RecordsNothingWhileItIsOff) {
  ASSERT_TRUE(binding_.call(echo::kEcho, bytes_of("before")));
  EXPECT_FALSE(tap_->is_on());
  ASSERT_TRUE(tap_->switch_on({}));
  EXPECT_TRUE(tap_->is_on());
  EXPECT_TRUE(read_all(*tap_).empty());
  tap_->switch_off();
  ASSERT_TRUE(binding_.call(echo::kEcho, bytes_of("after")));
  EXPECT_FALSE(tap_->is_on());
  EXPECT_TRUE(read_all(*tap_).empty());
}

TEST_P(TapOverATransport, RecordsAWholeCall) {
  ASSERT_TRUE(tap_->switch_on({}));
  const MonotonicTime begin = rt::now();
  ASSERT_TRUE(binding_.call(echo::kEcho, bytes_of("a question"), {.priority = 77, .trace_id = 99}));
  const echo::Place place = place_of(binding_, {.priority = 78});
  const std::vector<Kept> calls = read(*tap_, 2);
  const TappedCall& first = calls[0].call;
  EXPECT_EQ(first.stage, TapStage::kWhole);
  EXPECT_EQ(first.status, wire::Status::kOk);
  EXPECT_EQ(tap_->objects().at(first.service - 1), "echo");
  EXPECT_EQ(first.method, echo::kEcho.id);
  EXPECT_EQ(first.priority, Priority{77});
  EXPECT_EQ(first.trace_id, 99U);
  EXPECT_GE(first.received, begin);
  EXPECT_GE(first.finished, first.received);
  EXPECT_LE(first.finished, rt::now());
  EXPECT_EQ(calls[0].request, "a question");
  EXPECT_EQ(calls[0].reply, "a question");
  EXPECT_EQ(first.request_size, 10U);
  EXPECT_EQ(first.reply_size, 10U);
  const TappedCall& second = calls[1].call;
  EXPECT_EQ(second.session, place.session);
  EXPECT_EQ(to_ns(second.received), place.received_ns);
  EXPECT_GT(second.number, first.number);
  EXPECT_EQ(calls[1].request, "");
  EXPECT_EQ(second.reply_size, sizeof place);
  EXPECT_TRUE(read_all(*tap_).empty());
  EXPECT_EQ(tap_->losses().dropped_count, 0U);
}

TEST_P(TapOverATransport, RecordsOneways) {
  ASSERT_TRUE(tap_->switch_on({}));
  for (const auto delivery : {wire::Delivery::kSent, wire::Delivery::kReceipt}) {
    ASSERT_TRUE(binding_.send(echo::kEchoOnce, bytes_of("one way"), delivery));
    const Kept call = read(*tap_, 1).front();
    EXPECT_EQ(call.call.method, echo::kEchoOnce.id);
    EXPECT_EQ(call.request, "one way");
  }
}

TEST_P(TapOverATransport, RecordsTheStatusOfFailedCalls) {
  ASSERT_TRUE(tap_->switch_on({}));
  for (const Refusal refusal : {Refusal::kFailed, Refusal::kNotLeaseHolder}) {
    const auto text = static_cast<char>(refusal);
    EXPECT_FALSE(binding_.call(echo::kRefuse, bytes_of({&text, 1})));
  }
  const MethodDescriptor none{999, "none", 1, true, {}};
  EXPECT_FALSE(binding_.call(none, bytes_of("none")));
  const std::vector<Kept> calls = read(*tap_, 3);
  EXPECT_EQ(calls[0].call.status, wire::Status::kServantFailed);
  EXPECT_EQ(calls[0].call.request_size, 1U);
  EXPECT_EQ(calls[0].call.reply_size, 0U);
  EXPECT_EQ(calls[1].call.status, wire::Status::kNotLeaseHolder);
  EXPECT_EQ(calls[2].call.status, wire::Status::kNoSuchMethod);
}

TEST_P(TapOverATransport, OmitsAndCountsLongPayloads) {
  ASSERT_TRUE(tap_->switch_on({.payload_byte_max = 8}));
  ASSERT_TRUE(binding_.call(echo::kEcho, bytes_of("8 bytes.")));
  ASSERT_TRUE(binding_.call(echo::kEcho, bytes_of("9 bytes..")));
  const std::vector<Kept> calls = read(*tap_, 2);
  EXPECT_EQ(calls[0].reply, "8 bytes.");
  EXPECT_EQ(calls[1].request, "");
  EXPECT_EQ(calls[1].reply, "");
  EXPECT_EQ(calls[1].call.request_size, 9U);
  EXPECT_EQ(calls[1].call.reply_size, 9U);
  EXPECT_EQ(tap_->losses().omitted_payload_count, 2U);
}

TEST(Tap, OmitsAllPayloadsOnRequest) {
  EchoServer server;
  Node node(quiet_node());
  Binding binding = bind_echo(node, server);
  const auto tap = server.server->tap();
  ASSERT_TRUE(tap->switch_on({.has_payloads = false}));
  ASSERT_TRUE(binding.call(echo::kEcho, bytes_of("question")));
  const Kept call = read(*tap, 1).front();
  EXPECT_EQ(call.request + call.reply, "");
  EXPECT_EQ(call.call.request_size, 8U);
  EXPECT_EQ(tap->losses().omitted_payload_count, 0U) << "none was wanted";
}

TEST(Tap, CountsRecordsThatAFullRingDrops) {
  EchoServer server;
  Node node(quiet_node());
  Binding binding = bind_echo(node, server);
  const auto tap = server.server->tap();
  ASSERT_TRUE(tap->switch_on({.payload_byte_max = 512, .ring_byte_count = 4096}));
  // With 40 bytes each way, records have 160 bytes: 25 fit, and wrap around in many ways.
  constexpr std::uint64_t kCallCount = 100;
  std::uint64_t read_count = 0;
  for (unsigned round = 0; round < 5; ++round) {
    const std::string text = "round " + std::to_string(round) + std::string(33, '.');
    for (std::uint64_t i = 0; i < kCallCount; ++i)
      ASSERT_TRUE(binding.call(echo::kEcho, bytes_of(text)));
    const std::vector<Kept> calls = read_all(*tap);
    EXPECT_GE(calls.size(), 24U);
    for (const Kept& call : calls) {
      EXPECT_EQ(call.request, text);
      EXPECT_EQ(call.reply, text);
    }
    read_count += calls.size();
    EXPECT_EQ(tap->losses().dropped_count, kCallCount * (round + 1) - read_count);
  }
}

/// Defers its answers: method 1 with a reply, method 2 with a stream.
class LateServant final : public Servant {
 public:
  static constexpr MethodDescriptor kDefer{1, "defer", 101, false, {}};
  static constexpr MethodDescriptor kStream{2, "stream", 102, false, {}};
  static constexpr std::array kMethods{kDefer, kStream};
  static constexpr InterfaceDescriptor kInterface{"test.Late", 4712, "by hand", kMethods};

  const InterfaceDescriptor& interface() const noexcept override { return kInterface; }
  DispatchResult dispatch(std::uint16_t method, ConstBytes, MutableBytes,
                          const CallContext& context) override {
    if (method == kDefer.id) {
      reply = context.deferral->defer();
    } else {
      items = context.deferral->stream();
    }
    has_begun = true;
    return {};
  }
  DeferredReply reply;
  ItemWriter items;
  std::atomic<bool> has_begun{false};
};

class TapOfDeferredReplies : public testing::TestWithParam<Transport> {
 protected:
  void SetUp() override {
    server_ = rtpm::test::serve("late", servant_, quiet_config());
    auto bound = Binding::bind(node_, server_->url("late"), LateServant::kInterface);
    ASSERT_TRUE(bound) << bound.error().text();
    binding_.emplace(std::move(*bound));
    tap_ = server_->tap();
  }
  void TearDown() override { server_->stop(); }

  LateServant servant_;
  std::unique_ptr<Server> server_;
  Node node_{quiet_node(GetParam())};
  std::optional<Binding> binding_;
  std::shared_ptr<CallTap> tap_;
};

INSTANTIATE_TEST_SUITE_P(All, TapOfDeferredReplies,
                         testing::Values(Transport::kUdp, Transport::kSharedMemory,
                                         Transport::kLocal),
                         [](const auto& row) { return std::string(to_string(row.param)); });

TEST_P(TapOfDeferredReplies, RecordsARequestAndThenItsReply) {
  ASSERT_TRUE(tap_->switch_on({}));
  std::thread caller(
      [&] { EXPECT_TRUE(binding_->call(LateServant::kDefer, bytes_of("question"))); });
  const Kept begun = read(*tap_, 1).front();
  EXPECT_EQ(begun.call.stage, TapStage::kBegun);
  EXPECT_EQ(begun.request, "question");
  std::memcpy(servant_.reply.buffer().data(), "answer", 6);
  servant_.reply.complete(wire::Status::kOk, 6);
  caller.join();
  const Kept ended = read(*tap_, 1).front();
  EXPECT_EQ(ended.call.stage, TapStage::kEnded);
  EXPECT_EQ(ended.call.number, begun.call.number);
  EXPECT_EQ(ended.call.method, LateServant::kDefer.id);
  EXPECT_EQ(ended.call.received, begun.call.received);
  EXPECT_EQ(ended.reply, "answer");
  EXPECT_TRUE(read_all(*tap_).empty());
}

TEST_P(TapOfDeferredReplies, RecordsTheItemsOfAStream) {
  ASSERT_TRUE(tap_->switch_on({}));
  auto reader = binding_->open_stream(LateServant::kStream, bytes_of("from here"));
  ASSERT_TRUE(reader);
  const Kept begun = read(*tap_, 1).front();
  EXPECT_EQ(begun.call.stage, TapStage::kBegun);
  EXPECT_EQ(begun.request, "from here");
  for (const std::string_view text : {"first", "second"}) {
    ASSERT_TRUE(servant_.items.write(bytes_of(text)));
    ASSERT_TRUE(reader->next(rt::now() + rtpm::test::kPatience));
    const Kept item = read(*tap_, 1).front();
    EXPECT_EQ(item.call.stage, TapStage::kItem);
    EXPECT_EQ(item.call.number, begun.call.number);
    EXPECT_EQ(item.reply, text);
  }
  servant_.items.finish(wire::Status::kGone);
  const Kept ended = read(*tap_, 1).front();
  EXPECT_EQ(ended.call.stage, TapStage::kEnded);
  EXPECT_EQ(ended.call.number, begun.call.number);
  EXPECT_EQ(ended.call.status, wire::Status::kGone);
}

// The new tap does not have the call's request or number.
TEST_P(TapOfDeferredReplies, OmitsACallOfAnEarlierTap) {
  ASSERT_TRUE(tap_->switch_on({}));
  std::thread caller([&] { EXPECT_TRUE(binding_->call(LateServant::kDefer, bytes_of("old"))); });
  static_cast<void>(read(*tap_, 1));
  tap_->switch_off();
  ASSERT_TRUE(tap_->switch_on({}));
  servant_.reply.complete(wire::Status::kOk, 0);
  caller.join();
  servant_.has_begun = false;
  std::thread next([&] { EXPECT_TRUE(binding_->call(LateServant::kDefer, bytes_of("new"))); });
  EXPECT_EQ(read(*tap_, 1).front().request, "new");
  ASSERT_TRUE(await([&] { return servant_.has_begun.load(); }));
  servant_.reply.complete(wire::Status::kOk, 0);
  next.join();
  EXPECT_EQ(read(*tap_, 1).front().call.stage, TapStage::kEnded);
}

/// Calls another object of its lane from within its method.
class CallingServant final : public Servant {
 public:
  const InterfaceDescriptor& interface() const noexcept override { return echo::kInterface; }
  DispatchResult dispatch(std::uint16_t, ConstBytes request, MutableBytes,
                          const CallContext&) override {
    return {binding->call(echo::kEcho, request) ? wire::Status::kOk : wire::Status::kServantFailed,
            0};
  }
  Binding* binding = nullptr;
};

class TapOfTwoObjects : public testing::Test {
 protected:
  void SetUp() override {
    server_ = std::move(*Server::create(quiet_config()));
    ASSERT_TRUE(server_->add("outer", outer_));
    ASSERT_TRUE(server_->add("inner", inner_));
    ASSERT_TRUE(server_->start());
    to_inner_.emplace(std::move(*Binding::bind(node_, server_->url("inner"), echo::kInterface)));
    to_outer_.emplace(std::move(*Binding::bind(node_, server_->url("outer"), echo::kInterface)));
    outer_.binding = &*to_inner_;
  }
  void TearDown() override { server_->stop(); }
  /// The paths that a tap with this configuration records for two calls.
  std::vector<std::string> recorded(const TapConfig& config) {
    const auto tap = server_->tap();
    EXPECT_TRUE(tap->switch_on(config));
    EXPECT_TRUE(to_outer_->call(echo::kEcho, bytes_of("through")));
    EXPECT_TRUE(to_inner_->call(echo::kWhere, {}));
    std::vector<std::string> list;
    for (const Kept& call : read_all(*tap))
      list.push_back(tap->objects()[call.call.service - 1] + " " +
                     std::to_string(call.call.method));
    tap->switch_off();
    return list;
  }

  CallingServant outer_;
  echo::Servant inner_;
  std::unique_ptr<Server> server_;
  Node node_{quiet_node(Transport::kLocal)};
  std::optional<Binding> to_inner_;
  std::optional<Binding> to_outer_;
};

TEST_F(TapOfTwoObjects, RecordsTheSelectedObjectsAndMethods) {
  using List = std::vector<std::string>;
  EXPECT_EQ(recorded({}), (List{"inner 1", "outer 1", "inner 3"})) << "the nested call ended first";
  EXPECT_EQ(recorded({.objects = {{"outer"}}}), List{"outer 1"});
  EXPECT_EQ(recorded({.objects = {{"inner", {echo::kWhere.id}}}}), List{"inner 3"});
  EXPECT_EQ(recorded({.objects = {{"inner", {2, 4}}}}), List{});
  EXPECT_EQ(recorded({.excluded_path = "inner"}), List{"outer 1"});
}

TEST_F(TapOfTwoObjects, RefusesInvalidOptionsAndASecondTap) {
  const auto tap = server_->tap();
  const auto expect_refused = [&](const TapConfig& config, const std::vector<std::string>& parts) {
    const auto refused = tap->switch_on(config);
    ASSERT_FALSE(refused);
    expect_text(refused.error().text(), parts);
  };
  expect_refused({.objects = {{"middle"}}}, {"no object 'middle'"});
  expect_refused({.ring_byte_count = 5000}, {"5000", "power of two"});
  expect_refused({.payload_byte_max = 1024, .ring_byte_count = 4096}, {"1024", "eighth", "4096"});
  ASSERT_TRUE(tap->switch_on({}));
  expect_refused({}, {"tapped already", "end that tap first"});
}

TEST(Tap, OutlivesItsServer) {
  std::shared_ptr<CallTap> tap;
  {
    EchoServer server;
    Node node(quiet_node());
    Binding binding = bind_echo(node, server);
    tap = server.server->tap();
    ASSERT_TRUE(tap->switch_on({}));
    ASSERT_TRUE(binding.call(echo::kEcho, bytes_of("last")));
  }
  EXPECT_FALSE(tap->is_on());
  EXPECT_EQ(read(*tap, 1).front().request, "last");
  tap->switch_off();
  const auto late = tap->switch_on({});
  ASSERT_FALSE(late);
  expect_text(late.error().text(), {"stopped"});
}

/// Callers of two lanes over all transports at once.
class Load {
 public:
  Load() {
    for (const auto transport : {Transport::kUdp, Transport::kSharedMemory, Transport::kLocal}) {
      for (const int priority : {100, 25'000})
        callers_.emplace_back([this, transport, priority] { call(transport, priority); });
    }
  }
  ~Load() {
    is_stopping_ = true;
    for (std::thread& caller : callers_)
      caller.join();
  }
  [[nodiscard]] EchoServer& server() { return server_; }

 private:
  void call(Transport transport, int priority) {
    Node node(quiet_node(transport));
    Binding binding = bind_echo(node, server_);
    std::string text;
    for (std::size_t i = 0; !is_stopping_; ++i) {
      text = std::to_string(priority) + ' ' + std::to_string(i) + std::string(i % 200, '.');
      const auto reply = binding.call(echo::kEcho, bytes_of(text), {.priority = priority});
      ASSERT_TRUE(reply) << to_string(reply.error());
      EXPECT_EQ(text_of(*reply), text);
    }
  }

  EchoServer server_{quiet_config({quiet_lane(), quiet_lane(20'000)})};
  std::atomic<bool> is_stopping_{false};
  std::vector<std::thread> callers_;
};

TEST(Tap, WorksWhileSwitchedOnAndOffUnderLoad) {
  Load load;
  const auto tap = load.server().server->tap();
  std::map<bool, std::uint64_t> last_numbers;  ///< The last number of each lane.
  std::uint64_t read_count = 0;
  for (int round = 0; round < 100; ++round) {
    ASSERT_TRUE(tap->switch_on({.payload_byte_max = 512, .ring_byte_count = 4096}));
    // Some rounds end without reading any record.
    const std::size_t count = round % 4 == 0 ? 0 : 50;
    for (const Kept& call : read(*tap, count)) {
      EXPECT_EQ(call.request, call.reply);
      EXPECT_TRUE(call.request.starts_with(std::to_string(call.call.priority.value()) + ' '))
          << call.request;
      std::uint64_t& last = last_numbers[call.call.priority > Priority{20'000}];
      // A pool's threads write to several rings, which are read in turn.
      if (buffered_requests() == 0) {
        EXPECT_GT(call.call.number, last);
      }
      last = call.call.number;
      ++read_count;
    }
    tap->switch_off();
    EXPECT_FALSE(tap->next());
  }
  EXPECT_EQ(read_count, 75U * 50);
}

}  // namespace
}  // namespace rtpm::rpc
