#include "rtpm/rpc/completions.hpp"

#include <functional>
#include <thread>

#include "deferred_suite.hpp"
#include "loop.hpp"

// Calls and streams of a thread that watches one descriptor, and polls only when it is readable.
namespace rtpm::rpc::test {
namespace {

using namespace std::chrono_literals;

class Readiness : public DeferredReplies {
 protected:
  Loop loop_;
};

TEST_P(Readiness, ComesWithAReply) {
  loop_.completions.then(binding_->begin(kLater, {}), loop_.keep());
  EXPECT_EQ(loop_.completions.poll(), 0u);
  std::thread worker([&] { answer(servant_.reply(), "done"); });
  loop_.run();
  worker.join();
  EXPECT_EQ(loop_.ends, std::vector<std::string>{"done"});
}

TEST_P(Readiness, ComesWithALargeReply) {
  const std::string large(1 << 20, 'q');
  loop_.completions.then(binding_->begin(kLater, {}), loop_.keep());
  std::thread worker([&] { answer(servant_.reply(), large); });
  loop_.run();
  worker.join();
  EXPECT_EQ(loop_.ends, std::vector{large});
}

TEST_P(Readiness, ComesWithEachOtherEnd) {
  Completions& completions = loop_.completions;
  completions.then(expected<PendingReply, CallError>{unexpected{CallError::kNoChannel}},
                   loop_.keep());
  EXPECT_TRUE(loop_.ends.empty()) << "callbacks run in poll()";
  loop_.run();
  completions.then(binding_->begin(kLater, {}), loop_.keep());
  static_cast<void>(servant_.reply());
  loop_.run();
  const CallNumber cancelled = completions.then(binding_->begin(kLater, {}), loop_.keep());
  const DeferredReply unwanted = servant_.reply();
  completions.cancel(cancelled);
  EXPECT_TRUE(loop_.is_readable(0));
  loop_.run();
  completions.cancel(cancelled);
  EXPECT_EQ(loop_.ends,
            (std::vector{text_of(CallError::kNoChannel), text_of(CallError::kServantFailed),
                         text_of(CallError::kCancelled)}));
  EXPECT_TRUE(await([&] { return !unwanted.is_awaited(); })) << "the server was notified";
  CallError late{};
  completions.then(binding_->begin(kLater, {}, {.deadline = 30ms}),
                   [&](const auto& reply) { late = reply.error(); });
  loop_.run();
  EXPECT_TRUE(is_late(late)) << to_string(late);
}

TEST_P(Readiness, ComesWithTheEndOfAServer) {
  loop_.completions.then(binding_->begin(kLater, {}), loop_.keep());
  const DeferredReply open = servant_.reply();
  std::thread worker([&] { server_->stop(); });
  loop_.run();
  worker.join();
  EXPECT_EQ(loop_.ends, std::vector{text_of(CallError::kStopped)});
}

TEST_P(Readiness, ComesWithItems) {
  constexpr int kItemCount = 200;
  int item_count = 0;
  std::optional<expected<void, CallError>> end;
  loop_.completions.then_each(
      binding_->open_stream(kCount, {}),
      [&](ConstBytes item) {
        EXPECT_EQ(std::string(reinterpret_cast<const char*>(item.data()), item.size()),
                  std::to_string(item_count++));
      },
      [&](const expected<void, CallError>& result) { end = result; });
  std::thread worker([&] {
    ItemWriter writer = servant_.writer();
    for (int i = 0; i < kItemCount; ++i)
      write(writer, std::to_string(i));
    writer.finish();
  });
  loop_.run();
  worker.join();
  EXPECT_EQ(item_count, kItemCount);
  EXPECT_TRUE(end && *end);
}

// Its callback adds a call, waits for it, and then cancels the stream.
TEST_P(Readiness, ComesWithItemsWhoseCallbacksUseTheLoop) {
  std::optional<expected<void, CallError>> end;
  CallNumber stream = 0;
  int item_count = 0;
  stream = loop_.completions.then_each(
      binding_->open_stream(kCount, {}),
      [&](ConstBytes) {
        ++item_count;
        loop_.completions.then(binding_->begin(kNote, {}), loop_.keep());
        loop_.run_until([&] { return !loop_.ends.empty(); });
        loop_.completions.cancel(stream);
      },
      [&](const expected<void, CallError>& result) { end = result; });
  ItemWriter writer = servant_.writer();
  write(writer, "1");
  write(writer, "2");
  loop_.run();
  EXPECT_EQ(item_count, 1);
  ASSERT_TRUE(end && !*end);
  EXPECT_EQ(end->error(), CallError::kCancelled);
  EXPECT_EQ(loop_.ends, std::vector<std::string>{""});
  EXPECT_TRUE(await([&] { return !writer.is_awaited(); })) << "the server was notified";
}

// A stream that was read before may have items that no frame announces any more.
TEST_P(Readiness, ComesWithItemsThatArrivedBefore) {
  auto reader = binding_->open_stream(kCount, {});
  ASSERT_TRUE(reader);
  ItemWriter writer = servant_.writer();
  for (const char* text : {"1", "2", "3"})
    write(writer, text);
  EXPECT_EQ(text_of_next(*reader), "1");
  std::string rest;
  loop_.completions.then_each(
      std::move(reader), [&](ConstBytes item) { rest += static_cast<char>(item.front()); },
      [](const auto&) {});
  loop_.run_until([&] { return rest == "23"; });
}

TEST_P(Readiness, ComesToAThreadOfCompletions) {
  auto thread = CompletionThread::start({.name = "replies"});
  ASSERT_TRUE(thread) << thread.error().text();
  std::atomic<int> item_count{0};
  std::atomic<int> reply_count{0};
  (*thread)->then_each(
      binding_->open_stream(kCount, {}), [&](ConstBytes) { ++item_count; }, [](const auto&) {});
  ItemWriter writer = servant_.writer();
  for (int i = 1; i <= 20; ++i) {
    (*thread)->then(binding_->begin(kNote, {}), [&](const auto&) { ++reply_count; });
    write(writer, "item");
    EXPECT_TRUE(await([&] { return reply_count == i && item_count == i; }));
  }
}

INSTANTIATE_TEST_SUITE_P(Udp, Readiness, testing::Values(Transport::kUdp));
INSTANTIATE_TEST_SUITE_P(Tcp, Readiness, testing::Values(Transport::kTcp));
INSTANTIATE_TEST_SUITE_P(SealedUdp, Readiness, testing::Values(kSealedUdp));
INSTANTIATE_TEST_SUITE_P(SealedTcp, Readiness, testing::Values(kSealedTcp));
INSTANTIATE_TEST_SUITE_P(SharedMemory, Readiness, testing::Values(Transport::kSharedMemory));
INSTANTIATE_TEST_SUITE_P(Local, Readiness, testing::Values(Transport::kLocal));

// Also over a network that loses frames: a call is repeated though nobody polls it.
TEST_P(TransportSuite, CompletesThirtyTwoCallsToFourServersByOneDescriptor) {
  std::array<EchoServer, 4> servers;
  Node node(node_config());
  std::vector<Binding> bindings;
  for (const EchoServer& server : servers)
    bindings.push_back(bind_echo(node, server));
  Loop loop;
  constexpr int kRoundCount = 4;
  std::vector<std::string> sent;
  for (int i = 0; i < 32 * kRoundCount; ++i) {
    sent.push_back(std::to_string(i));
    Binding& binding = bindings[static_cast<std::size_t>(i) % bindings.size()];
    loop.completions.then(binding.begin(echo::kEchoOnce, bytes_of(sent.back())), loop.keep());
    if (i % 32 == 31) loop.run();
  }
  std::ranges::sort(loop.ends);
  std::ranges::sort(sent);
  EXPECT_EQ(loop.ends, sent);
  int lost_count = 0;
  for (const EchoServer& server : servers) {
    EXPECT_EQ(server.servant.run_count(), 8 * kRoundCount);
    if (server.relay) lost_count += server.relay->lost_count();
  }
  EXPECT_EQ(lost_count > 0, transport() == kFaultyUdp);
  EXPECT_TRUE(bindings.front().call(echo::kEcho, {})) << "the channels serve other calls, too";
}

}  // namespace
}  // namespace rtpm::rpc::test
