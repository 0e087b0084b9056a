#include "rtpm/rpc/lane_table.hpp"

#include <algorithm>
#include <new>
#include <span>
#include <type_traits>
#include <utility>

#include "model/lane_table_owner.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/thread.hpp"
#include "rtpm/rt/wait.hpp"

namespace rtpm::rpc {
namespace {

// A server has at most 64 lanes; a table that claims more is not RTPM's.
constexpr std::size_t kTableSizeMax = std::size_t{1} << 20;

static_assert(std::is_trivially_copyable_v<LaneSample>);
static_assert(sizeof(LaneTableHeader) % alignof(LaneSlot) == 0, "the slots follow at once");
// A changed layout needs a new version: readers of the old one would misread it.
static_assert(sizeof(LaneSample) == 8 * 50 && kLaneTableVersion == 4);

// Reads a value once, so that the compiler can't re-read it after the check.
template <class T>
T read_once(const T& value) noexcept {
  return *static_cast<const volatile T*>(&value);
}

// Text from an untrusted process: up to its 0, without terminal control characters.
std::string text_of(std::span<const char> text) {
  std::string clean;
  for (const char& place : text) {
    const char character = read_once(place);
    if (character == 0) break;
    clean += character >= ' ' && character <= '~' ? character : '?';
  }
  return clean;
}

template <std::size_t Size>
void put(std::array<char, Size>& place, std::string_view text) {
  std::copy_n(text.begin(), std::min(text.size(), Size - 1), place.begin());
}

LaneTableHeader& header_of(const rt::PublicMemory& table) noexcept {
  return *reinterpret_cast<LaneTableHeader*>(table.bytes().data());
}

thread_local std::atomic<std::int64_t>* busy_place = nullptr;

}  // namespace

void BusyMark::show_at(std::atomic<std::int64_t>* place) noexcept {
  busy_place = place;
}

BusyMark::BusyMark(MonotonicTime received) noexcept {
  if (busy_place != nullptr) busy_place->store(to_ns(received), std::memory_order_relaxed);
}

BusyMark::~BusyMark() {
  if (busy_place != nullptr) busy_place->store(0, std::memory_order_relaxed);
}

expected<rt::PublicMemory, SetupError> make_lane_table(const ServerConfig& config,
                                                       std::string_view hosts, std::uint16_t port,
                                                       bool is_open_to_network) {
  const std::size_t count = config.lanes.size();
  auto table =
      rt::PublicMemory::create(kLaneTableName, sizeof(LaneTableHeader) + count * sizeof(LaneSlot));
  if (!table) return table;
  auto* const header = new (table->bytes().data()) LaneTableHeader;
  header->version = kLaneTableVersion;
  header->slot_size = sizeof(LaneSlot);
  header->slot_count = static_cast<std::uint32_t>(count);
  header->port = port;
  header->is_open_to_network = is_open_to_network ? 1 : 0;
  header->created_ns = to_ns(rt::now());
  put(header->server_name, config.name);
  put(header->host, hosts);
  for (std::size_t i = 0; i < count; ++i)
    new (table->bytes().data() + sizeof(LaneTableHeader) + i * sizeof(LaneSlot)) LaneSlot;
  return table;
}

LaneSlot& slot_of(const rt::PublicMemory& table, std::size_t lane) noexcept {
  return reinterpret_cast<LaneSlot*>(table.bytes().data() + sizeof(LaneTableHeader))[lane];
}

void open_to_readers(const rt::PublicMemory& table) noexcept {
  header_of(table).magic.store(kLaneTableMagic, std::memory_order_release);
}

std::vector<LaneTable> LaneTable::find() {
  std::vector<LaneTable> tables;
  for (rt::PublicView& view : rt::find_public_memory(kLaneTableName, kTableSizeMax))
    tables.push_back(LaneTable(std::move(view)));
  return tables;
}

LaneTable::LaneTable(rt::PublicView view) : view_(std::move(view)) {
  check();
}

// Copies the constant part once: the process may modify it meanwhile.
void LaneTable::check() {
  const ConstBytes bytes = view_.bytes();
  if (bytes.size() < sizeof(LaneTableHeader)) return;
  const auto& header = *reinterpret_cast<const LaneTableHeader*>(bytes.data());
  // SYNC POINT lane-table: a table with the magic is complete.
  if (header.magic.load(std::memory_order_acquire) != kLaneTableMagic) return;
  version_ = read_once(header.version);
  if (version_ != kLaneTableVersion || read_once(header.slot_size) != sizeof(LaneSlot)) return;
  const std::uint32_t count = read_once(header.slot_count);
  if (count > (bytes.size() - sizeof(LaneTableHeader)) / sizeof(LaneSlot)) return;
  slot_count_ = count;
  port_ = read_once(header.port);
  is_open_to_network_ = read_once(header.is_open_to_network) != 0;
  server_name_ = text_of(header.server_name);
  host_ = text_of(header.host);
}

std::vector<LaneReading> LaneTable::read() const {
  std::vector<LaneReading> readings;
  const auto* const slots =
      reinterpret_cast<const LaneSlot*>(view_.bytes().data() + sizeof(LaneTableHeader));
  for (const LaneSlot& slot : std::span(slots, slot_count_)) {
    LaneReading reading;
    reading.name = text_of(slot.name);
    reading.band_low = read_once(slot.band_low);
    reading.band_high = read_once(slot.band_high);
    reading.priority = read_once(slot.priority);
    reading.wait = to_string(static_cast<rt::WaitStrategy>(read_once(slot.wait)));
    reading.schedule = to_string(static_cast<rt::Schedule>(read_once(slot.schedule)));
    for (const auto& thread : slot.busy_since_ns) {
      const MonotonicTime since = time_from_ns(thread.load(std::memory_order_relaxed));
      if (since == MonotonicTime{}) continue;
      if (reading.busy_count++ == 0 || since < reading.busy_since) reading.busy_since = since;
    }
    reading.sample = slot.sample.read();
    readings.push_back(std::move(reading));
  }
  return readings;
}

}  // namespace rtpm::rpc
