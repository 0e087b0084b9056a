#include "rtpm/wire/header.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <optional>
#include <string>

#include "frames.hpp"

namespace rtpm::wire {
namespace {

using namespace test;

/// The reason for which `frame` is dropped; nullopt if it is accepted.
std::optional<DropReason> reason_for(ConstBytes frame) {
  const auto header = decode_frame(frame);
  if (header) return std::nullopt;
  return header.error();
}

void expect_same(const Header& a, const Header& b) {
  EXPECT_EQ(a.kind, b.kind);
  EXPECT_EQ(a.priority, b.priority);
  EXPECT_EQ(a.flags, b.flags);
  EXPECT_EQ(a.session, b.session);
  EXPECT_EQ(a.call_id, b.call_id);
  EXPECT_EQ(a.service, b.service);
  EXPECT_EQ(a.method, b.method);
  EXPECT_EQ(a.status, b.status);
  EXPECT_EQ(a.payload_size, b.payload_size);
  EXPECT_EQ(a.fragment_index, b.fragment_index);
  EXPECT_EQ(a.fragment_count, b.fragment_count);
  EXPECT_EQ(a.message_size, b.message_size);
  EXPECT_EQ(a.budget_us, b.budget_us);
  EXPECT_EQ(a.item, b.item);
  EXPECT_EQ(a.sender_time_ns, b.sender_time_ns);
  EXPECT_EQ(a.trace_id, b.trace_id);
}

TEST(Header, ComesBackAsItWasWritten) {
  Random random(1);
  for (int round = 0; round < 2000; ++round) {
    Header header = random_header(random);
    const Bytes payload = random_bytes(random, random() % 100);
    header.payload_size = header.message_size = static_cast<std::uint32_t>(payload.size());
    const auto read = decode_frame(frame_of(header, payload));
    ASSERT_TRUE(read);
    expect_same(*read, header);
  }
}

TEST(Header, TakesTheEndsOfEachRange) {
  for (const int priority : {Priority::kLowest, Priority::kHighest}) {
    Header header;
    header.priority = Priority{priority};
    const auto read = decode_frame(frame_of(header));
    ASSERT_TRUE(read);
    EXPECT_EQ(read->priority, Priority{priority});
  }
  Header header;
  header.payload_size = header.message_size = kMessageSizeCeiling;
  Bytes bytes(kHeaderSize);
  encode(header, bytes.data());
  EXPECT_TRUE(decode(bytes)) << "the largest message begins well";
  EXPECT_EQ(reason_for(bytes), DropReason::kBadLength) << "but the header alone is no frame";
}

/// One way to break a frame, and the resulting drop reason. The faults are in the order in which
/// the fields must be checked (hp-2-1).
struct Break {
  const char* what;
  DropReason reason;
  void (*apply)(Bytes& frame);
};

void set_u16(Bytes& frame, std::size_t offset, std::uint16_t value) {
  store_le(frame.data() + offset, value);
}
void set_u32(Bytes& frame, std::size_t offset, std::uint32_t value) {
  store_le(frame.data() + offset, value);
}

const std::vector<Break>& breaks() {
  static const std::vector<Break> kBreaks{
      {"the magic's first byte", DropReason::kBadMagic, [](Bytes& f) { f[0] = std::byte{'h'}; }},
      {"the magic's second byte", DropReason::kBadMagic, [](Bytes& f) { f[1] = std::byte{'p'}; }},
      {"version 0", DropReason::kBadVersion, [](Bytes& f) { f[2] = std::byte{0}; }},
      {"version 2", DropReason::kBadVersion, [](Bytes& f) { f[2] = std::byte{2}; }},
      {"kind 0", DropReason::kBadKind, [](Bytes& f) { f[3] = std::byte{0}; }},
      {"kind 12", DropReason::kBadKind, [](Bytes& f) { f[3] = std::byte{12}; }},
      {"priority 32768", DropReason::kBadPriority, [](Bytes& f) { set_u16(f, 4, 32768); }},
      {"priority 65535", DropReason::kBadPriority, [](Bytes& f) { set_u16(f, 4, 65535); }},
      {"flag 4", DropReason::kReservedSet, [](Bytes& f) { set_u16(f, 6, 16); }},
      {"flag 15", DropReason::kReservedSet, [](Bytes& f) { set_u16(f, 6, 0x8000); }},
      {"a oneway of both kinds", DropReason::kReservedSet, [](Bytes& f) { set_u16(f, 6, 12); }},
      {"an item on a frame of no stream", DropReason::kReservedSet,
       [](Bytes& f) {
         f[3] = static_cast<std::byte>(FrameKind::kClose);
         set_u32(f, 44, 1);
       }},
      {"a payload above 16 MiB", DropReason::kBadLength,
       [](Bytes& f) { set_u32(f, 28, kMessageSizeCeiling + 1); }},
      {"a payload of 4 GiB", DropReason::kBadLength, [](Bytes& f) { set_u32(f, 28, 0xffff'ffff); }},
      {"fragment 1", DropReason::kBadFragment, [](Bytes& f) { set_u16(f, 32, 1); }},
      {"no fragment", DropReason::kBadFragment, [](Bytes& f) { set_u16(f, 34, 0); }},
      {"two fragments", DropReason::kBadFragment, [](Bytes& f) { set_u16(f, 34, 2); }},
      {"a larger message", DropReason::kBadFragment, [](Bytes& f) { set_u32(f, 36, 17); }},
  };
  return kBreaks;
}

// hp-2-2, hp-2-4
TEST(Header, IsDroppedForTheFieldThatIsBroken) {
  const Bytes good = frame_of({}, bytes_of("sixteen bytes of"));
  ASSERT_EQ(reason_for(good), std::nullopt);
  for (const Break& one : breaks()) {
    Bytes frame = good;
    one.apply(frame);
    EXPECT_EQ(reason_for(frame), one.reason) << one.what;
  }
}

/// The drop reason of a frame of `kind` with these flags and this item; nullopt if it is accepted.
std::optional<DropReason> reason_for(FrameKind kind, std::uint16_t flags, std::uint32_t item) {
  Header header;
  header.kind = kind;
  header.flags = flags;
  header.item = item;
  return reason_for(frame_of(header));
}

constexpr std::array kAllKinds{FrameKind::kHello,  FrameKind::kCookie, FrameKind::kWelcome,
                               FrameKind::kRefuse, FrameKind::kCall,   FrameKind::kReply,
                               FrameKind::kClose,  FrameKind::kAck,    FrameKind::kCancel,
                               FrameKind::kItem,   FrameKind::kCredit};
static_assert(kAllKinds.size() == kFrameKindLast);

// hp-2-5
TEST(Header, OfACallAloneSaysHowItIsAnswered) {
  for (const FrameKind kind : kAllKinds) {
    for (const std::uint16_t flag : {kFlagNoReply, kFlagReplyOnReceipt}) {
      const auto reason = reason_for(kind, flag, 0);
      if (kind == FrameKind::kCall) {
        EXPECT_EQ(reason, std::nullopt);
      } else {
        EXPECT_EQ(reason, DropReason::kReservedSet) << to_string(kind);
      }
    }
  }
  EXPECT_EQ(reason_for(FrameKind::kCall, kFlagNoReply | kFlagReplyOnReceipt, 0),
            DropReason::kReservedSet);
  EXPECT_EQ(reason_for(FrameKind::kCall, kFlagNoReply | kFlagRepeated, 0), std::nullopt);
}

// hp-2-5
TEST(Header, HasAnItemWhereThereMayBeAStream) {
  constexpr std::array kOfStreams{FrameKind::kCall, FrameKind::kReply, FrameKind::kAck,
                                  FrameKind::kItem, FrameKind::kCredit};
  for (const FrameKind kind : kAllKinds) {
    const bool is_of_streams = std::ranges::find(kOfStreams, kind) != kOfStreams.end();
    for (const std::uint32_t item : {1u, 0x8000'0000u, 0xffff'ffffu}) {
      const auto reason = reason_for(kind, 0, item);
      EXPECT_EQ(reason, is_of_streams ? std::nullopt : std::optional(DropReason::kReservedSet))
          << to_string(kind) << " " << item;
    }
    EXPECT_EQ(reason_for(kind, 0, 0), std::nullopt) << to_string(kind);
  }
  for (const std::uint16_t flag : {kFlagNoReply, kFlagReplyOnReceipt}) {
    EXPECT_EQ(reason_for(FrameKind::kCall, flag, 1), DropReason::kReservedSet)
        << "a oneway is no stream";
  }
}

// hp-2-4, hp-5.8-2
TEST(Header, OfFragmentsIsACallsAReplysOrAnItems) {
  for (const FrameKind kind : kAllKinds) {
    for (const std::uint16_t flags : {std::uint16_t{0}, kFlagNoReply, kFlagReplyOnReceipt}) {
      Header header;
      header.kind = kind;
      header.flags = flags;
      header.payload_size = 1;
      header.message_size = 2;
      header.fragment_count = 2;
      Bytes frame(kHeaderSize + 1);
      encode(header, frame.data());
      const bool is_call = kind == FrameKind::kCall;
      const bool is_answer = kind == FrameKind::kReply || kind == FrameKind::kItem;
      const bool is_good = is_call ? flags != kFlagNoReply : is_answer && flags == 0;
      EXPECT_EQ(reason_for(frame) == std::nullopt, is_good) << to_string(kind) << " " << flags;
      if (is_call && !is_good) {
        EXPECT_EQ(reason_for(frame), DropReason::kBadFragment);
      }
    }
  }
}

// hp-2-1: the order ensures that a frame with several faults is counted alike everywhere.
TEST(Header, IsDroppedForTheFirstOfSeveralFaults) {
  const Bytes good = frame_of({}, bytes_of("sixteen bytes of"));
  for (std::size_t first = 0; first < breaks().size(); ++first) {
    for (std::size_t second = first + 1; second < breaks().size(); ++second) {
      Bytes frame = good;
      breaks()[second].apply(frame);
      breaks()[first].apply(frame);
      const DropReason later = breaks()[second].reason;
      const auto reason = reason_for(frame);
      EXPECT_TRUE(reason == breaks()[first].reason || breaks()[first].reason == later)
          << breaks()[first].what << " and " << breaks()[second].what;
    }
  }
}

TEST(Header, IsTooShortBelow64BytesWhateverTheyAre) {
  const Bytes good = frame_of({});
  for (std::size_t size = 0; size < kHeaderSize; ++size) {
    const Bytes cut(good.begin(), good.begin() + static_cast<std::ptrdiff_t>(size));
    EXPECT_EQ(reason_for(cut), DropReason::kTooShort) << size;
  }
  EXPECT_EQ(reason_for({}), DropReason::kTooShort);
}

/// The first `size` bytes, padded with zeros.
Bytes resized(const Bytes& bytes, std::size_t size) {
  Bytes result(size);
  std::copy_n(bytes.begin(), std::min(size, bytes.size()), result.begin());
  return result;
}

// hp-2-3
TEST(Frame, IsOfBadLengthUnlessThePayloadIsAllThatFollows) {
  Bytes frame = frame_of({}, bytes_of("payload"));
  EXPECT_EQ(reason_for(resized(frame, frame.size() + 1)), DropReason::kBadLength);
  frame = resized(frame, frame.size() - 1);
  EXPECT_EQ(reason_for(frame), DropReason::kBadLength);
  EXPECT_TRUE(decode(frame)) << "on a stream more bytes may follow or be on their way";
}

/// Accepted bytes must equal the encoding of the decoded header: two byte strings never mean the
/// same header, and no bit is ignored.
void check_bytes(const Bytes& bytes) {
  const auto header = decode_frame(bytes);
  if (!header) return;
  ASSERT_EQ(bytes.size(), kHeaderSize + header->payload_size);
  Bytes again(kHeaderSize);
  encode(*header, again.data());
  ASSERT_TRUE(std::equal(again.begin(), again.end(), bytes.begin()));
}

TEST(Frame, OfRandomBytesIsNeverTakenWrongly) {
  Random random(2);
  int taken_count = 0;
  for (int round = 0; round < 20'000; ++round) {
    Bytes bytes = random_bytes(random, random() % 200);
    check_bytes(bytes);
    // Most random bytes fail at the magic: this lets them pass more and more of the checks.
    bytes = frame_of(random_header(random), bytes);
    const std::size_t change_count = random() % 3;
    for (std::size_t i = 0; i < change_count; ++i) {
      bytes[random() % bytes.size()] = static_cast<std::byte>(random());
    }
    if (random() % 4 == 0) bytes = resized(bytes, random() % (bytes.size() + 3));
    check_bytes(bytes);
    taken_count += reason_for(bytes) ? 0 : 1;
  }
  EXPECT_GT(taken_count, 1000) << "the test must reach both outcomes";
  EXPECT_LT(taken_count, 19'000);
}

TEST(Frame, WithAnyOneBitTurnedIsDroppedOrReadDifferently) {
  Random random(3);
  const Bytes good = frame_of(random_header(random), random_bytes(random, 5));
  for (std::size_t bit = 0; bit < kHeaderSize * 8; ++bit) {
    Bytes frame = good;
    frame[bit / 8] ^= static_cast<std::byte>(1u << (bit % 8));
    check_bytes(frame);
  }
}

TEST(Names, AreTheSpecs) {
  constexpr std::array<std::string_view, kDropReasonCount> kReasons{
      "too_short",       "bad_magic",       "bad_version",  "bad_kind",          "reserved_set",
      "bad_priority",    "bad_length",      "bad_fragment", "bad_payload",       "bad_cookie",
      "unknown_session", "foreign_address", "stale_call",   "duplicate_running", "unexpected",
      "rate_limited",    "unsealed",        "bad_seal",     "replayed"};
  for (std::size_t i = 0; i < kReasons.size(); ++i) {
    EXPECT_EQ(to_string(static_cast<DropReason>(i)), kReasons[i]);
  }
  EXPECT_EQ(to_string(static_cast<DropReason>(kDropReasonCount)), "unknown");
  constexpr std::array<std::string_view, kStatusCount> kStatuses{"ok",
                                                                 "overload",
                                                                 "expired",
                                                                 "no_such_method",
                                                                 "no_such_object",
                                                                 "bad_request",
                                                                 "not_lease_holder",
                                                                 "gone",
                                                                 "servant_failed",
                                                                 "too_large",
                                                                 "priority_not_allowed",
                                                                 "wrong_band",
                                                                 "unknown_session",
                                                                 "version_unsupported",
                                                                 "bad_limits",
                                                                 "wrong_interface",
                                                                 "cancelled",
                                                                 "stopping",
                                                                 "lost",
                                                                 "not_allowed"};
  for (std::size_t i = 0; i < kStatuses.size(); ++i) {
    EXPECT_EQ(to_string(static_cast<Status>(i)), kStatuses[i]);
  }
  EXPECT_EQ(to_string(static_cast<Status>(kStatusCount)), "unknown");
  constexpr std::array<std::string_view, kFrameKindLast> kKinds{
      "HELLO", "COOKIE", "WELCOME", "REFUSE", "CALL",  "REPLY",
      "CLOSE", "ACK",    "CANCEL",  "ITEM",   "CREDIT"};
  for (std::size_t i = 0; i < kKinds.size(); ++i) {
    EXPECT_EQ(to_string(static_cast<FrameKind>(i + 1)), kKinds[i]);
  }
  EXPECT_EQ(to_string(FrameKind{}), "unknown");
}

TEST(Counters, AddUpEachForItself) {
  FrameCounters one;
  one.received_count = 1;
  one.duplicate_answered_count = 2;
  one.expired_count = 3;
  one.refused_count = 4;
  one.session_opened_count = 5;
  one.session_evicted_count = 6;
  one.cancelled_count = 7;
  one.orphaned_count = 8;
  one.item_count = 9;
  one.item_repeated_count = 10;
  one.large_evicted_count = 11;
  for (std::size_t i = 0; i < kDropReasonCount; ++i) {
    for (std::size_t count = 0; count <= i; ++count)
      one.drop(static_cast<DropReason>(i));
  }
  FrameCounters sum = one;
  sum.add(one);
  EXPECT_EQ(sum.received_count, 2u);
  EXPECT_EQ(sum.duplicate_answered_count, 4u);
  EXPECT_EQ(sum.expired_count, 6u);
  EXPECT_EQ(sum.refused_count, 8u);
  EXPECT_EQ(sum.session_opened_count, 10u);
  EXPECT_EQ(sum.session_evicted_count, 12u);
  EXPECT_EQ(sum.cancelled_count, 14u);
  EXPECT_EQ(sum.orphaned_count, 16u);
  EXPECT_EQ(sum.item_count, 18u);
  EXPECT_EQ(sum.item_repeated_count, 20u);
  EXPECT_EQ(sum.large_evicted_count, 22u);
  for (std::size_t i = 0; i < kDropReasonCount; ++i) {
    EXPECT_EQ(sum.dropped_for(static_cast<DropReason>(i)), 2 * (i + 1));
  }
}

}  // namespace
}  // namespace rtpm::wire
