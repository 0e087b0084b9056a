#include "tap/lane_tap.hpp"

#include <algorithm>
#include <cstring>

#include "rtpm/rt/clock.hpp"

namespace rtpm::rpc {
namespace {

constexpr std::uint32_t units_of(std::uint32_t size) noexcept {
  return (size + TapRing::kUnit - 1) / TapRing::kUnit;
}

}  // namespace

// Inline, as its instructions add to every call.
[[gnu::always_inline]] inline std::uint64_t TapTrack::write(const TapDraft& draft) noexcept {
  const auto request_size = static_cast<std::uint32_t>(draft.request_payload.size());
  const auto reply_size = static_cast<std::uint32_t>(draft.reply_payload.size());
  std::uint32_t kept_request_size = request_size;
  std::uint32_t kept_reply_size = reply_size;
  if (std::max(request_size, reply_size) > filter.payload_byte_max) [[unlikely]] {
    if (request_size > filter.payload_byte_max) kept_request_size = 0;
    if (reply_size > filter.payload_byte_max) kept_reply_size = 0;
    if (filter.has_payloads) {
      omitted_payload_count.fetch_add(
          (kept_request_size < request_size ? 1U : 0U) + (kept_reply_size < reply_size ? 1U : 0U),
          std::memory_order_relaxed);
    }
  }
  constexpr std::uint32_t kHeadUnits = sizeof(TapRecord) / TapRing::kUnit;
  const std::uint32_t reply_unit = kHeadUnits + units_of(kept_request_size);
  const std::uint32_t unit_count = reply_unit + units_of(kept_reply_size);
  TapRecord* const record = ring.reserve(unit_count);
  if (record == nullptr) [[unlikely]] {
    dropped_count.fetch_add(1, std::memory_order_relaxed);
    return 0;
  }
  std::uint64_t number = draft.number;
  if (number == 0) {
    number = next_number;
    next_number = number + number_step;
  }
  const wire::Header& header = draft.request.header;
  record->unit_count = unit_count;
  record->stage = static_cast<std::uint8_t>(draft.stage);
  record->status = static_cast<std::uint8_t>(draft.status);
  record->has_request = kept_request_size == request_size;
  record->has_reply = kept_reply_size == reply_size;
  record->number = number;
  record->session = header.session;
  record->trace_id = header.trace_id;
  record->received_ns = to_ns(draft.request.received);
  record->finished_ns = to_ns(draft.finished);
  record->request_size = request_size;
  record->reply_size = reply_size;
  record->service = header.service;
  record->method = header.method;
  record->priority = static_cast<std::uint16_t>(header.priority.value());
  auto* const bytes = reinterpret_cast<std::byte*>(record);
  if (kept_request_size > 0) {
    std::memcpy(bytes + sizeof(TapRecord), draft.request_payload.data(), kept_request_size);
  }
  if (kept_reply_size > 0) {
    std::memcpy(bytes + std::size_t{reply_unit} * TapRing::kUnit, draft.reply_payload.data(),
                kept_reply_size);
  }
  ring.commit(unit_count);
  return number;
}

// Lets `use` write to a track that no other thread writes to, if the tap is still on.
template <class Use>
[[gnu::always_inline]] inline void LaneTap::with_track(Use use) noexcept {
  for (Writer* writer = writers_.data(); writer != writers_.data() + writer_count_; ++writer) {
    // SYNC POINT tap-off: the lane takes the writer, then checks whether the tap is on; the reader
    // does the reverse. Sequentially consistent, so at least one of them sees the other.
    if (writer->is_busy.exchange(true, std::memory_order_seq_cst)) [[unlikely]]
      continue;
    if (TapTrack* const track = writer->track.load(std::memory_order_seq_cst)) use(*track);
    writer->is_busy.store(false, std::memory_order_release);
    return;
  }
  busy_count_.fetch_add(1, std::memory_order_relaxed);
}

void LaneTap::on_whole(const wire::Request& request, wire::Status status,
                       ConstBytes reply) noexcept {
  const MonotonicTime now = rt::now();
  with_track([&](TapTrack& track) {
    if (!track.filter.wants(request.header)) return;
    track.write({request, TapStage::kWhole, status, request.payload, reply, 0, now});
  });
}

TapMark LaneTap::on_begun(const wire::Request& request) noexcept {
  const MonotonicTime now = rt::now();
  TapMark mark;
  with_track([&](TapTrack& track) {
    if (!track.filter.wants(request.header)) return;
    mark.number =
        track.write({request, TapStage::kBegun, wire::Status::kOk, request.payload, {}, 0, now});
    mark.generation = track.generation;
  });
  return mark;
}

void LaneTap::on_item(const TapMark& mark, const wire::Request& request, ConstBytes item) noexcept {
  const MonotonicTime now = rt::now();
  with_track([&](TapTrack& track) {
    if (mark.generation != track.generation) return;
    track.write({request, TapStage::kItem, wire::Status::kOk, {}, item, mark.number, now});
  });
}

void LaneTap::on_ended(const TapMark& mark, const wire::Request& request, wire::Status status,
                       ConstBytes reply) noexcept {
  const MonotonicTime now = rt::now();
  with_track([&](TapTrack& track) {
    if (mark.generation != track.generation) return;
    track.write({request, TapStage::kEnded, status, {}, reply, mark.number, now});
  });
}

void LaneTap::disconnect() noexcept {
  is_on_.store(false, std::memory_order_relaxed);
  for (Writer& writer : writers_)
    writer.track.store(nullptr, std::memory_order_seq_cst);
}

// SYNC POINT tap-off
bool LaneTap::is_in_use() const noexcept {
  return std::ranges::any_of(writers_, [](const Writer& writer) {
    return writer.is_busy.load(std::memory_order_seq_cst);
  });
}

}  // namespace rtpm::rpc
