#include "rtpm/transport/datagram_batch.hpp"

#include <array>
#include <vector>

#include "frames.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/transport/client_transport.hpp"
#include "rtpm/transport/stream.hpp"
#include "rtpm/transport/tcp.hpp"
#include "rtpm/transport/udp.hpp"

namespace rtpm::transport {
namespace {

using namespace test;
using namespace std::chrono_literals;

constexpr const char* kHere = "127.0.0.1";
constexpr wire::PeerAddress kPeer{.low = 1, .port = 2};

DatagramBatch batch_of(const std::vector<Bytes>& frames) {
  DatagramBatch batch = DatagramBatch::allocate();
  for (const Bytes& frame : frames)
    EXPECT_TRUE(batch.add(frame));
  return batch;
}

std::vector<Bytes> frames_of(std::size_t count, std::size_t size, std::size_t last_size) {
  std::vector<Bytes> frames;
  for (std::size_t i = 0; i < count; ++i) {
    const bool is_last = i + 1 == count;
    frames.push_back(frame_of(is_last ? last_size : size, 0, static_cast<std::uint32_t>(i)));
  }
  return frames;
}

std::vector<Bytes> frames_in(const DatagramBatch& batch) {
  std::vector<Bytes> frames;
  EXPECT_TRUE(batch.for_each([&](ConstBytes frame) {
    frames.push_back(copy_of(frame));
    return true;
  }));
  return frames;
}

TEST(DatagramBatch, AcceptsFramesOfOneSizeAndASmallerLast) {
  DatagramBatch batch = batch_of(frames_of(3, 48, 10));
  EXPECT_EQ(frames_in(batch), frames_of(3, 48, 10));
  EXPECT_EQ(batch.frame_size(), 48 + wire::kHeaderSize);
  EXPECT_FALSE(batch.add(frame_of(10))) << "behind a smaller one is the end";
  batch.clear();
  EXPECT_TRUE(batch.is_empty());
  EXPECT_TRUE(batch.add(frame_of(10)));
  EXPECT_FALSE(batch.add(frame_of(11))) << "larger than the first";
  EXPECT_EQ(frames_in(batch), std::vector<Bytes>{frame_of(10)});
}

TEST(DatagramBatch, AcceptsAWindowOfTheLargestFrames) {
  const Bytes largest = frame_of(wire::kDatagramPayloadSizeMax);
  DatagramBatch batch = DatagramBatch::allocate();
  for (std::size_t i = 0; i < wire::kFragmentWindow; ++i)
    ASSERT_TRUE(batch.add(largest)) << i;
  EXPECT_FALSE(batch.add(largest));
  EXPECT_EQ(batch.bytes().size(), DatagramBatch::kSizeMax);
  batch.clear();
  for (std::size_t i = 0; i < DatagramBatch::kFrameCountMax; ++i)
    ASSERT_TRUE(batch.add(frame_of(0)));
  EXPECT_FALSE(batch.add(frame_of(0))) << "bytes are left, but the system limits the count";
}

TEST(DatagramBatch, RefusesFramesWithoutMemory) {
  DatagramBatch none;
  EXPECT_FALSE(none.is_allocated());
  EXPECT_FALSE(none.add(frame_of(0)));
  DatagramBatch batch = DatagramBatch::allocate();
  EXPECT_FALSE(batch.add(frame_of(wire::kStreamPayloadSizeMax)));
  EXPECT_TRUE(batch.is_empty());
}

TEST(Datagrams, AreReturnedOneByOneAndAligned) {
  alignas(16) std::array<std::byte, 250> buffer{};
  for (std::size_t i = 0; i < buffer.size(); ++i)
    buffer[i] = static_cast<std::byte>(i);
  const std::array original = buffer;
  Datagrams datagrams(buffer, 100, kPeer);
  EXPECT_TRUE(datagrams.are_several());
  std::size_t at = 0;
  for (const std::size_t size : {100u, 100u, 50u}) {
    EXPECT_FALSE(datagrams.is_empty());
    const auto datagram = datagrams.next();
    ASSERT_TRUE(datagram);
    EXPECT_EQ(reinterpret_cast<std::uintptr_t>(datagram->data()) % 16, 0u);
    EXPECT_EQ(copy_of(*datagram), copy_of(ConstBytes(original).subspan(at, size)));
    at += size;
  }
  EXPECT_TRUE(datagrams.is_empty());
  EXPECT_FALSE(datagrams.next());
}

TEST(Datagrams, AreOneDatagramWithoutBytes) {
  Datagrams datagrams(MutableBytes{}, 0, kPeer);
  const auto datagram = datagrams.next();
  ASSERT_TRUE(datagram) << "an empty datagram is counted, too";
  EXPECT_TRUE(datagram->empty());
  EXPECT_FALSE(datagrams.next());
}

TEST(Datagrams, AreTruncatedBehindTheLargestFrame) {
  alignas(16) std::array<std::byte, 5000> buffer{};
  Datagrams datagrams(buffer, 3000, kPeer);
  EXPECT_EQ(datagrams.next()->size(), wire::kDatagramFrameSizeMax + 1);
  EXPECT_EQ(datagrams.next()->size(), wire::kDatagramFrameSizeMax + 1);
  EXPECT_FALSE(datagrams.next());
}

// A caller that waits for its reply pauses; a caller that does not pause can use batches.
TEST(BatchEstimator, StartsWhenOnePeerSendsWithoutPauses) {
  using Change = BatchEstimator::Change;
  BatchEstimator estimator;
  MonotonicTime now{1s};
  for (int i = 0; i < 100; ++i) {
    EXPECT_EQ(estimator.on_datagrams(kPeer, false, now += 5us), Change::kNone);
    estimator.on_nothing();
  }
  for (int i = 0; i < 100; ++i)
    EXPECT_EQ(estimator.on_datagrams(kPeer, false, now += 30us), Change::kNone);
  for (std::uint32_t i = 0; i < 100; ++i) {
    const wire::PeerAddress one_of_two{.low = 1, .port = i % 2};
    EXPECT_EQ(estimator.on_datagrams(one_of_two, false, now += 5us), Change::kNone);
  }
  Change change = Change::kNone;
  for (int i = 0; i < 8 && change == Change::kNone; ++i)
    change = estimator.on_datagrams(kPeer, false, now += 5us);
  EXPECT_EQ(change, Change::kBegin);
  EXPECT_TRUE(estimator.is_on());
}

TEST(BatchEstimator, StopsWithoutBatchesForLong) {
  using Change = BatchEstimator::Change;
  BatchEstimator estimator;
  MonotonicTime now{1s};
  while (!estimator.is_on())
    static_cast<void>(estimator.on_datagrams(kPeer, false, now += 1us));
  for (int i = 0; i < 1000; ++i)
    EXPECT_EQ(estimator.on_datagrams(kPeer, i % 100 == 0, now += 1us), Change::kNone) << i;
  Change change = Change::kNone;
  for (int i = 0; i < 300 && change == Change::kNone; ++i)
    change = estimator.on_datagrams(kPeer, false, now += 1us);
  EXPECT_EQ(change, Change::kEnd);
  EXPECT_FALSE(estimator.is_on());
  EXPECT_TRUE(estimator.may_be_left()) << "some may have come while batches were taken";
  estimator.on_nothing();
  EXPECT_FALSE(estimator.may_be_left());
}

/// A port and a client connected to it.
struct Ends {
  Ends() {
    const auto listener = TcpListener::open(kHere, 0);
    auto opened = UdpPort::open({.port = listener->port()});
    EXPECT_TRUE(opened) << opened.error().text();
    port.emplace(std::move(*opened));
    client = std::move(*open_udp_transport(kHere, listener->port(), 0));
  }
  /// The next datagrams at the port, at most `count`; remembers the last sender.
  std::vector<Bytes> receive(std::size_t count) {
    std::vector<Bytes> frames;
    while (frames.size() < count && wait_readable(port->descriptor(), rt::now() + 20s)) {
      auto datagrams = port->receive(buffer);
      if (!datagrams) continue;
      ++receive_count;
      port->note(*datagrams, MonotonicTime{1s});
      peer = datagrams->peer();
      while (const auto frame = datagrams->next())
        frames.push_back(copy_of(*frame));
    }
    return frames;
  }
  /// The next datagrams at the client.
  std::vector<Bytes> receive_at_client(std::size_t count) {
    std::vector<Bytes> frames;
    while (frames.size() < count) {
      const auto frame = client->await(rt::now() + 20s);
      if (!frame) break;
      EXPECT_EQ(reinterpret_cast<std::uintptr_t>(frame->data()) % 16, 0u);
      frames.push_back(copy_of(*frame));
      if (client->has_buffered()) ++buffered_count;
    }
    return frames;
  }

  std::optional<UdpPort> port;
  std::unique_ptr<ClientTransport> client;
  std::vector<std::byte> buffer = std::vector<std::byte>(Datagrams::kSizeMax);
  wire::PeerAddress peer{};
  int receive_count = 0;
  int buffered_count = 0;
};

TEST(UdpBatch, ArrivesAsDatagramsByDefault) {
  Ends ends;
  const auto requests = frames_of(3, 50, 7);
  ASSERT_TRUE(ends.client->send_batch(batch_of(requests)));
  EXPECT_EQ(ends.receive(3), requests);
  EXPECT_EQ(ends.receive_count, 3);
  const auto replies = frames_of(5, 48, 48);
  ASSERT_TRUE(ends.port->send_batch(ends.peer, batch_of(replies)));
  EXPECT_EQ(ends.receive_at_client(5), replies);
  EXPECT_EQ(ends.buffered_count, 0);
}

TEST(UdpBatch, ArrivesWholeAtAClientThatAcceptsBatches) {
  Ends ends;
  ends.client->accept_batches();
  ASSERT_TRUE(ends.client->send(frame_of(1)));
  ASSERT_EQ(ends.receive(1).size(), 1u);
  for (const std::size_t last_size : {50u, 7u}) {
    const auto replies = frames_of(8, 50, last_size);
    ASSERT_TRUE(ends.port->send_batch(ends.peer, batch_of(replies)));
    ends.buffered_count = 0;
    EXPECT_EQ(ends.receive_at_client(8), replies);
    EXPECT_EQ(ends.buffered_count, 7) << "or the system has no batches";
  }
  // A single datagram is sent as without batches.
  ASSERT_TRUE(ends.port->send(ends.peer, frame_of(9)));
  EXPECT_EQ(ends.receive_at_client(1), std::vector<Bytes>{frame_of(9)});
}

TEST(UdpBatch, ArrivesWholeAtAPortThatExpectsBatches) {
  Ends ends;
  const auto requests = frames_of(8, 50, 50);
  for (int i = 0; i < 3; ++i) {
    ASSERT_TRUE(ends.client->send_batch(batch_of(requests)));
    ends.receive_count = 0;
    EXPECT_EQ(ends.receive(8), requests);
  }
  EXPECT_EQ(ends.receive_count, 1);
}

// A batch may arrive between the last look and the end of batches; then only its datagrams' own
// headers say how long they are.
TEST(UdpBatch, IsNotLostWhenBatchesHaveJustEnded) {
  Ends ends;
  const auto requests = frames_of(4, 50, 50);
  for (int i = 0; i < 3; ++i) {
    ASSERT_TRUE(ends.client->send_batch(batch_of(requests)));
    EXPECT_EQ(ends.receive(4), requests);
  }
  for (int i = 0; i < 256; ++i)
    ASSERT_TRUE(ends.client->send(frame_of(50)));
  const auto last = frames_of(6, 50, 20);
  ASSERT_TRUE(ends.client->send_batch(batch_of(last)));
  EXPECT_EQ(ends.receive(256).size(), 256u);
  EXPECT_EQ(ends.receive(6), last);
}

TEST(UdpBatch, CarriesAWindowOfTheLargestFrames) {
  Ends ends;
  ends.client->accept_batches();
  const auto frames = frames_of(wire::kFragmentWindow, wire::kDatagramPayloadSizeMax,
                                wire::kDatagramPayloadSizeMax);
  ASSERT_TRUE(ends.client->send_batch(batch_of(frames)));
  EXPECT_EQ(ends.receive(frames.size()), frames);
  ASSERT_TRUE(ends.port->send_batch(ends.peer, batch_of(frames)));
  EXPECT_EQ(ends.receive_at_client(frames.size()), frames);
}

TEST(TcpBatch, ArrivesAsConsecutiveFrames) {
  auto listener = TcpListener::open(kHere, 0);
  ASSERT_TRUE(listener);
  const auto client = open_tcp_transport(kHere, listener->port(), 0, 10'000, rt::now() + 20s);
  ASSERT_TRUE(client) << client.error().text();
  ASSERT_TRUE(wait_readable(listener->descriptor(), rt::now() + 20s));
  FrameStream served(listener->accept().socket, 10'000);
  const auto frames = frames_of(5, 100, 30);
  ASSERT_TRUE((*client)->send_batch(batch_of(frames)));
  std::vector<Bytes> received;
  while (received.size() < frames.size()) {
    if (!served.has_buffered() && !wait_readable(served.descriptor(), rt::now() + 20s)) break;
    if (const auto frame = served.receive()) received.push_back(copy_of(*frame));
  }
  EXPECT_EQ(received, frames);
}

}  // namespace
}  // namespace rtpm::transport
