// Messages in fragments and streams, each end by itself, with numbers from the input: a reassembled
// message equals the sent one, nothing is written outside its buffer, and no more is in flight than
// the window allows.

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "rtpm/base/assert.hpp"
#include "rtpm/wire/fragments.hpp"
#include "rtpm/wire/stream.hpp"
#include "script.hpp"

using namespace rtpm;
using namespace rtpm::wire;

namespace {

using Buffer = std::vector<std::byte>;

Header header_of(fuzz::Script& script) {
  Header header;
  header.fragment_index = script.byte();
  header.fragment_count = script.byte();
  header.payload_size = script.byte();
  header.message_size = script.number() % 20'000;
  header.item = script.byte() < 250 ? 0 : 1;
  return header;
}

void put_together(fuzz::Script& script) {
  const Header first = header_of(script);
  const std::uint32_t size = fragment_size_of(first);
  if (size == 0) return;
  Buffer buffer(first.message_size);
  Buffer expected(first.message_size);
  std::vector<bool> is_there(first.fragment_count);
  IncomingMessage message;
  message.begin(first, buffer);
  while (script.has_more()) {
    const Header header = header_of(script);
    const bool is_good = header.message_size == first.message_size &&
                         header.fragment_count == first.fragment_count &&
                         header.item == first.item && fragment_size_of(header) == size;
    const Buffer payload(header.payload_size, std::byte{script.byte()});
    const IncomingMessage::Taken taken = message.take(header, payload);
    RTPM_ASSERT(is_good == (taken != IncomingMessage::Taken::kForeign),
                "it accepts exactly the fragments of its message");
    if (!is_good) continue;
    RTPM_ASSERT(is_there[header.fragment_index] == (taken == IncomingMessage::Taken::kDuplicate),
                "a fragment is taken once");
    if (taken == IncomingMessage::Taken::kDuplicate) continue;
    is_there[header.fragment_index] = true;
    std::ranges::copy(payload, expected.begin() + header.fragment_index * std::ptrdiff_t{size});
    const auto missing = std::ranges::find(is_there, false) - is_there.begin();
    RTPM_ASSERT(message.ack().first_missing == missing, "its ACK names the first missing fragment");
    RTPM_ASSERT(message.is_complete() == (missing == first.fragment_count),
                "it is complete with all fragments");
  }
  RTPM_ASSERT(buffer == expected, "the reassembled message equals the received fragments");
}

void take_apart(fuzz::Script& script) {
  const Buffer message(1U + script.number() % 20'000);
  const auto fragment_size =
      static_cast<std::uint32_t>(std::max<std::size_t>(1U + script.byte(), message.size() / 250));
  if (fragment_size >= message.size()) return;
  OutgoingMessage outgoing;
  outgoing.begin({}, message, fragment_size, kFragmentWindow);
  Buffer frame(kHeaderSize + fragment_size);
  std::uint32_t acknowledged = 0;
  std::uint32_t sent = 0;
  while (script.has_more()) {
    for (ConstBytes one; !(one = outgoing.next(frame, 1, time_from_ns(1))).empty();) {
      const auto header = decode_frame(one);
      RTPM_ASSERT(header.has_value(), "it sends frames");
      RTPM_ASSERT(header->fragment_index < acknowledged + kFragmentWindow, "the window is kept");
      sent = std::max<std::uint32_t>(sent, header->fragment_index + 1U);
    }
    FragmentAck ack;
    ack.first_missing = script.byte();
    for (std::uint64_t& word : ack.later)
      word = script.number();
    outgoing.on_ack(ack, script.byte() % 2 == 0);
    if (ack.first_missing > sent) continue;
    // Fragments after the first missing one may have arrived, too.
    acknowledged = static_cast<std::uint32_t>(message.size());
    if (script.byte() % 4 == 0) outgoing.nudge();
  }
}

constexpr std::uint32_t kPart = 16;

/// A stream of items by a rule: of every five, four fit in a frame, and the fifth takes three.
constexpr std::uint32_t kItemsPerRound = 5;
constexpr std::uint32_t kFramesPerRound = 7;

Buffer item_of(std::uint32_t item) {
  const bool is_large = item % kItemsPerRound == kItemsPerRound - 1;
  return Buffer(is_large ? 2 * kPart + 1 + item % kPart : item % (kPart + 1),
                static_cast<std::byte>(item));
}

/// The frame `number`, counted from 0.
std::pair<Header, Buffer> frame_of(std::uint32_t number) {
  const std::uint32_t round = number / kFramesPerRound;
  const std::uint32_t position = number % kFramesPerRound;
  const std::uint32_t item = round * kItemsPerRound + std::min(position, kItemsPerRound - 1);
  Buffer whole = item_of(item);
  Header header;
  header.kind = FrameKind::kItem;
  header.message_size = header.payload_size = static_cast<std::uint32_t>(whole.size());
  if (position < kItemsPerRound - 1) return {header, whole};
  header.fragment_count = 3;
  header.fragment_index = static_cast<std::uint16_t>(position - (kItemsPerRound - 1));
  const ConstBytes rest = ConstBytes(whole).subspan(header.fragment_index * std::size_t{kPart});
  const ConstBytes part = rest.first(std::min<std::size_t>(kPart, rest.size()));
  header.payload_size = static_cast<std::uint32_t>(part.size());
  return {header, Buffer(part.begin(), part.end())};
}

void give_items(fuzz::Script& script) {
  constexpr std::size_t kFrameSize = kHeaderSize + kPart;
  const bool is_kept = script.byte() % 2 == 0;
  Buffer memory((is_kept ? kStreamWindow : 1) * kFrameSize);
  Header call;
  call.item = script.number();
  const std::uint32_t first = script.number();
  OutgoingStream stream;
  stream.begin(call, {.memory = memory, .frame_size = kFrameSize, .fragment_size = kPart},
               is_kept ? Medium::kDatagram : Medium::kStream, first);
  std::uint32_t there = first;  // The other end has all fragments before this one.
  std::uint32_t item = 0;
  while (script.has_more()) {
    for (int i = 0; i < 40; ++i) {
      const std::uint32_t number = stream.count();
      const ConstBytes frame = stream.push(item_of(item), time_from_ns(1));
      if (frame.empty()) break;
      const auto header = decode_frame(frame);
      const auto wanted = frame_of(number - first);
      RTPM_ASSERT(header.has_value() && header->item == number, "frames are numbered upward");
      RTPM_ASSERT(header->fragment_index == wanted.first.fragment_index &&
                      std::ranges::equal(frame.subspan(kHeaderSize), wanted.second),
                  "an item is cut as it should be");
      RTPM_ASSERT(!is_kept || number - there < kStreamWindow, "the window is kept");
      if (!stream.is_midway()) ++item;
    }
    const StreamCredit credit{there + script.byte() % 40U, script.number(), script.number()};
    const std::uint32_t count = stream.count();
    stream.on_credit(credit, script.number(), script.byte() % 2 == 0);
    if (credit.first_missing - there <= count - there) there = credit.first_missing;
    int repaired = 0;
    for (ConstBytes one; !(one = stream.next()).empty(); ++repaired) {
      const auto header = decode_frame(one);
      RTPM_ASSERT(is_kept && header.has_value(), "what is repeated was kept");
      RTPM_ASSERT(
          header->item - there < kStreamWindow &&
              std::ranges::equal(one.subspan(kHeaderSize), frame_of(header->item - first).second),
          "what is repeated is what was sent");
      RTPM_ASSERT(repaired < 32, "repairs have an end");
    }
  }
}

void take_items(fuzz::Script& script) {
  const std::uint8_t how = script.byte();
  const std::uint32_t window = 1 + how % kStreamWindow;
  const bool is_lying = how >= 128;
  const std::uint32_t first = script.number();
  Buffer memory((window + 8) * kPart);
  Buffer item_buffer(3 * std::size_t{kPart});
  IncomingStream stream;
  stream.begin(
      {.frames = memory, .frame_size = kPart, .item = item_buffer, .byte_window = 8 * kPart},
      window, first);
  std::uint32_t taken = 0;
  while (script.has_more()) {
    const std::uint8_t step = script.byte();
    const std::uint32_t number = stream.credit().first_missing + script.byte() % 40U - 4;
    if (step % 4 == 0) {
      static_cast<void>(stream.end(number));
    } else if (step % 4 == 1) {
      const bool had = stream.has_next();
      const auto item = stream.next();
      RTPM_ASSERT(item.has_value() == had, "it has what it says");
      if (!item) continue;
      RTPM_ASSERT(is_lying || std::ranges::equal(*item, item_of(taken)),
                  "items come in order, as they were");
      RTPM_ASSERT(item->size() <= item_buffer.size(), "an item is not larger than its buffer");
      ++taken;
    } else {
      auto [header, payload] = frame_of(number - first);
      header.item = number;
      if (is_lying && step >= 128) {
        header.fragment_index = script.byte() % 4;
        header.fragment_count = 1 + script.byte() % 4;
        header.message_size = header.fragment_count == 1 ? header.payload_size : script.byte();
        if (header.fragment_count > 1 && fragment_size_of(header) == 0) continue;
        if (header.fragment_count == 1) header.fragment_index = 0;
      }
      static_cast<void>(stream.take(header, payload));
    }
    RTPM_ASSERT(stream.limit() - taken <= window, "it takes no more than its window");
    const std::uint32_t beyond = stream.credit().first_missing - stream.freed_count();
    RTPM_ASSERT(beyond <= window + 8, "it keeps no more frames than its buffer holds");
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::Script script(data, size);
  switch (script.byte() % 4) {
    case 0:
      put_together(script);
      break;
    case 1:
      take_apart(script);
      break;
    case 2:
      give_items(script);
      break;
    default:
      take_items(script);
      break;
  }
  return 0;
}
