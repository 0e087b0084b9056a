#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <ostream>
#include <random>
#include <string_view>
#include <vector>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/expected.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/wire/client_channel.hpp"
#include "rtpm/wire/header.hpp"
#include "rtpm/wire/server_sessions.hpp"

/// Builds and parses frames for the tests of the protocol.
namespace rtpm::wire {

inline void PrintTo(DropReason reason, std::ostream* out) {
  *out << to_string(reason);
}
inline void PrintTo(Status status, std::ostream* out) {
  *out << to_string(status);
}
inline void PrintTo(FrameKind kind, std::ostream* out) {
  *out << to_string(kind);
}
inline void PrintTo(Verdict::Action action, std::ostream* out) {
  static constexpr std::array<std::string_view, 4> kNames{"nothing", "send", "dispatch", "hang up"};
  *out << kNames[static_cast<std::size_t>(action)];
}
inline void PrintTo(ChannelEvent::Kind kind, std::ostream* out) {
  static constexpr std::array<std::string_view, 11> kNames{
      "nothing", "send",   "ready",     "reply",   "items", "refused",
      "lost",    "closed", "need room", "timeout", "broken"};
  *out << kNames[static_cast<std::size_t>(kind)];
}

namespace test {

using Bytes = std::vector<std::byte>;

/// A point on the tests' time line, which starts well after 0, like a host's.
[[nodiscard]] constexpr MonotonicTime at(Duration since_begin) noexcept {
  return time_from_ns(1'000'000'000'000) + since_begin;
}

[[nodiscard]] inline Bytes copy_of(ConstBytes bytes) {
  return {bytes.begin(), bytes.end()};
}

[[nodiscard]] inline Bytes bytes_of(std::string_view text) {
  return copy_of(std::as_bytes(std::span(text)));
}

/// A whole frame: `header` with its sizes set to those of `payload`, and the payload. The block has
/// exactly the frame's length, so that a sanitizer sees a read past its end.
[[nodiscard]] inline Bytes frame_of(Header header, ConstBytes payload = {}) {
  header.payload_size = header.message_size = static_cast<std::uint32_t>(payload.size());
  Bytes frame(kHeaderSize);
  encode(header, frame.data());
  frame.insert(frame.end(), payload.begin(), payload.end());
  frame.shrink_to_fit();
  return frame;
}

/// The header of a frame that the code under test made; fails the test if it is malformed.
[[nodiscard]] inline Header header_of(ConstBytes frame) {
  const auto header = decode_frame(frame);
  EXPECT_TRUE(header) << "malformed: " << to_string(header.error());
  return header ? *header : Header{};
}

[[nodiscard]] inline Bytes payload_of(ConstBytes frame) {
  return frame.size() < kHeaderSize ? Bytes{} : copy_of(frame.subspan(kHeaderSize));
}

/// A CREDIT for as many bytes as a test may send.
[[nodiscard]] inline StreamCredit credit(std::uint32_t first_missing, std::uint64_t later = 0) {
  return {.first_missing = first_missing, .byte_limit = 1U << 30, .later = later};
}

/// The frames of `item` as fragments of `fragment_size`; `header` belongs to an ITEM, with the
/// number of the first fragment.
[[nodiscard]] inline std::vector<Bytes> item_frames(Header header, ConstBytes item,
                                                    std::size_t fragment_size) {
  std::vector<Bytes> frames;
  const std::size_t count = (item.size() + fragment_size - 1) / fragment_size;
  header.fragment_count = static_cast<std::uint16_t>(count);
  header.message_size = static_cast<std::uint32_t>(item.size());
  for (std::size_t i = 0; i < count; ++i) {
    const ConstBytes part =
        item.subspan(i * fragment_size, std::min(fragment_size, item.size() - i * fragment_size));
    header.fragment_index = static_cast<std::uint16_t>(i);
    header.payload_size = static_cast<std::uint32_t>(part.size());
    Bytes frame(kHeaderSize);
    encode(header, frame.data());
    frame.insert(frame.end(), part.begin(), part.end());
    frames.push_back(std::move(frame));
    ++header.item;
  }
  return frames;
}

using Random = std::mt19937_64;

[[nodiscard]] inline Bytes random_bytes(Random& random, std::size_t size) {
  Bytes bytes(size);
  for (std::byte& byte : bytes)
    byte = static_cast<std::byte>(random());
  return bytes;
}

[[nodiscard]] inline Header random_header(Random& random) {
  Header header;
  header.kind = static_cast<FrameKind>(1 + random() % kFrameKindLast);
  header.priority = Priority{static_cast<int>(random() % (Priority::kHighest + 1))};
  header.flags = static_cast<std::uint16_t>(random() % 4);
  if (header.kind == FrameKind::kCall) {
    constexpr std::array<std::uint16_t, 3> kDeliveries{0, kFlagNoReply, kFlagReplyOnReceipt};
    header.flags |= kDeliveries[random() % 3];
  }
  header.session = random();
  header.call_id = static_cast<std::uint32_t>(random());
  header.service = static_cast<std::uint32_t>(random());
  header.method = static_cast<std::uint16_t>(random());
  header.status = static_cast<Status>(random() % kStatusCount);
  header.budget_us = static_cast<std::uint32_t>(random());
  const bool may_have_item = header.kind == FrameKind::kReply || header.kind == FrameKind::kAck ||
                             header.kind == FrameKind::kItem || header.kind == FrameKind::kCredit ||
                             (header.kind == FrameKind::kCall && header.flags < kFlagNoReply);
  if (may_have_item) header.item = static_cast<std::uint32_t>(random());
  header.sender_time_ns = random();
  header.trace_id = random();
  return header;
}

}  // namespace test
}  // namespace rtpm::wire
