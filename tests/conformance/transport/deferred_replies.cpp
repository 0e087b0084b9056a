#include <atomic>
#include <thread>

#include "deferred_suite.hpp"

// Calls that are answered later, with many items, before they run, or not at all.
namespace rtpm::rpc::test {
namespace {

using namespace std::chrono_literals;

TEST_P(DeferredReplies, ComeFromAnotherThread) {
  std::thread worker([&] { answer(servant_.reply(), "done"); });
  const auto reply = binding_->call(kLater, bytes_of("x"));
  worker.join();
  ASSERT_TRUE(reply) << to_string(reply.error());
  EXPECT_EQ(text_of(*reply), "done");
  EXPECT_EQ(server_->counters().deferred_count, 1u);
}

TEST_P(DeferredReplies, LetTheLaneServeOthersMeanwhile) {
  auto first = binding_->begin(kLater, bytes_of("1"));
  ASSERT_TRUE(first);
  DeferredReply held = servant_.reply();
  EXPECT_TRUE(binding_->call(kNote, bytes_of("meanwhile")));
  EXPECT_FALSE(first->is_done());
  answer(std::move(held), "at last");
  const auto reply = first->take();
  ASSERT_TRUE(reply) << to_string(reply.error());
  EXPECT_EQ(text_of(*reply), "at last");
}

TEST_P(DeferredReplies, GoToTheirOwnCallersInAnyOrder) {
  auto first = binding_->begin(kLater, bytes_of("1"));
  ASSERT_TRUE(first);
  DeferredReply first_reply = servant_.reply();
  auto second = binding_->begin(kLater, bytes_of("2"));
  ASSERT_TRUE(second);
  answer(servant_.reply(), "second");
  EXPECT_EQ(text_of(*second->take()), "second");
  answer(std::move(first_reply), "first");
  EXPECT_EQ(text_of(*first->take()), "first");
}

TEST_P(DeferredReplies, MayBeLarge) {
  const std::string large(1 << 20, 'q');
  std::thread worker([&] { answer(servant_.reply(), large); });
  const auto reply = binding_->call(kLater, {});
  worker.join();
  ASSERT_TRUE(reply) << to_string(reply.error());
  EXPECT_EQ(text_of(*reply), large);
}

TEST_P(DeferredReplies, FailIfTheServantDropsThem) {
  std::thread worker([&] { static_cast<void>(servant_.reply()); });
  expect_error(binding_->call(kLater, {}), CallError::kServantFailed);
  worker.join();
}

TEST_P(DeferredReplies, AreRefusedBeyondTheLimit) {
  std::vector<PendingReply> pending;
  std::vector<DeferredReply> held;
  const std::uint32_t count = ServerConfig{}.deferred_call_count_max;
  for (std::uint32_t i = 0; i < count; ++i) {
    auto begun = binding_->begin(kLater, {});
    ASSERT_TRUE(begun) << to_string(begun.error());
    pending.push_back(std::move(*begun));
    held.push_back(servant_.reply());
  }
  expect_error(binding_->call(kLater, {}), CallError::kOverload);
  answer(std::move(held.back()), "room again");
  EXPECT_EQ(text_of(*pending.back().take()), "room again");
  EXPECT_TRUE(binding_->begin(kLater, {}));
}

TEST_P(DeferredReplies, ReportCancellationToTheServant) {
  auto call = binding_->begin(kLater, {});
  ASSERT_TRUE(call);
  DeferredReply held = servant_.reply();
  EXPECT_TRUE(held.is_awaited());
  call->cancel();
  expect_error(call->take(), CallError::kCancelled);
  EXPECT_TRUE(await([&] { return !held.is_awaited(); }));
  answer(std::move(held), "in vain");
  EXPECT_TRUE(binding_->call(kNote, {})) << "nothing is disturbed by it";
}

TEST_P(DeferredReplies, EndWithTheServer) {
  auto call = binding_->begin(kLater, {});
  ASSERT_TRUE(call);
  DeferredReply held = servant_.reply();
  server_->stop();
  EXPECT_FALSE(held.is_awaited());
  expect_error(call->take(), CallError::kStopped);
  server_.reset();
  // The servant may answer after the server has ended.
  answer(std::move(held), "too late");
}

TEST_P(DeferredReplies, TimeOutLikeAnyOther) {
  expect_error(binding_->call(kLater, {}, {.deadline = 100ms}), CallError::kTimeout);
  answer(servant_.reply(), "late");
  EXPECT_TRUE(binding_->call(kNote, {}));
}

// The schema's priority applies if the caller that adds the object gives none.
TEST_P(DeferredReplies, RunAtThePriorityOfTheirInterface) {
  class Declared final : public Servant {
   public:
    const InterfaceDescriptor& interface() const noexcept override { return interface_; }
    DispatchResult dispatch(std::uint16_t, ConstBytes, MutableBytes,
                            const CallContext& context) override {
      seen = context.priority.value();
      return {};
    }
    std::atomic<int> seen{-1};

   private:
    InterfaceDescriptor interface_{.name = "test.Late",
                                   .fingerprint = 4712,
                                   .methods = kDeferredMethods,
                                   .priority_model = PriorityModel::kServerDeclared,
                                   .priority = 777};
  };
  Declared servant;
  auto server = *Server::create(quiet_config());
  ASSERT_TRUE(server->add("declared", servant));
  ASSERT_TRUE(server->start());
  auto binding = Binding::bind(node_, server->url("declared"), kDeferredInterface,
                               {.deadline = rtpm::test::kPatience});
  ASSERT_TRUE(binding) << binding.error().text();
  EXPECT_TRUE(binding->call(kNote, {}, {.priority = 5}));
  EXPECT_EQ(servant.seen, 777);
}

// --- oneways -------------------------------------------------------------------------------------

TEST_P(DeferredReplies, OnewaysRunInOrderWithoutBeingWaitedFor) {
  for (const char* text : {"a", "b", "c"}) {
    ASSERT_TRUE(binding_->send(kNote, bytes_of(text), wire::Delivery::kSent));
  }
  EXPECT_TRUE(await([&] { return servant_.notes().size() == 3; }));
  EXPECT_EQ(servant_.notes(), (std::vector<std::string>{"a", "b", "c"}));
}

TEST_P(DeferredReplies, OnewaysAreConfirmedBeforeTheyEnd) {
  // The method ends only later, and its caller does not wait for it.
  ASSERT_TRUE(binding_->send(kLater, {}, wire::Delivery::kReceipt));
  answer(servant_.reply(), "nobody gets this");
  EXPECT_TRUE(binding_->call(kNote, {}));
}

TEST_P(DeferredReplies, OnewaysThatRunHaveRun) {
  ASSERT_TRUE(binding_->send(kNote, bytes_of("ran"), wire::Delivery::kReply));
  EXPECT_EQ(servant_.notes(), std::vector<std::string>{"ran"});
}

TEST_P(DeferredReplies, LargeOnewaysAreConfirmedAtLeast) {
  const std::string large(200'000, 'l');
  ASSERT_TRUE(binding_->send(kNote, bytes_of(large), wire::Delivery::kSent));
  EXPECT_TRUE(await([&] { return servant_.notes().size() == 1; }));
  EXPECT_EQ(servant_.notes().front(), large);
}

// --- streams -------------------------------------------------------------------------------------

TEST_P(DeferredReplies, StreamsBringEveryItemInOrder) {
  constexpr int kItemCount = 2000;
  auto reader = binding_->open_stream(kCount, {});
  ASSERT_TRUE(reader) << to_string(reader.error());
  std::thread producer([&] {
    ItemWriter writer = servant_.writer();
    for (int i = 0; i < kItemCount; ++i)
      write(writer, std::to_string(i));
    writer.finish();
  });
  for (int i = 0; i < kItemCount; ++i) {
    const std::string text = text_of_next(*reader);
    if (text == std::to_string(i)) continue;
    ADD_FAILURE() << "item " << i << " is " << text;
    break;
  }
  EXPECT_EQ(text_of_next(*reader), "(end)");
  EXPECT_FALSE(reader->is_open());
  producer.join();
}

TEST_P(DeferredReplies, StreamsWaitForTheirReader) {
  constexpr std::uint32_t kWindow = 4;
  auto reader = binding_->open_stream(kCount, {}, {.window = kWindow});
  ASSERT_TRUE(reader);
  ItemWriter writer = servant_.writer();
  std::uint32_t count = 0;
  // The writer's own buffer, and the items in flight.
  while (writer.write(bytes_of("x")))
    ++count;
  EXPECT_GE(count, 32u);
  EXPECT_LE(count, 32u + kWindow);
  EXPECT_EQ(writer.write(bytes_of("x")).error(), StreamError::kFull);
  EXPECT_EQ(text_of_next(*reader), "x");
  EXPECT_TRUE(await([&] {
    // Items are requested when half of the window has been taken.
    EXPECT_EQ(text_of_next(*reader), "x");
    return writer.write(bytes_of("y")).has_value();
  }));
  writer.finish();
}

TEST_P(DeferredReplies, StreamsEndForTheWriterWhenTheReaderDisconnects) {
  auto reader = binding_->open_stream(kCount, {});
  ASSERT_TRUE(reader);
  ItemWriter writer = servant_.writer();
  write(writer, "first");
  EXPECT_EQ(text_of_next(*reader), "first");
  reader->cancel();
  EXPECT_TRUE(await([&] { return !writer.is_awaited(); }));
  EXPECT_EQ(writer.write(bytes_of("more")).error(), StreamError::kEnded);
  EXPECT_TRUE(binding_->call(kNote, {})) << "the channel serves other calls again";
}

TEST_P(DeferredReplies, StreamsEndWithTheServantsStatus) {
  auto reader = binding_->open_stream(kCount, {});
  ASSERT_TRUE(reader);
  ItemWriter writer = servant_.writer();
  write(writer, "one");
  writer.finish(wire::Status::kGone);
  EXPECT_EQ(text_of_next(*reader), "one");
  EXPECT_EQ(text_of_next(*reader), to_string(CallError::kNoSuchObject));
}

TEST_P(DeferredReplies, StreamsMayBeClosedWithUnreadItems) {
  for (int i = 0; i < 3; ++i) {
    auto reader = binding_->open_stream(kCount, {});
    ASSERT_TRUE(reader);
    ItemWriter writer = servant_.writer();
    write(writer, "one");
    write(writer, "two");
    writer.finish();
    EXPECT_EQ(text_of_next(*reader), "one");
    // The end of the stream may have arrived by now; the second item is left.
    static_cast<void>(binding_->call(kNote, {}));
  }
  EXPECT_TRUE(binding_->call(kNote, {})) << "their channel serves other calls again";
}

TEST_P(DeferredReplies, StreamsEndWithTheServer) {
  auto reader = binding_->open_stream(kCount, {});
  ASSERT_TRUE(reader);
  ItemWriter writer = servant_.writer();
  server_->stop();
  EXPECT_FALSE(writer.is_awaited());
  EXPECT_EQ(text_of_next(*reader), to_string(CallError::kStopped));
}

TEST_P(DeferredReplies, StreamsLetTheirReaderDoOtherThings) {
  auto reader = binding_->open_stream(kCount, {});
  ASSERT_TRUE(reader);
  ItemWriter writer = servant_.writer();
  EXPECT_EQ(reader->next(rt::now() + 1ms).error(), CallError::kTimeout);
  EXPECT_TRUE(reader->is_open()) << "there is none yet, that is all";
  write(writer, "now");
  EXPECT_EQ(text_of_next(*reader), "now");
}

TEST_P(DeferredReplies, StreamsAreRefusedBeyondTheLimit) {
  std::vector<ItemReader> readers;
  std::vector<ItemWriter> writers;
  for (std::uint32_t i = 0; i < ServerConfig{}.stream_count_max; ++i) {
    auto reader = binding_->open_stream(kCount, {});
    ASSERT_TRUE(reader) << to_string(reader.error());
    readers.push_back(std::move(*reader));
    writers.push_back(servant_.writer());
  }
  auto reader = binding_->open_stream(kCount, {});
  ASSERT_TRUE(reader);
  EXPECT_EQ(text_of_next(*reader), to_string(CallError::kOverload));
}

// hp-5.10-12
TEST_P(DeferredReplies, RefuseAStreamToAPlainCall) {
  expect_error(binding_->call(kCount, {}), CallError::kBadRequest);
}

INSTANTIATE_TEST_SUITE_P(Udp, DeferredReplies, testing::Values(Transport::kUdp));
INSTANTIATE_TEST_SUITE_P(Tcp, DeferredReplies, testing::Values(Transport::kTcp));
INSTANTIATE_TEST_SUITE_P(SealedUdp, DeferredReplies, testing::Values(kSealedUdp));
INSTANTIATE_TEST_SUITE_P(SealedTcp, DeferredReplies, testing::Values(kSealedTcp));
INSTANTIATE_TEST_SUITE_P(SharedMemory, DeferredReplies, testing::Values(Transport::kSharedMemory));

}  // namespace
}  // namespace rtpm::rpc::test
