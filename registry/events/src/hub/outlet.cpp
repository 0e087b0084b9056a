#include "hub/outlet.hpp"

#include <algorithm>
#include <array>
#include <cstring>

#include "rtpm/wire/limits.hpp"

namespace rtpm::events {
namespace {

// The maximum size of an item without its events: table, structs, padding, and the builder's
// scratch space.
constexpr std::size_t kItemOverheadMax = 256;
constexpr std::size_t kItemMemory = wire::kStreamFrameSizeMax + 2 * kItemOverheadMax;
// Items in flight before the consumer has taken one.
constexpr std::uint32_t kWaitingMax = wire::kStreamWindow - 1;

MutableBytes bytes_of(std::vector<std::uint64_t>& memory) noexcept {
  return std::as_writable_bytes(std::span(memory));
}

}  // namespace

ItemBuilder::ItemBuilder()
    : memory_(kItemMemory / sizeof(std::uint64_t)),
      lent_(bytes_of(memory_)),
      builder_(kItemMemory & ~std::size_t{15}, &lent_) {}

std::uint8_t* ItemBuilder::begin(std::size_t event_bytes) noexcept {
  builder_.Clear();
  events_ = {};
  if (event_bytes == 0) return nullptr;
  std::uint8_t* to = nullptr;
  builder_.ForceVectorAlignment(event_bytes, 1, 16);
  events_ = builder_.CreateUninitializedVector<std::uint8_t>(event_bytes, &to);
  return to;
}

void ItemBuilder::finish(const Extras& extras, const Part* part) noexcept {
  LossCounts losses;
  if (extras.losses != nullptr) losses = counts_of(*extras.losses);
  builder_.Finish(CreateBatch(builder_, events_, part, extras.losses == nullptr ? nullptr : &losses,
                              extras.welcome));
}

std::size_t ItemBuilder::build(const DeliveryQueue& queue, const Extras& extras,
                               std::size_t size_max, MonotonicTime now) noexcept {
  const std::size_t room = size_max - std::min(size_max, kItemOverheadMax);
  std::size_t count = 0;
  std::size_t size = 0;
  for (; count < queue.size(); ++count) {
    const std::size_t span = event_span(queue[count].event.payload().size());
    if (size + span > room) break;
    size += span;
  }
  std::uint8_t* const to = begin(size);
  EventWriter writer({reinterpret_cast<std::byte*>(to), size});
  for (std::size_t i = 0; i < count; ++i) {
    EventHeader header = queue[i].event.header();
    header.hub_sent = now;
    header.is_continued = queue[i].is_continued;
    const bool is_put = writer.put(header, queue[i].event.payload());
    RTPM_ASSERT(is_put, "the room was counted");
  }
  finish(extras, nullptr);
  return count;
}

void ItemBuilder::build_part(const EventPart& part, const Extras& extras,
                             MonotonicTime now) noexcept {
  std::array<std::byte, kEventHeaderSize> header_bytes{};
  EventHeader header = part.event.header;
  header.hub_sent = now;
  // Encoded without its payload; the size is patched in.
  EventWriter writer(header_bytes);
  const bool is_put = writer.put(header, {});
  RTPM_ASSERT(is_put, "a header has its size");
  store_le(header_bytes.data() + 48, static_cast<std::uint32_t>(part.event.payload.size()));
  std::uint8_t* const to = begin(part.size);
  std::size_t filled = 0;
  if (part.offset < kEventHeaderSize) {
    filled = std::min(part.size, kEventHeaderSize - part.offset);
    std::memcpy(to, header_bytes.data() + part.offset, filled);
  }
  if (filled < part.size) {
    std::memcpy(to + filled, part.event.payload.data() + part.offset + filled - kEventHeaderSize,
                part.size - filled);
  }
  const Part where(static_cast<std::uint32_t>(part.offset),
                   static_cast<std::uint32_t>(kEventHeaderSize + part.event.payload.size()));
  finish(extras, &where);
}

void ItemBuilder::build_refusal(std::string_view text) noexcept {
  builder_.Clear();
  constexpr std::size_t kTextMax = 900;  // Fits a datagram.
  const auto refusal = builder_.CreateString(text.data(), std::min(text.size(), kTextMax));
  builder_.Finish(CreateBatch(builder_, 0, nullptr, nullptr, nullptr, refusal));
}

bool Outlet::has_room() const noexcept {
  return writer.waiting_count() < (is_latest_only ? 1 : kWaitingMax);
}

Outlet::Outcome Outlet::pump(DeliveryQueue& queue, Losses& losses, ItemBuilder& builder,
                             MonotonicTime now) noexcept {
  while (!queue.empty() || partial_ || is_welcome_due || losses != reported_) {
    if (!writer.is_awaited()) return Outcome::kGone;
    if (!has_room()) return Outcome::kBacklog;
    const auto sent = send_once(queue, losses, builder, now);
    if (sent) continue;
    return sent.error() == rpc::StreamError::kFull ? Outcome::kBacklog : Outcome::kGone;
  }
  return Outcome::kDone;
}

expected<void, rpc::StreamError> Outlet::send_once(DeliveryQueue& queue, Losses& losses,
                                                   ItemBuilder& builder,
                                                   MonotonicTime now) noexcept {
  // A single frame, so that no event waits for fragments of others.
  const std::size_t item_max = writer.item_frame_size_max();
  const std::size_t part_max = (item_max - std::min(item_max, kItemOverheadMax)) & ~std::size_t{15};
  const Losses total = losses;
  const ItemBuilder::Extras extras{.welcome = is_welcome_due ? &welcome : nullptr,
                                   .losses = total != reported_ ? &total : nullptr};
  if (!partial_ && !queue.empty() && event_span(queue[0].event.payload().size()) > part_max) {
    // Moved out of the queue, which could replace it while it is partly sent.
    partial_ = queue[0].event;
    is_partial_continued_ = queue[0].is_continued;
    partial_offset_ = 0;
    queue.pop();
  }
  std::size_t count = 0;
  std::size_t part_size = 0;
  if (partial_) {
    EventView event = partial_.view();
    event.header.is_continued = is_partial_continued_;
    part_size = std::min(part_max, kEventHeaderSize + event.payload.size() - partial_offset_);
    builder.build_part({event, partial_offset_, part_size}, extras, now);
  } else {
    count = builder.build(queue, extras, item_max, now);
  }
  if (auto written = writer.write(builder.item()); !written) return written;
  is_welcome_due = false;
  reported_ = total;
  for (; count > 0; --count)
    queue.pop();
  partial_offset_ += part_size;
  if (partial_ && partial_offset_ == kEventHeaderSize + partial_.payload().size()) {
    partial_ = EventRef();
  }
  return {};
}

}  // namespace rtpm::events
