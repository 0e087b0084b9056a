#include "rtpm/transport/stream.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <optional>
#include <random>
#include <thread>

#include "frames.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/test/os.hpp"
#include "rtpm/wire/sealed.hpp"

namespace rtpm::transport {
namespace {

using namespace test;
using namespace std::chrono_literals;

constexpr std::uint32_t kMessageSizeMax = 1000;

class FrameStreamTest : public testing::Test {
 protected:
  FrameStreamTest() : FrameStreamTest(stream_pair()) {}

  /// The result of receive(): a frame's bytes, or the error.
  expected<Bytes, IoError> receive() {
    const auto frame = stream_.receive();
    if (!frame) return unexpected{frame.error()};
    EXPECT_EQ(reinterpret_cast<std::uintptr_t>(frame->data()) % 16, 0u);
    return copy_of(*frame);
  }
  void expect_nothing() {
    const auto frame = receive();
    ASSERT_FALSE(frame);
    EXPECT_EQ(frame.error(), IoError::kNothing);
  }
  void expect_frame(const Bytes& expected_frame) {
    const auto frame = receive();
    ASSERT_TRUE(frame);
    EXPECT_EQ(*frame, expected_frame);
  }

  Descriptor far_;
  FrameStream stream_;

 private:
  explicit FrameStreamTest(std::pair<Descriptor, Descriptor> ends)
      : far_(std::move(ends.first)), stream_(std::move(ends.second), kMessageSizeMax) {}
};

// A poll reports when the rest arrives, so that the frame cannot be overlooked.
TEST_F(FrameStreamTest, CountsWholeFramesAsBuffered) {
  const Bytes frame = frame_of(20);
  for (const std::size_t part : {1u, 63u, 64u, 83u}) {
    Bytes all = frame;
    all.insert(all.end(), frame.begin(), frame.begin() + static_cast<std::ptrdiff_t>(part));
    write_all(far_, all);
    expect_frame(frame);
    EXPECT_FALSE(stream_.has_buffered()) << part;
    expect_nothing();
    write_all(far_, ConstBytes(frame).subspan(part));
    expect_frame(frame);
  }
}

// sec-4: counter and tag follow the payload, even for the largest message.
TEST_F(FrameStreamTest, ReturnsSealedFramesWithTheirTrailer) {
  for (const std::uint32_t size : {0u, 20u, kMessageSizeMax}) {
    Bytes frame = frame_of(size);
    wire::mark_sealed(frame.data());
    frame.resize(frame.size() + wire::kSealedTrailerSize);
    write_all(far_, ConstBytes(frame).first(frame.size() - 1));
    expect_nothing();
    write_all(far_, ConstBytes(frame).last(1));
    expect_frame(frame);
  }
}

// hp-2-2: where no frame may be sealed, a sealed header is malformed; the reader does not wait.
TEST_F(FrameStreamTest, DoesNotWaitForATrailerOfAPlainStream) {
  auto [far, near] = stream_pair();
  FrameStream plain(std::move(near), kMessageSizeMax, /*takes_sealed=*/false);
  Bytes frame = frame_of(0);
  wire::mark_sealed(frame.data());
  write_all(far, frame);
  const auto received = plain.receive();
  ASSERT_TRUE(received);
  EXPECT_EQ(copy_of(*received), frame);
}

TEST_F(FrameStreamTest, ReturnsTheHeaderOfATooLargeMessageAtOnce) {
  const Bytes frame = frame_of(kMessageSizeMax + 64);
  write_all(far_, ConstBytes(frame).first(wire::kHeaderSize));
  const auto given = receive();
  ASSERT_TRUE(given) << "a peer may not make the reader wait for it";
  const auto header = wire::decode_frame(*given);
  ASSERT_FALSE(header);
  EXPECT_EQ(header.error(), wire::DropReason::kBadLength);
}

TEST_F(FrameStreamTest, ReturnsGarbageUnchanged) {
  const Bytes garbage(100, std::byte{0x55});
  write_all(far_, garbage);
  const auto given = receive();
  ASSERT_TRUE(given);
  EXPECT_EQ(given->size(), wire::kHeaderSize);
  EXPECT_FALSE(wire::decode_frame(*given));
}

TEST_F(FrameStreamTest, ReturnsFramesInOrderHoweverTheyAreSplit) {
  std::mt19937_64 random(1);
  std::vector<Bytes> sent;
  Bytes bytes;
  for (std::uint32_t i = 0; i < 300; ++i) {
    sent.push_back(frame_of(random() % (kMessageSizeMax + 1), 0, i));
    bytes.insert(bytes.end(), sent.back().begin(), sent.back().end());
  }
  std::size_t received_count = 0;
  std::size_t at = 0;
  while (received_count < sent.size()) {
    // Parts of a few bytes split frames anywhere; large ones hold several frames.
    const std::size_t part =
        std::min<std::size_t>(random() % (random() % 2 == 0 ? 30 : 3000), bytes.size() - at);
    if (part > 0) write_all(far_, ConstBytes(bytes).subspan(at, part));
    at += part;
    while (true) {
      const auto frame = receive();
      if (!frame) break;
      ASSERT_EQ(*frame, sent[received_count]);
      ++received_count;
    }
  }
  expect_nothing();
}

TEST_F(FrameStreamTest, ReportsADisconnectAfterTheLastFrame) {
  const Bytes frame = frame_of(20);
  write_all(far_, frame);
  write_all(far_, frame);
  write_all(far_, ConstBytes(frame).first(30));
  { const Descriptor closed = std::move(far_); }
  expect_frame(frame);
  expect_frame(frame);
  const auto end = receive();
  ASSERT_FALSE(end);
  EXPECT_EQ(end.error(), IoError::kClosed);
}

/// Sends until the system's buffer is full; returns the number of bytes accepted.
std::size_t fill(FrameStream& stream) {
  const Bytes frame = frame_of(kMessageSizeMax);
  std::size_t size = 0;
  while (true) {
    const auto sent = stream.send(frame, MonotonicTime::min());
    if (!sent) {
      EXPECT_EQ(sent.error(), IoError::kFull);
      return size;
    }
    size += frame.size();
  }
}

TEST_F(FrameStreamTest, FailsIfThereIsNoCapacityInTime) {
  EXPECT_GT(fill(stream_), 0u);
  const MonotonicTime until = rt::now() + 5ms;
  const auto sent = stream_.send(frame_of(10), until);
  ASSERT_FALSE(sent);
  EXPECT_EQ(sent.error(), IoError::kFull);
  EXPECT_GE(rt::now(), until) << "it waited";
}

TEST_F(FrameStreamTest, WaitsForCapacity) {
  EXPECT_GT(fill(stream_), 0u);
  std::thread reader([this] {
    Bytes sink(1 << 20);
    while (recv(far_.number(), sink.data(), sink.size(), MSG_DONTWAIT) > 0) {
    }
  });
  EXPECT_TRUE(stream_.send(frame_of(10), rt::now() + 20s));
  reader.join();
}

TEST_F(FrameStreamTest, FailsToSendToADisconnectedPeer) {
  { const Descriptor closed = std::move(far_); }
  // A network tells it only after a first frame.
  expected<void, IoError> sent;
  EXPECT_TRUE(rtpm::test::await([&] {
    sent = stream_.send(frame_of(10), rt::now() + 20s);
    return !sent;
  }));
  ASSERT_FALSE(sent);
  EXPECT_EQ(sent.error(), IoError::kClosed);
}

}  // namespace
}  // namespace rtpm::transport
