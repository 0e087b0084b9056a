// Messages in fragments and streams, each end by itself, under numbers that the input chooses: what
// is put together is what came, nothing is written outside its room, and no more is on its way than
// the window allows.

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "rtpm/base/assert.hpp"
#include "rtpm/wire/fragments.hpp"
#include "rtpm/wire/stream.hpp"
#include "script.hpp"

using namespace rtpm;
using namespace rtpm::wire;

namespace {

using Room = std::vector<std::byte>;

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
  Room room(first.message_size);
  Room expected(first.message_size);
  std::vector<bool> is_there(first.fragment_count);
  IncomingMessage message;
  message.begin(first, room);
  while (script.has_more()) {
    const Header header = header_of(script);
    const bool is_good = header.message_size == first.message_size &&
                         header.fragment_count == first.fragment_count &&
                         header.item == first.item && fragment_size_of(header) == size;
    const Room payload(header.payload_size, std::byte{script.byte()});
    const IncomingMessage::Taken taken = message.take(header, payload);
    RTPM_ASSERT(is_good == (taken != IncomingMessage::Taken::kForeign), "it knows its own");
    if (!is_good) continue;
    RTPM_ASSERT(is_there[header.fragment_index] == (taken == IncomingMessage::Taken::kCopy),
                "a fragment is taken once");
    if (taken == IncomingMessage::Taken::kCopy) continue;
    is_there[header.fragment_index] = true;
    std::ranges::copy(payload, expected.begin() + header.fragment_index * std::ptrdiff_t{size});
    const auto missing = std::ranges::find(is_there, false) - is_there.begin();
    RTPM_ASSERT(message.ack().first_missing == missing, "it says what is missing");
    RTPM_ASSERT(message.is_complete() == (missing == first.fragment_count), "it knows its end");
  }
  RTPM_ASSERT(room == expected, "what is put together is what came");
}

void take_apart(fuzz::Script& script) {
  const Room message(1U + script.number() % 20'000);
  const auto fragment_size =
      static_cast<std::uint32_t>(std::max<std::size_t>(1U + script.byte(), message.size() / 250));
  if (fragment_size >= message.size()) return;
  OutgoingMessage outgoing;
  outgoing.begin({}, message, fragment_size, kFragmentWindow);
  Room frame(kHeaderSize + fragment_size);
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
    // Fragments behind the first missing one may be there, too.
    acknowledged = static_cast<std::uint32_t>(message.size());
    if (script.byte() % 4 == 0) outgoing.nudge();
  }
}

void give_items(fuzz::Script& script) {
  constexpr std::size_t kFrameSize = kHeaderSize + 16;
  const bool is_kept = script.byte() % 2 == 0;
  Room memory((is_kept ? kStreamWindow : 1) * kFrameSize);
  Header call;
  call.item = script.number();
  const std::uint32_t first = script.number();
  OutgoingStream stream;
  stream.begin(call, memory, kFrameSize, is_kept, first);
  std::uint32_t there = first;  // What the other end is known to have.
  while (script.has_more()) {
    for (int i = 0; i < 40 && !stream.item_buffer().empty(); ++i) {
      const std::uint32_t number = stream.count();
      const auto header = decode_frame(stream.push(number % 17, time_from_ns(1)));
      RTPM_ASSERT(header.has_value() && header->item == number, "items are numbered upward");
      RTPM_ASSERT(!is_kept || number - there < kStreamWindow, "the window is kept");
    }
    const StreamCredit credit{there + script.byte() % 40U, script.number()};
    const std::uint32_t count = stream.count();
    stream.on_credit(credit, script.number(), script.byte() % 2 == 0);
    if (credit.first_missing - there <= count - there) there = credit.first_missing;
    int repaired = 0;
    for (ConstBytes one; !(one = stream.next()).empty(); ++repaired) {
      const auto header = decode_frame(one);
      RTPM_ASSERT(is_kept && header.has_value(), "what is repeated was kept");
      RTPM_ASSERT(header->item - there < kStreamWindow && header->payload_size == header->item % 17,
                  "what is repeated is what was sent");
      RTPM_ASSERT(repaired < 32, "repairs have an end");
    }
  }
}

void take_items(fuzz::Script& script) {
  constexpr std::size_t kItemSize = 16;
  const std::uint32_t window = 1 + script.byte() % kStreamWindow;
  const std::uint32_t first = script.number();
  Room memory(window * kItemSize);
  IncomingStream stream;
  stream.begin(memory, window, kItemSize, first);
  std::uint32_t taken = first;
  while (script.has_more()) {
    const std::uint8_t step = script.byte();
    const std::uint32_t number = taken + script.byte() % 40U - 4;
    if (step % 4 == 0) {
      static_cast<void>(stream.end(number));
    } else if (step % 4 == 1) {
      const bool had = stream.has_next();
      const auto item = stream.next();
      RTPM_ASSERT(item.has_value() == had, "it has what it says");
      if (!item) continue;
      RTPM_ASSERT(
          item->size() == taken % 17 &&
              std::ranges::all_of(*item, [&](std::byte b) { return b == std::byte(taken); }),
          "items come in order, as they were");
      ++taken;
    } else {
      const Room item(number % 17, static_cast<std::byte>(number));
      static_cast<void>(stream.take(number, item));
    }
    RTPM_ASSERT(stream.limit() - taken <= window, "it takes no more than its window");
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
