#include "subjects.hpp"

#include <array>
#include <cstdint>
#include <memory>
#include <string_view>
#include <type_traits>

#include "event_crowd.hpp"
#include "joined_protocol.hpp"
#include "rtpm/base/hash.hpp"
#include "rtpm/base/histogram.hpp"
#include "rtpm/base/latest.hpp"
#include "rtpm/base/record_ring.hpp"
#include "rtpm/base/ring.hpp"
#include "rtpm/crypto/primitives.hpp"
#include "rtpm/gvd/command_lease.hpp"
#include "rtpm/predicate/predicate.hpp"
#include "rtpm/safety/filter.hpp"
#include "tip.hpp"

// Adds a subject. Its symbol is not mangled, because callgrind takes it as an option. Its first run
// sets it up, so only later ones count.
#define RTPM_SUBJECT(name)                                                           \
  extern "C" void counted_##name();                                                  \
  [[maybe_unused]] const bool is_added_##name = add(Subject{#name, counted_##name}); \
  extern "C" [[gnu::noinline]] void counted_##name()

namespace rtpm::bench::micro {
namespace {

bool add(const Subject& subject) {
  subjects().push_back(subject);
  return true;
}

/// Keeps the compiler from removing the computation of `value`, and from knowing it afterwards.
template <class T>
void keep(T& value) {
  asm volatile("" : "+m"(value) : : "memory");
}

/// Keeps each result of `step`, if it has one.
template <class Step>
void repeat(Step step) {
  for (int i = 0; i < kRepeatCount; ++i) {
    if constexpr (std::is_void_v<decltype(step())>) {
      step();
    } else {
      auto result = step();
      keep(result);
    }
  }
}

struct State {
  std::array<double, 40> values{};
};

void offer_to(Crowd& crowd) {
  repeat([&] { return crowd.offer(); });
}

struct HapticDevice final : predicate::PropertySource {
  [[nodiscard]] predicate::Operand find(std::string_view name) const noexcept override {
    if (name == "force_newton_max") return 3.3;
    if (name == "class") return std::string_view("haptic");
    return {};
  }
};

/// All mechanisms that a device's description allows are on.
gvd::SafetyConfig safety_config() {
  gvd::SafetyConfig config;
  config.force_newton_max = 9;
  config.torque_newton_metre_max = 0.5;
  config.power_watt_max = 5;
  config.velocity_m_per_s_max = 2;
  config.wall_newton_per_m = 1000;
  config.force_newton_continuous = 3;
  config.has_passivity_guard = true;
  return config;
}

/// A whole call of 48 bytes, over a transport or within the program. The tap's ring holds all runs.
template <rpc::Transport transport, bool is_tapped>
void call_served_tip() {
  static ServedTip served(transport, is_tapped);
  repeat([] { return served.call(); });
}

}  // namespace

// ---- the codec and sessions ---------------------------------------------------------------------

RTPM_SUBJECT(encode_header) {
  static wire::Header header = call_header();
  alignas(16) CallFrame frame{};
  repeat([&] {
    ++header.call_id;
    wire::encode(header, frame.data());
    keep(frame);
  });
}

RTPM_SUBJECT(decode_header) {
  alignas(16) CallFrame frame = call_frame();
  repeat([&] {
    keep(frame);
    return wire::decode_frame(frame);
  });
}

RTPM_SUBJECT(siphash_40_bytes) {
  std::array<std::byte, 40> input{};
  repeat([&] {
    keep(input);
    return siphash_2_4({.low = 1, .high = 2}, input);
  });
}

RTPM_SUBJECT(protocol_call_48_bytes) {
  static JoinedProtocol protocol(1024);
  repeat([] { protocol.call(48); });
}

RTPM_SUBJECT(protocol_call_64_kib) {
  static JoinedProtocol protocol(64 * 1024);
  repeat([] { protocol.call(std::size_t{64} * 1024); });
}

// ---- seals --------------------------------------------------------------------------------------

/// A call's payload, with the header as associated data.
RTPM_SUBJECT(seal_and_open_48_bytes) {
  static crypto::AeadKey key;
  static std::uint64_t number = 0;
  crypto::Secret secret;
  key.set(crypto::Suite::kChaChaPoly, secret);
  std::array<std::byte, wire::kHeaderSize> header{};
  std::array<std::byte, 48> payload{};
  std::array<std::byte, crypto::kTagSize> tag{};
  repeat([&] {
    key.seal(++number, header, payload, payload, tag);
    return key.open(number, header, payload, tag, payload);
  });
}

// ---- rings --------------------------------------------------------------------------------------

RTPM_SUBJECT(latest_write_and_read) {
  static auto& latest = *std::make_unique<Latest<State>>().release();
  State value;
  repeat([&] {
    value.values[0] += 1;
    latest.write(value);
    return latest.read();
  });
}

RTPM_SUBJECT(ring_push_and_pop) {
  static SpscRing<std::uint64_t, 64> ring;
  std::uint64_t number = 0;
  repeat([&] {
    bool is_pushed = ring.push(++number);
    keep(is_pushed);
    return ring.pop();
  });
}

RTPM_SUBJECT(record_ring_112_bytes) {
  static struct {
    RecordRingControl control{};
    alignas(kRecordAlignment) std::array<std::byte, kRecordSlotsSize> slots{};
    alignas(kRecordAlignment) std::array<std::byte, 4096> records{};
  } memory;
  static RecordWriter writer({memory.control, memory.slots, memory.records});
  static RecordReader reader({memory.control, memory.slots, memory.records});
  CallFrame frame{};
  repeat([&] {
    auto written = writer.write(frame);
    keep(written);
    return reader.read(frame);
  });
}

RTPM_SUBJECT(histogram_record) {
  static auto& histogram = *std::make_unique<LatencyHistogram>().release();
  std::int64_t latency_ns = 1;
  repeat([&] {
    latency_ns = (latency_ns * 31) % 1'000'003;
    histogram.record(std::chrono::nanoseconds{latency_ns});
  });
}

// ---- filters of events, predicates --------------------------------------------------------------

RTPM_SUBJECT(events_match) {
  static Crowd crowd(100, true, events::of_type);
  offer_to(crowd);
}

RTPM_SUBJECT(events_match_by_field) {
  static Crowd crowd(100, true, by_value);
  offer_to(crowd);
}

RTPM_SUBJECT(events_queue) {
  static Crowd crowd(100, false, events::of_type);
  offer_to(crowd);
}

RTPM_SUBJECT(predicate_accepts) {
  static const auto predicate =
      needed(predicate::Predicate::parse("force_newton_max > 2 and class == 'haptic'"));
  const HapticDevice device;
  repeat([&] { return predicate.accepts(device); });
}

// ---- a device's command -------------------------------------------------------------------------

RTPM_SUBJECT(lease_use_and_step) {
  static gvd::Lease lease({}, {.low = 1, .high = 2});
  static const std::uint64_t holder = *lease.acquire();
  static MonotonicTime now = time_from_ns(1'000'000'000);
  repeat([&] {
    now += std::chrono::milliseconds{1};
    bool is_held = lease.use(holder);
    keep(is_held);
    return lease.step(now);
  });
}

RTPM_SUBJECT(safety_filter_step) {
  static gvd::SafetyFilter filter(safety_config());
  static MonotonicTime now = time_from_ns(1'000'000'000);
  const gvd::Motion motion{.position_m = {0.01, 0.02, 0.03}};
  repeat([&] {
    now += std::chrono::milliseconds{1};
    return filter.step(
        now, gvd::WrenchCommand{{{1, 2, 3}, {0.1, 0, 0}}, now, now + std::chrono::milliseconds{20}},
        motion);
  });
}

// ---- calls --------------------------------------------------------------------------------------

RTPM_SUBJECT(generated_call_48_bytes) {
  static Tip tip;
  static GeneratedCall call;
  rpc::Servant* servant = &tip;
  keep(servant);
  repeat([&] { return call.run(*servant); });
}

RTPM_SUBJECT(local_call_48_bytes) {
  call_served_tip<rpc::Transport::kLocal, false>();
}
RTPM_SUBJECT(local_call_while_tapped) {
  call_served_tip<rpc::Transport::kLocal, true>();
}
RTPM_SUBJECT(memory_call_48_bytes) {
  call_served_tip<rpc::Transport::kSharedMemory, false>();
}
RTPM_SUBJECT(memory_call_while_tapped) {
  call_served_tip<rpc::Transport::kSharedMemory, true>();
}
RTPM_SUBJECT(udp_call_48_bytes) {
  call_served_tip<rpc::Transport::kUdp, false>();
}
RTPM_SUBJECT(udp_call_while_tapped) {
  call_served_tip<rpc::Transport::kUdp, true>();
}

}  // namespace rtpm::bench::micro
