#include "rtpm/wire/stream.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <deque>
#include <string>

#include "frames.hpp"

// The two ends of a stream in isolation: spec/hprotocol.md#hp-5.10.
namespace rtpm::wire {
namespace {

using namespace test;
using namespace std::chrono_literals;
using Taken = IncomingStream::Taken;

constexpr std::size_t kFrameSize = 128;
constexpr std::size_t kFragmentSize = kFrameSize - kHeaderSize;

/// A stream's server end, with items such as "item 7".
class Source {
 public:
  explicit Source(std::uint32_t limit, bool is_kept = true, std::uint32_t first = 0)
      : memory_((is_kept ? kStreamWindow : 1) * kFrameSize) {
    Header header;
    header.session = 0xabc;
    header.call_id = 5;
    header.service = 3;
    header.method = 4;
    header.priority = 120;
    header.trace_id = 0x7ace;
    header.flags = kFlagRepeated;
    header.budget_us = 800;
    header.item = limit;
    stream.begin(header,
                 {.memory = memory_,
                  .frame_size = kFrameSize,
                  .fragment_size = static_cast<std::uint32_t>(kFragmentSize)},
                 is_kept ? Medium::kDatagram : Medium::kStream, first);
  }
  /// The frame of the next item; empty if the receiver accepts none.
  Bytes push(MonotonicTime now = at(0s)) {
    return copy_of(stream.push(bytes_of("item " + std::to_string(stream.count())), now));
  }
  /// The number of items that it sends before the receiver accepts no more.
  int push_all() {
    int count = 0;
    while (!push().empty())
      ++count;
    return count;
  }
  /// The numbers of the items to be repeated.
  std::vector<std::uint32_t> repairs() {
    std::vector<std::uint32_t> numbers;
    for (ConstBytes frame; !(frame = stream.next()).empty();) {
      EXPECT_EQ(header_of(frame).flags, kFlagRepeated);
      numbers.push_back(header_of(frame).item);
    }
    return numbers;
  }

  OutgoingStream stream;

 private:
  Bytes memory_;
};

using Numbers = std::vector<std::uint32_t>;

// hp-5.10-2
TEST(OutgoingStream, SendsNoMoreThanItsCallerGranted) {
  Source source(4);
  EXPECT_EQ(source.push_all(), 4);
  source.stream.on_credit(credit(4, 0), 6, false);
  EXPECT_EQ(source.push_all(), 2);
  source.stream.on_credit(credit(6, 0), 5, false);
  EXPECT_EQ(source.push_all(), 0) << "a limit that was granted is not taken back";
  source.stream.on_credit(credit(6), 7, false);
  EXPECT_EQ(source.push_all(), 1);
}

// hp-5.10-8
TEST(OutgoingStream, IgnoresCreditForUnsentItems) {
  Source source(4);
  EXPECT_EQ(source.push_all(), 4);
  source.stream.on_credit(credit(5, 0), 100, true);
  EXPECT_EQ(source.push_all(), 0) << "its limit does not count either";
  EXPECT_FALSE(source.stream.is_acknowledged());
  source.stream.on_credit(credit(0xffff'ffff, ~std::uint64_t{0}), 100, true);
  EXPECT_EQ(source.repairs(), Numbers{});
  // Bits beyond the last sent item name nothing that could be repeated.
  source.stream.on_credit(credit(2, ~std::uint64_t{1}), 4, true);
  EXPECT_EQ(source.repairs(), (Numbers{2, 3}));
  source.stream.on_credit(credit(4, ~std::uint64_t{0}), 4, true);
  EXPECT_EQ(source.repairs(), Numbers{});
}

TEST(OutgoingStream, IgnoresAStaleCredit) {
  Source source(8);
  EXPECT_EQ(source.push_all(), 8);
  source.stream.on_credit(credit(6, 0), 8, false);
  source.stream.on_credit(credit(2, 0b1), 8, true);
  EXPECT_EQ(source.repairs(), Numbers{}) << "2 was received long ago, and its slot is reused";
}

/// A stream's client end.
class Sink {
 public:
  explicit Sink(std::uint32_t window, std::size_t item_size = 16, std::uint32_t first = 0)
      : memory_(window * item_size) {
    stream.begin({.frames = memory_,
                  .frame_size = static_cast<std::uint32_t>(item_size),
                  .item = {},
                  .byte_window = static_cast<std::uint32_t>(memory_.size())},
                 window, first);
  }
  Taken take(std::uint32_t number, ConstBytes item) {
    Header header;
    header.kind = FrameKind::kItem;
    header.item = number;
    header.payload_size = header.message_size = static_cast<std::uint32_t>(item.size());
    return stream.take(header, item);
  }
  Taken take(std::uint32_t number) {
    return take(number, bytes_of("item " + std::to_string(number)));
  }
  /// Takes all available items, in order; returns how many.
  std::uint32_t drain() {
    std::uint32_t count = 0;
    for (auto item = stream.next(); item; item = stream.next()) {
      EXPECT_EQ(copy_of(*item), bytes_of("item " + std::to_string(next_)));
      ++next_;
      ++count;
    }
    return count;
  }
  void expect_next(std::uint32_t number) { next_ = number; }

  IncomingStream stream;

 private:
  Bytes memory_;
  std::uint32_t next_ = 0;
};

TEST(IncomingStream, RefusesAnItemLargerThanItsBuffer) {
  Sink sink(4, 16);
  EXPECT_EQ(sink.take(0, Bytes(17)), Taken::kForeign);
  EXPECT_EQ(sink.take(0, Bytes(16)), Taken::kNew);
  EXPECT_EQ(sink.take(1, {}), Taken::kNew) << "an item may be empty";
  EXPECT_EQ(sink.stream.next()->size(), 16u);
  EXPECT_EQ(sink.stream.next()->size(), 0u);
}

// hp-5.10-2: items that were not granted are dropped, so that a sender cannot exhaust memory.
TEST(IncomingStream, RefusesItemsBeyondItsWindow) {
  for (const std::uint32_t window : {1u, 2u, 3u, 7u, 32u}) {
    Sink sink(window);
    EXPECT_EQ(sink.take(window), Taken::kForeign);
    EXPECT_EQ(sink.take(window + 1), Taken::kForeign);
    EXPECT_EQ(sink.take(0x7fff'ffff), Taken::kForeign);
    for (std::uint32_t number = window; number-- > 0;)
      EXPECT_NE(sink.take(number), Taken::kForeign) << window;
    EXPECT_EQ(sink.stream.limit(), window);
    ASSERT_TRUE(sink.stream.next());
    EXPECT_EQ(sink.stream.limit(), window) << "the reader still uses it";
    EXPECT_EQ(sink.take(window), Taken::kForeign);
    static_cast<void>(sink.stream.next());
    EXPECT_EQ(sink.stream.limit(), window + 1);
    EXPECT_EQ(sink.take(window), Taken::kNew);
  }
}

TEST(IncomingStream, RefusesAnEndThatContradictsItsItems) {
  Sink sink(8);
  static_cast<void>(sink.take(0));
  static_cast<void>(sink.take(3));
  EXPECT_FALSE(sink.stream.end(0)) << "item 0 was there";
  EXPECT_FALSE(sink.stream.end(3)) << "item 3 was there";
  EXPECT_FALSE(sink.stream.end(9)) << "only 8 were granted";
  EXPECT_FALSE(sink.stream.end(0xffff'ffff));
  EXPECT_TRUE(sink.stream.end(8)) << "all that was granted";
  Sink empty(8);
  EXPECT_TRUE(empty.stream.end(0)) << "a stream may have no item";
  EXPECT_TRUE(empty.stream.is_complete());
}

// hp-5.10-1: after the largest number comes 0, for any window.
TEST(Streams, ContinueAcrossTheWrapOfNumbers) {
  constexpr std::uint32_t kFirst = 0u - 100;
  for (const std::uint32_t window : {1u, 3u, 5u, 8u, 31u, 32u}) {
    SCOPED_TRACE("window " + std::to_string(window));
    Source source(window, true, kFirst);
    Sink sink(window, 64, kFirst);
    sink.expect_next(kFirst);
    Random random(window);
    std::uint32_t taken_count = 0;
    while (taken_count < 200) {
      std::vector<Bytes> frames;
      for (Bytes frame = source.push(); !frame.empty(); frame = source.push())
        frames.push_back(frame);
      std::ranges::shuffle(frames, random);
      for (const Bytes& frame : frames) {
        if (random() % 4 == 0) continue;
        ASSERT_NE(sink.stream.take(header_of(frame), payload_of(frame)), Taken::kForeign);
      }
      taken_count += sink.drain();
      source.stream.on_credit(sink.stream.credit(), sink.stream.limit(), true);
      for (ConstBytes frame; !(frame = source.stream.next()).empty();) {
        ASSERT_NE(sink.stream.take(header_of(frame), payload_of(frame)), Taken::kForeign);
      }
      taken_count += sink.drain();
      ASSERT_FALSE(testing::Test::HasFailure());
    }
    EXPECT_LT(source.stream.count(), kFirst) << "it wrapped around";
  }
}

/// A client end for items of up to 60 000 bytes, in frames of 1024.
class LargeSink {
 public:
  explicit LargeSink(std::uint32_t window, std::uint32_t byte_window = 8 * kPart)
      : frames_(stream_frame_count(Medium::kDatagram, window, byte_window) * kPart), item_(60'000) {
    stream.begin(
        {.frames = frames_, .frame_size = kPart, .item = item_, .byte_window = byte_window},
        window);
  }
  Taken take(ConstBytes frame) { return stream.take(header_of(frame), payload_of(frame)); }

  static constexpr std::uint32_t kPart = 1024;
  IncomingStream stream;

 private:
  Bytes frames_;
  Bytes item_;
};

Header item_header(std::uint32_t number) {
  Header header;
  header.kind = FrameKind::kItem;
  header.item = number;
  return header;
}

// hp-5.10-9: a completed item frees its bytes, so that an item may be larger than the byte window;
// while the reader uses an item, the next one waits within the window.
TEST(IncomingStream, RefusesBytesBeyondItsCredit) {
  Random random(5);
  const Bytes large = random_bytes(random, 16 * LargeSink::kPart);
  LargeSink sink(4, 4 * LargeSink::kPart);
  const auto first = item_frames(item_header(0), large, LargeSink::kPart);
  for (const Bytes& frame : first)
    EXPECT_EQ(sink.take(frame), Taken::kNew);
  EXPECT_EQ(sink.stream.credit().byte_limit, 20u * LargeSink::kPart);
  const auto item = sink.stream.next();
  ASSERT_TRUE(item);
  const auto second = item_frames(item_header(16), large, LargeSink::kPart);
  for (std::size_t i = 0; i < 4; ++i)
    EXPECT_EQ(sink.take(second[i]), Taken::kNew);
  EXPECT_EQ(sink.take(second[4]), Taken::kForeign) << "beyond the bytes that were granted";
  EXPECT_EQ(sink.stream.credit().byte_limit, 20u * LargeSink::kPart);
  EXPECT_EQ(copy_of(*item), large) << "it stays valid while it is used";
  EXPECT_FALSE(sink.stream.next()) << "the second is not whole";
  EXPECT_EQ(sink.stream.credit().byte_limit, 24u * LargeSink::kPart);
  for (std::size_t i = 4; i < second.size(); ++i)
    EXPECT_EQ(sink.take(second[i]), Taken::kNew);
  ASSERT_TRUE(sink.stream.has_next());
  EXPECT_EQ(copy_of(*sink.stream.next()), large);
}

// hp-5.10-11: a fragment that does not continue where the previous one ended is not the item's.
TEST(IncomingStream, RefusesAFragmentOfAnotherItem) {
  const Bytes large(5000);
  LargeSink sink(4);
  const auto frames = item_frames(item_header(0), large, LargeSink::kPart);
  Header later = item_header(1);
  EXPECT_EQ(sink.take(item_frames(item_header(0), large, LargeSink::kPart)[1]), Taken::kAhead);
  EXPECT_EQ(sink.take(frame_of(item_header(0), bytes_of("whole"))), Taken::kNew);
  EXPECT_EQ(sink.stream.credit().first_missing, 1u) << "what was kept did not fit behind it";
  EXPECT_EQ(sink.stream.credit().later, 0u);
  EXPECT_EQ(sink.stream.dropped_count(), 1u);
  EXPECT_EQ(sink.take(item_frames(later, large, LargeSink::kPart)[0]), Taken::kNew);
  EXPECT_EQ(sink.take(frame_of(item_header(2), bytes_of("whole"))), Taken::kForeign);
  EXPECT_EQ(sink.take(item_frames(later, Bytes(6000), LargeSink::kPart)[1]), Taken::kForeign);
  EXPECT_EQ(sink.take(item_frames(later, Bytes(5000), 1001)[1]), Taken::kForeign);
  EXPECT_EQ(sink.take(item_frames(later, large, LargeSink::kPart)[1]), Taken::kNew);
  EXPECT_EQ(sink.take(item_frames(item_header(0), Bytes(60'001), LargeSink::kPart)[0]),
            Taken::kDuplicate);
  LargeSink other(4);
  EXPECT_EQ(other.take(item_frames(item_header(0), Bytes(60'001), LargeSink::kPart)[0]),
            Taken::kForeign)
      << "larger than items may be";
}

/// Items of all sizes over a random channel: loss, duplicates and reordering in both directions.
class LossyLargeStream {
 public:
  explicit LossyLargeStream(std::uint64_t seed)
      : random_(seed), sink_(window(), kStreamBytesFirstDatagram) {
    for (std::uint64_t count = random_() % 40; count > 0; --count) {
      const std::size_t size = random_() % 3 == 0 ? random_() % 60'001 : random_() % 1500;
      items_.push_back(random_bytes(random_, size));
    }
    memory_.resize(kStreamWindow * (kHeaderSize + kPart));
    Header call;
    call.item = sink_.stream.limit();
    source_.begin(call,
                  {.memory = memory_, .frame_size = kHeaderSize + kPart, .fragment_size = kPart},
                  Medium::kDatagram);
  }
  bool run() {
    for (int step = 0; step < 200'000; ++step) {
      if (given_ < items_.size()) {
        const ConstBytes frame = source_.push(items_[given_], at(0s));
        if (!frame.empty() && !source_.is_midway()) ++given_;
        put(copy_of(frame));
      }
      if (random_() % 2 == 0 && !way_.empty()) {
        const Bytes frame = way_.front();
        way_.pop_front();
        static_cast<void>(sink_.take(frame));
      }
      if (random_() % 4 == 0) drain();
      if (random_() % 4 == 0) {
        const bool is_lost = random_() % 10 < 3;
        if (!is_lost) {
          source_.on_credit(sink_.stream.credit(), sink_.stream.limit(), random_() % 8 == 0);
        }
        for (ConstBytes frame; !(frame = source_.next()).empty();)
          put(copy_of(frame));
      }
      if (testing::Test::HasFailure()) return false;
      if (taken_ == items_.size() && source_.is_acknowledged()) return true;
    }
    return false;
  }

 private:
  static constexpr std::uint32_t kPart = LargeSink::kPart;
  std::uint32_t window() { return 1 + static_cast<std::uint32_t>(random_() % kStreamWindow); }
  void put(const Bytes& frame) {
    // A network has a limited capacity.
    if (frame.empty() || way_.size() > 100) return;
    for (std::uint64_t copies = random_() % 10 < 3 ? 0 : 1 + random_() % 2; copies > 0; --copies) {
      const auto place = static_cast<std::ptrdiff_t>(random_() % (way_.size() + 1));
      way_.insert(way_.begin() + place, frame);
    }
  }
  void drain() {
    while (const auto item = sink_.stream.next()) {
      EXPECT_LT(taken_, items_.size());
      EXPECT_EQ(copy_of(*item), items_[taken_]);
      ++taken_;
    }
  }

  Random random_;
  LargeSink sink_;
  std::vector<Bytes> items_;
  Bytes memory_;
  OutgoingStream source_;
  std::deque<Bytes> way_;
  std::size_t given_ = 0;
  std::size_t taken_ = 0;
};

TEST(StreamsProperty, DeliverEachItemWholeOnceAndInOrderOverALossyPath) {
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    LossyLargeStream stream(seed);
    ASSERT_TRUE(stream.run()) << "seed " << seed;
  }
}

}  // namespace
}  // namespace rtpm::wire
