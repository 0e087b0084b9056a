#include "broadcast/multicast.hpp"

#include <algorithm>
#include <cstring>

namespace rtpm::events {
namespace {

constexpr std::uint32_t kMagic = 0x5645'5452;  // "RTEV"
constexpr std::uint8_t kVersion = 1;
constexpr std::size_t kOwnerSize = 4;
constexpr std::size_t kRecordSizeMax = std::size_t{64} * 1024 * 1024;

void put_header(const MulticastHeader& header, MutableBytes to) noexcept {
  ByteWriter writer(to);
  writer.put(kMagic);
  writer.put(kVersion);
  writer.put_zeros(1);
  writer.put(header.owner_count);
  writer.put(header.id);
  writer.put(header.sequence);
  writer.put(header.record_size);
  writer.put(header.offset);
}

}  // namespace

// ev-7.1-1
std::optional<MulticastDatagram> read_multicast(ConstBytes datagram) noexcept {
  ByteReader reader(datagram);
  MulticastDatagram found;
  MulticastHeader& header = found.header;
  const auto magic = reader.take<std::uint32_t>();
  const auto version = reader.take<std::uint8_t>();
  const bool has_zeros = reader.take_zeros(1);
  header.owner_count = reader.take<std::uint16_t>();
  header.id = reader.take<std::uint64_t>();
  header.sequence = reader.take<std::uint64_t>();
  header.record_size = reader.take<std::uint32_t>();
  header.offset = reader.take<std::uint32_t>();
  found.owners = reader.take_bytes(std::size_t{header.owner_count} * kOwnerSize);
  if (!reader.ok() || magic != kMagic || version != kVersion || !has_zeros ||
      datagram.size() > kMulticastDatagramMax || header.record_size > kRecordSizeMax) {
    return std::nullopt;
  }
  found.bytes = reader.take_bytes(reader.left());
  const bool is_heartbeat = header.record_size == 0;
  const bool is_possible =
      is_heartbeat ? found.bytes.empty() && header.owner_count == 0 && header.offset == 0
                   : !found.bytes.empty() && header.offset < header.record_size &&
                         found.bytes.size() <= header.record_size - header.offset &&
                         (header.owner_count > 0) == (header.offset == 0);
  if (!is_possible) return std::nullopt;
  return found;
}

MulticastWriter::MulticastWriter(std::uint64_t id, std::size_t history_count)
    : id_(id), slots_(std::max<std::size_t>(history_count, 8)) {}

bool MulticastWriter::fits(std::size_t owner_count, std::size_t size) const noexcept {
  if (owner_count == 0 || owner_count > kMulticastOwnerCountMax || size == 0) return false;
  const std::size_t room = kMulticastDatagramMax - kMulticastHeaderSize;
  return (owner_count * kOwnerSize + size) / room < slots_.size() / 4;
}

ConstBytes MulticastWriter::make(std::span<const std::uint32_t> owners, ConstBytes events,
                                 std::size_t& offset) noexcept {
  Slot& slot = slots_[next_ % slots_.size()];
  MulticastHeader header{.id = id_,
                         .sequence = next_++,
                         .record_size = static_cast<std::uint32_t>(events.size()),
                         .offset = static_cast<std::uint32_t>(offset)};
  std::size_t at = kMulticastHeaderSize;
  if (offset == 0) {
    header.owner_count = static_cast<std::uint16_t>(owners.size());
    for (const std::uint32_t owner : owners) {
      store_le(slot.bytes + at, owner);
      at += kOwnerSize;
    }
  }
  put_header(header, slot.bytes);
  const std::size_t size = std::min(kMulticastDatagramMax - at, events.size() - offset);
  std::memcpy(slot.bytes + at, events.data() + offset, size);
  slot.size = at + size;
  offset += size;
  return {slot.bytes, slot.size};
}

ConstBytes MulticastWriter::heartbeat() noexcept {
  put_header({.id = id_, .sequence = next_}, heartbeat_);
  return heartbeat_;
}

ConstBytes MulticastWriter::datagram(std::uint64_t sequence) const noexcept {
  if (sequence < oldest_sequence() || sequence >= next_) return {};
  const Slot& slot = slots_[sequence % slots_.size()];
  return {slot.bytes, slot.size};
}

MulticastReader::MulticastReader(std::uint64_t id, std::uint32_t owner, std::uint64_t begin)
    : id_(id), owner_(owner), expected_(begin), end_(begin), slots_(kWindow) {}

bool MulticastReader::take(ConstBytes datagram) noexcept {
  const auto found = read_multicast(datagram);
  if (!found || found->header.id != id_) return false;
  const std::uint64_t sequence = found->header.sequence;
  const bool is_heartbeat = found->header.record_size == 0;
  end_ = std::max(end_, is_heartbeat ? sequence : sequence + 1);
  // ev-7.2-1: ignores datagrams already read; those too far ahead can be requested again.
  if (is_heartbeat || sequence < expected_ || sequence - expected_ >= kWindow) return true;
  Slot& slot = slots_[sequence % kWindow];
  slot.sequence = sequence;
  slot.size = datagram.size();
  std::memcpy(slot.bytes, datagram.data(), datagram.size());
  return true;
}

bool MulticastReader::read() {
  while (true) {
    if (known_at_ && expected_ >= *known_at_) {
      const std::uint64_t known = read_count_ + missed_count_;
      if (has_lost_ && known_written_ > known) missed_count_ += known_written_ - known;
      has_lost_ = false;
      known_at_.reset();
    }
    const Slot& slot = slots_[expected_ % kWindow];
    if (slot.sequence != expected_) return false;
    ++expected_;
    const auto datagram = read_multicast({slot.bytes, slot.size});
    if (datagram && append(*datagram)) return true;
  }
}

// True if this completes a record for the owner.
bool MulticastReader::append(const MulticastDatagram& datagram) {
  const MulticastHeader& header = datagram.header;
  if (header.offset == 0) {
    record_size_ = header.record_size;
    filled_ = 0;
    is_wanted_ = false;
    for (std::size_t at = 0; at < datagram.owners.size(); at += kOwnerSize)
      is_wanted_ |= load_le<std::uint32_t>(datagram.owners.data() + at) == owner_;
    const std::size_t lines = (record_size_ + sizeof(Line) - 1) / sizeof(Line);
    if (is_wanted_ && record_.size() < lines) record_.resize(lines);
  }
  // The beginning of the record was lost.
  if (header.offset != filled_ || header.record_size != record_size_) is_wanted_ = false;
  filled_ = header.offset + datagram.bytes.size();
  if (!is_wanted_) return false;
  std::memcpy(record_.data()->bytes + header.offset, datagram.bytes.data(), datagram.bytes.size());
  if (filled_ < record_size_) return false;
  is_wanted_ = false;
  events_ = {record_.data()->bytes, record_size_};
  return true;
}

// ev-7.2-2
std::optional<MulticastReader::Gap> MulticastReader::gap() const noexcept {
  const std::uint64_t end = std::min(end_, expected_ + kWindow);
  std::uint64_t first = expected_;
  while (first < end && slots_[first % kWindow].sequence == first)
    ++first;
  if (first == end) return std::nullopt;
  Gap gap{first, 0};
  for (std::uint64_t i = 0; i < 64 && first + 1 + i < end; ++i) {
    const std::uint64_t sequence = first + 1 + i;
    if (slots_[sequence % kWindow].sequence != sequence) gap.later |= std::uint64_t{1} << i;
  }
  return gap;
}

// ev-7.3-2
void MulticastReader::note(std::uint64_t oldest, std::uint64_t next,
                           std::uint64_t written_count) noexcept {
  if (oldest > expected_) {
    expected_ = std::min(oldest, next);
    has_lost_ = true;
    is_wanted_ = false;
    record_size_ = 0;
  }
  end_ = std::max(end_, next);
  known_at_ = next;
  known_written_ = written_count;
}

}  // namespace rtpm::events
