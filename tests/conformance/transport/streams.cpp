#include <atomic>
#include <numeric>
#include <thread>

#include "deferred_suite.hpp"
#include "rtpm/transport/client_transport.hpp"
#include "rtpm/transport/shared_memory.hpp"
#include "rtpm/wire/client_channel.hpp"
#include "rtpm/wire/control.hpp"

// Streams with items of all sizes, and with slow readers.
namespace rtpm::rpc::test {
namespace {

using namespace std::chrono_literals;

bool is_item(ConstBytes bytes, std::uint32_t number, std::size_t size) {
  return std::ranges::equal(bytes, item_of(number, size));
}

class Streams : public DeferredReplies {
 protected:
  explicit Streams(ServerConfig config = quiet_config()) : DeferredReplies(std::move(config)) {}

  /// Writes items until `count` are written, as the reader accepts them.
  static void write_all(ItemWriter& writer, std::uint32_t count, std::size_t size) {
    for (std::uint32_t number = 0; number < count; ++number) {
      const auto item = item_of(number, size);
      expected<void, StreamError> written;
      ASSERT_TRUE(await([&] {
        written = writer.write(item);
        return written || written.error() != StreamError::kFull;
      })) << number;
      ASSERT_TRUE(written) << to_string(written.error());
    }
  }
  /// Writes items until the caller no longer keeps up; returns their number.
  static std::uint32_t write_until_full(ItemWriter& writer, std::size_t size) {
    for (std::uint32_t number = 0;; ++number) {
      const auto written = writer.write(item_of(number, size));
      if (written) continue;
      EXPECT_EQ(written.error(), StreamError::kFull);
      return number;
    }
  }
  static void read_all(ItemReader& reader, std::uint32_t count, std::size_t size) {
    for (std::uint32_t number = 0; number < count; ++number) {
      const auto item = reader.next(soon());
      ASSERT_TRUE(item) << number << ": " << to_string(item.error());
      ASSERT_TRUE(*item) << number;
      ASSERT_TRUE(is_item(**item, number, size)) << number;
    }
  }
};

// The items are a camera's frames.   hp-5.10-9
TEST_P(Streams, BringLargeItemsWholeAndInOrder) {
  constexpr std::uint32_t kItemCount = 30;
  constexpr std::size_t kSize = std::size_t{256} * 1024;
  for (const std::uint32_t window : {1U, 16U}) {
    auto reader = binding_->open_stream(kCount, {}, {.window = window});
    ASSERT_TRUE(reader) << to_string(reader.error());
    std::thread producer([&] {
      ItemWriter writer = servant_.writer();
      write_all(writer, kItemCount, kSize);
      writer.finish();
    });
    read_all(*reader, kItemCount, kSize);
    EXPECT_EQ(text_of_next(*reader), "(end)");
    producer.join();
  }
}

TEST_P(Streams, BringItemsOfAllSizesInOrder) {
  const std::vector<std::size_t> sizes{0,       1,         1344,  1345,    9000,   16320,
                                       16321,   65472,     65473, 100'000, 43'008, 43'009,
                                       700'001, 1'300'000, 5,     200'000, 0,      3};
  auto reader = binding_->open_stream(kCount, {});
  ASSERT_TRUE(reader);
  std::thread producer([&] {
    ItemWriter writer = servant_.writer();
    for (std::uint32_t number = 0; number < sizes.size(); ++number) {
      const auto item = item_of(number, sizes[number]);
      EXPECT_TRUE(await([&] { return writer.write(item).has_value(); })) << number;
    }
    writer.finish();
  });
  for (std::uint32_t number = 0; number < sizes.size(); ++number) {
    const auto item = reader->next(soon());
    ASSERT_TRUE(item && *item) << number;
    EXPECT_TRUE(is_item(**item, number, sizes[number])) << number;
  }
  EXPECT_EQ(text_of_next(*reader), "(end)");
  producer.join();
}

// hp-5.10-10
TEST_P(Streams, AcceptItemsAsLargeAsMessagesAndReportLargerOnes) {
  auto reader = binding_->open_stream(kCount, {});
  ASSERT_TRUE(reader);
  ItemWriter writer = servant_.writer();
  EXPECT_EQ(writer.item_size_max(), message_size_max());
  EXPECT_EQ(writer.item_frame_size_max(), frame_payload_max());
  EXPECT_TRUE(writer.write(item_of(0, message_size_max())));
  read_all(*reader, 1, message_size_max());
  const std::vector<std::byte> larger(message_size_max() + 1);
  EXPECT_EQ(writer.write(larger).error(), StreamError::kTooLarge);
  EXPECT_TRUE(writer.write(item_of(0, 5))) << "it may go on without";
  read_all(*reader, 1, 5);
  EXPECT_EQ(writer.write(larger).error(), StreamError::kTooLarge);
  writer.finish(wire::Status::kServantFailed);
  EXPECT_EQ(text_of_next(*reader), to_string(CallError::kTooLarge));
}

// hp-5.10-10: the smaller of both limits.
TEST_P(Streams, AcceptItemsUpToTheReadersLimit) {
  NodeConfig config = node_config();
  config.message_size_max = 70'000;
  Node node(config);
  auto binding = Binding::bind(node, server_->url("late"), kDeferredInterface,
                               {.deadline = rtpm::test::kPatience});
  ASSERT_TRUE(binding) << binding.error().text();
  auto reader = binding->open_stream(kCount, {});
  ASSERT_TRUE(reader);
  ItemWriter writer = servant_.writer();
  EXPECT_EQ(writer.item_size_max(), 70'000U);
  EXPECT_TRUE(writer.write(item_of(0, 70'000)));
  read_all(*reader, 1, 70'000);
}

// hp-16.4-2: items beyond the ring's capacity wait at the server.
TEST_P(Streams, WaitForASlowReader) {
  for (const std::size_t size : {std::size_t{100}, std::size_t{4000}, std::size_t{9000},
                                 std::size_t{20'000}, std::size_t{300'000}}) {
    SCOPED_TRACE(std::to_string(size) + " bytes");
    auto reader = binding_->open_stream(kCount, {}, {.window = 32});
    ASSERT_TRUE(reader);
    ItemWriter writer = servant_.writer();
    std::uint32_t count = write_until_full(writer, size);
    EXPECT_GT(count, 1U);
    // Waits until nothing moves any more.
    std::this_thread::sleep_for(20ms);
    while (writer.write(item_of(count, size)))
      ++count;
    EXPECT_TRUE(writer.is_awaited());
    EXPECT_LE(count * size, 3'000'000U) << "what is on its way is bounded";
    std::thread producer([&] { writer.finish(); });
    read_all(*reader, count, size);
    EXPECT_EQ(text_of_next(*reader), "(end)");
    producer.join();
  }
  EXPECT_EQ(server_->counters().send_failure_count, 0U);
  EXPECT_EQ(server_->counters().connection_lost_count, 0U);
}

TEST_P(Streams, HoldNoMoreThanTheirBytes) {
  auto reader = binding_->open_stream(kCount, {}, {.window = 1});
  ASSERT_TRUE(reader);
  ItemWriter writer = servant_.writer();
  const std::uint32_t count = write_until_full(writer, 200'000);
  EXPECT_GE(count, 5U);
  EXPECT_LE(count, 7U) << "1 MiB and what the reader takes at once";
  EXPECT_EQ(writer.write(item_of(0, 2'000'000)).error(), StreamError::kFull);
  read_all(*reader, count, 200'000);
  ASSERT_TRUE(await([&] { return writer.write(item_of(0, 2'000'000)).has_value(); }))
      << "a larger one goes alone";
  read_all(*reader, 1, 2'000'000);
}

// A stream whose server and reader both rest for longer than either waits for an answer. hp-5.10-7
TEST_P(Streams, OutliveAReaderThatDoesOtherThings) {
  auto reader = binding_->open_stream(kCount, {}, {.miss_count_max = kMissCountMin});
  ASSERT_TRUE(reader);
  ItemWriter writer = servant_.writer();
  ASSERT_TRUE(writer.write(item_of(0, 100)));
  read_all(*reader, 1, 100);
  // The reader's question is on its way when its wait ends.
  EXPECT_EQ(reader->next(rt::now() + 150ms).error(), CallError::kTimeout);
  std::this_thread::sleep_for(1600ms);
  EXPECT_TRUE(writer.is_awaited());
  EXPECT_EQ(reader->next(rt::now() + 1ms).error(), CallError::kTimeout);
  EXPECT_TRUE(reader->is_open());
  ASSERT_TRUE(writer.write(item_of(0, 100)));
  read_all(*reader, 1, 100);
}

// hp-5.10-7: a stream that ran is not reported as "not run".
TEST_P(Streams, ExpireForAReaderThatIsAwayTooLong) {
  auto reader = binding_->open_stream(kCount, {}, {.pause_max = 200ms});
  ASSERT_TRUE(reader);
  ItemWriter writer = servant_.writer();
  ASSERT_TRUE(writer.write(item_of(0, 100)));
  read_all(*reader, 1, 100);
  EXPECT_TRUE(await([&] { return !writer.is_awaited(); }));
  EXPECT_EQ(writer.ending(), CallEnding::kSilent);
  EXPECT_EQ(writer.write(item_of(0, 1)).error(), StreamError::kEnded);
  EXPECT_EQ(text_of_next(*reader), to_string(CallError::kStreamLost));
  EXPECT_FALSE(reader->is_open());
}

// The lane's own sending waits for calls, and not the other way round.
TEST_P(Streams, LetCallsOfTheirLaneThrough) {
  auto reader = binding_->open_stream(kCount, {});
  ASSERT_TRUE(reader);
  std::atomic<bool> is_over{false};
  std::thread producer([&] {
    ItemWriter writer = servant_.writer();
    const auto item = item_of(0, std::size_t{256} * 1024);
    while (!is_over)
      static_cast<void>(writer.write(item));
    writer.finish();
  });
  std::atomic<int> item_count{0};
  std::thread consumer([&] {
    while (true) {
      const auto item = reader->next(soon());
      if (!item || !*item) break;
      ++item_count;
    }
  });
  for (int call = 0; call < 200; ++call)
    ASSERT_TRUE(binding_->call(kNote, {})) << call;
  EXPECT_TRUE(await([&] { return item_count > 20; }));
  is_over = true;
  consumer.join();
  producer.join();
}

INSTANTIATE_TEST_SUITE_P(Udp, Streams, testing::Values(Transport::kUdp));
INSTANTIATE_TEST_SUITE_P(Tcp, Streams, testing::Values(Transport::kTcp));
INSTANTIATE_TEST_SUITE_P(SealedUdp, Streams, testing::Values(kSealedUdp));
INSTANTIATE_TEST_SUITE_P(SealedTcp, Streams, testing::Values(kSealedTcp));
INSTANTIATE_TEST_SUITE_P(SharedMemory, Streams, testing::Values(Transport::kSharedMemory));

/// A client with eight streams on one connection, which reads when the test asks for it.
class StreamsOfOneConnection : public DeferredReplies {
 protected:
  using Kind = wire::ChannelEvent::Kind;
  static constexpr std::uint16_t kStreamCount = wire::kCallWindow;
  static constexpr std::size_t kItemSize = 40'000;

  void SetUp() override {
    DeferredReplies::SetUp();
    const std::uint16_t port = server_->port();
    auto opened = transport() == Transport::kTcp
                      ? transport::open_tcp_transport("127.0.0.1", port, 0,
                                                      wire::kStreamPayloadSizeMax, soon())
                      : transport::open_shared_memory_transport({"127.0.0.1", port}, 0, soon());
    ASSERT_TRUE(opened) << opened.error().text();
    client_ = std::move(*opened);
    send(channel_.open(0, soon(), rt::now()));
    ASSERT_EQ(next_event().kind, Kind::kReady);
    Bytes request(512);
    request.resize(wire::encode(wire::BindRequest{"late", "test.Late", 4712}, request));
    send(*channel_.call({.method = wire::kMethodBind, .deadline = soon()}, request, rt::now()));
    const wire::ChannelEvent bound = next_event();
    ASSERT_EQ(bound.kind, Kind::kReply);
    service_ = wire::decode_bind_reply(bound.payload)->service;
  }
  void send(ConstBytes frame) {
    for (; !frame.empty(); frame = channel_.next_frame(rt::now()))
      ASSERT_TRUE(client_->send(frame));
  }
  wire::CallIndex open_stream() {
    const std::size_t frame_size = frame_payload_max();
    const std::uint32_t byte_window = wire::stream_byte_window(wire::Medium::kStream, frame_size);
    Bytes& frames = memory_.emplace_back(
        frame_size * wire::stream_frame_count(wire::Medium::kStream, 32, byte_window));
    Bytes& item = memory_.emplace_back(kItemSize);
    wire::CallParameters wanted{
        .service = service_, .method = kCount.id, .deadline = kNever, .stream_window = 32};
    wanted.stream_buffers = {.frames = frames,
                             .frame_size = static_cast<std::uint32_t>(frame_size),
                             .item = item,
                             .byte_window = byte_window};
    send(*channel_.call(wanted, {}, rt::now()));
    return channel_.last_call();
  }
  /// The next event, except nothing and frames to send.
  wire::ChannelEvent next_event() {
    while (rt::now() < soon()) {
      const auto frame = client_->receive();
      if (!frame && frame.error() != transport::IoError::kNothing) break;
      const MonotonicTime now = rt::now();
      const wire::ChannelEvent event =
          frame ? channel_.on_frame(*frame, now) : channel_.on_time(now);
      send(event.frame);
      if (event.kind != Kind::kNothing && event.kind != Kind::kSend) return event;
      if (!frame) client_->wait(now + 1ms);
    }
    return {.kind = Kind::kBroken};
  }

  std::unique_ptr<transport::ClientTransport> client_;
  std::deque<Bytes> memory_;
  Bytes buffer_ = Bytes(4096);
  wire::ClientChannel channel_{{.medium = wire::Medium::kStream,
                                .client_epoch = 5,
                                .message_size_max = 1 << 20,
                                .open_call_max = kStreamCount},
                               buffer_};
  std::uint32_t service_ = 0;
};

// hp-16.4-2: together they have more to send than a connection holds.
TEST_P(StreamsOfOneConnection, WaitForItsBufferSpace) {
  constexpr std::uint32_t kItemCount = 20;
  std::vector<std::uint32_t> next(kStreamCount);
  std::vector<ItemWriter> writers;
  for (int i = 0; i < kStreamCount; ++i) {
    static_cast<void>(open_stream());
    writers.push_back(servant_.writer());
  }
  for (ItemWriter& writer : writers) {
    for (std::uint32_t number = 0; number < kItemCount; ++number)
      ASSERT_TRUE(writer.write(item_of(number, kItemSize)));
    writer.finish();
  }
  // The client does not read for a while.
  std::this_thread::sleep_for(50ms);
  int ended = 0;
  while (ended < kStreamCount) {
    const wire::ChannelEvent event = next_event();
    ASSERT_TRUE(event.kind == Kind::kItems || event.kind == Kind::kReply)
        << "the connection ended: " << static_cast<int>(event.kind);
    while (const auto item = channel_.next_item(event.call)) {
      ASSERT_TRUE(is_item(*item, next[event.call], kItemSize));
      ++next[event.call];
    }
    send(channel_.next_frame(rt::now()));
    if (event.kind == Kind::kReply) ++ended;
  }
  EXPECT_EQ(next, std::vector<std::uint32_t>(kStreamCount, kItemCount));
  EXPECT_EQ(server_->counters().connection_lost_count, 0U);
}

INSTANTIATE_TEST_SUITE_P(Tcp, StreamsOfOneConnection, testing::Values(Transport::kTcp));
INSTANTIATE_TEST_SUITE_P(SharedMemory, StreamsOfOneConnection,
                         testing::Values(Transport::kSharedMemory));

}  // namespace
}  // namespace rtpm::rpc::test
