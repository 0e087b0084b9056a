#include "tap/lane_tap.hpp"

#include <cstring>

#include "rtpm/rt/clock.hpp"

namespace rtpm::rpc {
namespace {

constexpr std::uint32_t units_of(std::size_t size) noexcept {
  return static_cast<std::uint32_t>((size + TapRing::kUnit - 1) / TapRing::kUnit);
}

}  // namespace

std::uint64_t LaneTape::write(const TapDraft& draft, std::uint64_t known_number) noexcept {
  const wire::Header& header = draft.request.header;
  TapWord word{.stage = static_cast<std::uint8_t>(draft.stage),
               .status = static_cast<std::uint8_t>(draft.status)};
  const std::size_t size_max = filter.has_payloads ? filter.payload_byte_max : 0;
  word.has_request = draft.request_payload.size() <= size_max;
  word.has_reply = draft.reply_payload.size() <= size_max;
  if (filter.has_payloads && !(word.has_request && word.has_reply)) {
    omitted_payload_count.fetch_add(word.has_request == word.has_reply ? 2 : 1,
                                    std::memory_order_relaxed);
  }
  constexpr std::uint32_t kHeadUnits = sizeof(TapRecord) / TapRing::kUnit;
  const std::uint32_t request_units = word.has_request ? units_of(draft.request_payload.size()) : 0;
  const std::uint32_t reply_units = word.has_reply ? units_of(draft.reply_payload.size()) : 0;
  word.unit_count = kHeadUnits + request_units + reply_units;
  const auto [record, lane_number] = ring.reserve(word.unit_count, known_number == 0);
  if (record == nullptr) {
    dropped_count.fetch_add(1, std::memory_order_relaxed);
    return 0;
  }
  const std::uint64_t number =
      known_number != 0 ? known_number : std::uint64_t{lane_number} * lane_count + lane + 1;
  record->number = number;
  record->session = header.session;
  record->trace_id = header.trace_id;
  record->received_ns = to_ns(draft.request.received);
  record->finished_ns = to_ns(rt::now());
  record->request_size = static_cast<std::uint32_t>(draft.request_payload.size());
  record->reply_size = static_cast<std::uint32_t>(draft.reply_payload.size());
  record->service = header.service;
  record->method = header.method;
  record->priority = static_cast<std::uint16_t>(header.priority.value());
  auto* const payloads = reinterpret_cast<std::byte*>(record + 1);
  if (request_units > 0) {
    std::memcpy(payloads, draft.request_payload.data(), draft.request_payload.size());
  }
  if (reply_units > 0) {
    std::memcpy(payloads + std::size_t{request_units} * TapRing::kUnit, draft.reply_payload.data(),
                draft.reply_payload.size());
  }
  TapRing::commit(*record, word);
  return number;
}

TapMark LaneTap::record(const TapDraft& draft, const TapMark& mark) noexcept {
  TapMark written;
  // SYNC POINT tap-off: the lane announces that it writes, then looks whether the tap is on; the
  // reader does the reverse. Sequentially consistent, so that at least one sees the other.
  writer_count_.fetch_add(1, std::memory_order_seq_cst);
  if (LaneTape* const tape = tape_.load(std::memory_order_seq_cst)) {
    const bool is_wanted = mark.number == 0 ? tape->filter.wants(draft.request.header)
                                            : mark.generation == tape->generation;
    if (is_wanted) written = {tape->write(draft, mark.number), tape->generation};
  }
  writer_count_.fetch_sub(1, std::memory_order_release);
  return written;
}

void LaneTap::on_whole(const wire::Request& request, wire::Status status,
                       ConstBytes reply) noexcept {
  static_cast<void>(record({request, TapStage::kWhole, status, request.payload, reply}, {}));
}

TapMark LaneTap::on_begun(const wire::Request& request) noexcept {
  return record({request, TapStage::kBegun, wire::Status::kOk, request.payload, {}}, {});
}

void LaneTap::on_item(const TapMark& mark, const wire::Request& request, ConstBytes item) noexcept {
  if (!is_on()) return;
  static_cast<void>(record({request, TapStage::kItem, wire::Status::kOk, {}, item}, mark));
}

void LaneTap::on_ended(const TapMark& mark, const wire::Request& request, wire::Status status,
                       ConstBytes reply) noexcept {
  if (!is_on()) return;
  static_cast<void>(record({request, TapStage::kEnded, status, {}, reply}, mark));
}

}  // namespace rtpm::rpc
