#include "rtpm/wire/header.hpp"

#include <array>

#include "rtpm/base/compiler.hpp"

namespace rtpm::wire {
namespace {

// "HP" in reading order.
constexpr std::uint16_t kMagic = 0x5048;

// The offset of each field, as in hp-2. The fields cover every byte of the header once.
constexpr std::size_t kAtMagic = 0;
constexpr std::size_t kAtVersion = 2;
constexpr std::size_t kAtKind = 3;
constexpr std::size_t kAtPriority = 4;
constexpr std::size_t kAtFlags = 6;
constexpr std::size_t kAtSession = 8;
constexpr std::size_t kAtCallId = 16;
constexpr std::size_t kAtService = 20;
constexpr std::size_t kAtMethod = 24;
constexpr std::size_t kAtStatus = 26;
constexpr std::size_t kAtPayloadSize = 28;
constexpr std::size_t kAtFragmentIndex = 32;
constexpr std::size_t kAtFragmentCount = 34;
constexpr std::size_t kAtMessageSize = 36;
constexpr std::size_t kAtBudget = 40;
constexpr std::size_t kAtItem = 44;
constexpr std::size_t kAtSenderTime = 48;
constexpr std::size_t kAtTraceId = 56;
static_assert(kAtTraceId + 8 == kHeaderSize && kHeaderSize % 16 == 0);

// Combines consecutive fields into one 64-bit number.
template <std::unsigned_integral... Fields>
inline std::uint64_t word_of(Fields... fields) noexcept {
  static_assert((sizeof(Fields) + ...) == sizeof(std::uint64_t));
  std::uint64_t word = 0;
  std::size_t shift = 0;
  const auto add = [&](std::uint64_t field, std::size_t size) {
    // Separate loads, matching the stores: a compiler would merge adjacent ones into one load,
    // which stalls on the stores as described at encode().
    load_alone(field);
    word |= field << shift;
    shift += 8 * size;
  };
  (add(fields, sizeof(Fields)), ...);
  return word;
}

// hp-2-5: flags that a frame kind does not use are reserved.
bool has_good_flags(const Header& header) noexcept {
  constexpr std::uint16_t kOneway = kFlagNoReply | kFlagReplyOnReceipt;
  if ((header.flags & ~kFlagsKnown) != 0) return false;
  switch (header.kind) {
    case FrameKind::kCall:
      // A oneway has exactly one of these flags, and is not a stream.
      return (header.flags & kOneway) == 0 ||
             ((header.flags & kOneway) != kOneway && header.item == 0);
    case FrameKind::kReply:
    case FrameKind::kAck:
    case FrameKind::kItem:
    case FrameKind::kCredit:
      return (header.flags & kOneway) == 0;
    default:
      return (header.flags & kOneway) == 0 && header.item == 0;
  }
}

// hp-2-4
bool has_good_fragment_numbers(const Header& header) noexcept {
  if (header.fragment_count == 1) {
    return header.fragment_index == 0 && header.message_size == header.payload_size;
  }
  // hp-5.8-2: a oneway without acknowledgement is a single frame.
  return (header.kind == FrameKind::kCall || header.kind == FrameKind::kReply ||
          header.kind == FrameKind::kItem) &&
         (header.flags & kFlagNoReply) == 0 && header.message_size <= kMessageSizeCeiling &&
         fragment_size_of(header) != 0;
}

// hp-2-1, hp-2-2, hp-2-4: the specification defines the order of the checks, so that every
// implementation counts a frame with several faults alike. Fields without meaning in the frame are
// not checked (hp-2-7).
expected<void, DropReason> decode(ConstBytes bytes, Header& header) noexcept {
  if (bytes.size() < kHeaderSize) return unexpected{DropReason::kTooShort};
  const std::byte* from = bytes.data();
  if (load_le<std::uint16_t>(from + kAtMagic) != kMagic) return unexpected{DropReason::kBadMagic};
  if (from[kAtVersion] != std::byte{kVersion}) return unexpected{DropReason::kBadVersion};
  const auto kind = static_cast<std::uint8_t>(from[kAtKind]);
  if (kind == 0 || kind > kFrameKindLast) return unexpected{DropReason::kBadKind};
  const auto priority = load_le<std::uint16_t>(from + kAtPriority);
  if (!Priority::is_valid(priority)) return unexpected{DropReason::kBadPriority};

  header.kind = static_cast<FrameKind>(kind);
  header.priority = Priority{priority};
  header.flags = load_le<std::uint16_t>(from + kAtFlags);
  header.item = load_le<std::uint32_t>(from + kAtItem);
  if (!has_good_flags(header)) return unexpected{DropReason::kReservedSet};
  header.session = load_le<std::uint64_t>(from + kAtSession);
  header.call_id = load_le<std::uint32_t>(from + kAtCallId);
  header.service = load_le<std::uint32_t>(from + kAtService);
  header.method = load_le<std::uint16_t>(from + kAtMethod);
  header.status = static_cast<Status>(load_le<std::uint16_t>(from + kAtStatus));
  header.payload_size = load_le<std::uint32_t>(from + kAtPayloadSize);
  header.fragment_index = load_le<std::uint16_t>(from + kAtFragmentIndex);
  header.fragment_count = load_le<std::uint16_t>(from + kAtFragmentCount);
  header.message_size = load_le<std::uint32_t>(from + kAtMessageSize);
  header.budget_us = load_le<std::uint32_t>(from + kAtBudget);
  header.sender_time_ns = load_le<std::uint64_t>(from + kAtSenderTime);
  header.trace_id = load_le<std::uint64_t>(from + kAtTraceId);
  if (header.payload_size > kMessageSizeCeiling) return unexpected{DropReason::kBadLength};
  if (!has_good_fragment_numbers(header)) return unexpected{DropReason::kBadFragment};
  return {};
}

}  // namespace

// Stores whole words, as the sending code loads them: a load of bytes written by several smaller
// stores stalls until these have left the core's store buffer, tens of cycles each.
void encode(const Header& header, std::byte* to) noexcept {
  store_le(to + kAtMagic, word_of(kMagic, kVersion, static_cast<std::uint8_t>(header.kind),
                                  header.priority.value(), header.flags));
  store_le(to + kAtSession, header.session);
  store_le(to + kAtCallId, word_of(header.call_id, header.service));
  store_le(to + kAtMethod,
           word_of(header.method, static_cast<std::uint16_t>(header.status), header.payload_size));
  store_le(to + kAtFragmentIndex,
           word_of(header.fragment_index, header.fragment_count, header.message_size));
  store_le(to + kAtBudget, word_of(header.budget_us, header.item));
  store_le(to + kAtSenderTime, header.sender_time_ns);
  store_le(to + kAtTraceId, header.trace_id);
}

expected<Header, DropReason> decode(ConstBytes bytes) noexcept {
  Header header;
  if (auto read = decode(bytes, header); !read) return unexpected{read.error()};
  return header;
}

void mark_repeated(std::byte* frame) noexcept {
  store_le<std::uint16_t>(frame + kAtFlags, kFlagRepeated);
}

Header header_about(const Header& about, FrameKind kind, std::size_t payload_size,
                    MonotonicTime now) noexcept {
  Header header;
  header.kind = kind;
  header.priority = about.priority;
  header.session = about.session;
  header.call_id = about.call_id;
  header.service = about.service;
  header.method = about.method;
  header.payload_size = header.message_size = static_cast<std::uint32_t>(payload_size);
  header.sender_time_ns = static_cast<std::uint64_t>(to_ns(now));
  header.trace_id = about.trace_id;
  return header;
}

std::uint32_t fragment_size_of(const Header& header) noexcept {
  const std::uint32_t count = header.fragment_count;
  if (count < 2 || count > kFragmentCountMax || header.fragment_index >= count ||
      header.payload_size == 0 || header.payload_size >= header.message_size) {
    return 0;
  }
  const bool is_last = header.fragment_index == count - 1;
  const std::uint32_t before_last = header.message_size - header.payload_size;
  if (is_last && before_last % (count - 1) != 0) return 0;
  const std::uint32_t size = is_last ? before_last / (count - 1) : header.payload_size;
  const std::uint64_t capacity = std::uint64_t{size} * count;
  const bool fits = capacity >= header.message_size && capacity - size < header.message_size;
  return fits ? size : 0;
}

// hp-2-3: a datagram is exactly one frame.
expected<Header, DropReason> decode_frame(ConstBytes frame) noexcept {
  auto header = decode(frame);
  if (header && header->payload_size != frame.size() - kHeaderSize) {
    return unexpected{DropReason::kBadLength};
  }
  return header;
}

// hp-2-6, hp-8-2: larger frames are dropped even if their message would be accepted.
expected<void, DropReason> decode_frame(ConstBytes frame, Medium medium, Header& header) noexcept {
  auto read = decode(frame, header);
  if (read && (header.payload_size != frame.size() - kHeaderSize ||
               header.payload_size > frame_payload_max(medium))) {
    return unexpected{DropReason::kBadLength};
  }
  return read;
}

std::string_view to_string(FrameKind kind) noexcept {
  static constexpr std::array<std::string_view, kFrameKindLast + 1> kNames{
      "unknown", "HELLO", "COOKIE", "WELCOME", "REFUSE", "CALL",
      "REPLY",   "CLOSE", "ACK",    "CANCEL",  "ITEM",   "CREDIT"};
  const auto index = static_cast<std::size_t>(kind);
  return kNames[index < kNames.size() ? index : 0];
}

}  // namespace rtpm::wire
