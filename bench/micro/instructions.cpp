// rtpm-instructions: runs chosen functions a fixed number of times, for a tool that counts their
// instructions. Each function has a symbol of its own, counted_…, and runs twice: the first time it
// sets itself up and touches its memory, so that the second is the one to count.
//
// rtpm-instructions --key prints the compiler and build, on which the counts depend; --list prints
// the names.
#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <string>
#include <string_view>

#include "event_crowd.hpp"
#include "rtpm/base/hash.hpp"
#include "rtpm/base/histogram.hpp"
#include "rtpm/base/latest.hpp"
#include "rtpm/base/ring.hpp"
#include "served_tip.hpp"
#include "tip.hpp"
#include "wire_subjects.hpp"

namespace rtpm::bench::micro {
namespace {

/// How often each is run at a time; the tool that counts divides by it.
constexpr int kRepeatCount = 1000;

/// Keeps the compiler from removing the computation of `value`, and from knowing it afterwards.
template <class T>
void keep(T& value) {
  asm volatile("" : "+m"(value) : : "memory");
}

template <class Step>
void repeat(Step step) {
  for (int i = 0; i < kRepeatCount; ++i)
    step();
}

struct State {
  std::array<double, 40> values{};
};

/// A whole call of 48 bytes, over a transport or within the program. The tap's ring holds all runs.
template <rpc::Transport transport, bool is_tapped>
void call_served_tip() {
  static ServedTip served(transport, is_tapped);
  repeat([] {
    bool is_done = served.call();
    keep(is_done);
  });
}

}  // namespace

// Unmangled names, which the tool takes as options.
extern "C" {

[[gnu::noinline]] void counted_encode_header() {
  static wire::Header header = call_header();
  alignas(16) CallFrame frame{};
  repeat([&] {
    ++header.call_id;
    wire::encode(header, frame.data());
    keep(frame);
  });
}

[[gnu::noinline]] void counted_decode_header() {
  alignas(16) CallFrame frame = call_frame();
  repeat([&] {
    keep(frame);
    auto header = wire::decode_frame(frame);
    keep(header);
  });
}

[[gnu::noinline]] void counted_siphash_40_bytes() {
  std::array<std::byte, 40> input{};
  repeat([&] {
    keep(input);
    auto hash = siphash_2_4({.low = 1, .high = 2}, input);
    keep(hash);
  });
}

[[gnu::noinline]] void counted_protocol_call_48_bytes() {
  static JoinedProtocol protocol(1024);
  repeat([] { protocol.call(48); });
}

[[gnu::noinline]] void counted_protocol_call_64_kib() {
  static JoinedProtocol protocol(64 * 1024);
  repeat([] { protocol.call(std::size_t{64} * 1024); });
}

[[gnu::noinline]] void counted_latest_write_and_read() {
  static auto& latest = *std::make_unique<Latest<State>>().release();
  State value;
  repeat([&] {
    value.values[0] += 1;
    latest.write(value);
    auto read = latest.read();
    keep(read);
  });
}

[[gnu::noinline]] void counted_ring_push_and_pop() {
  static SpscRing<std::uint64_t, 64> ring;
  std::uint64_t number = 0;
  repeat([&] {
    bool is_pushed = ring.push(++number);
    keep(is_pushed);
    auto popped = ring.pop();
    keep(popped);
  });
}

[[gnu::noinline]] void counted_histogram_record() {
  static auto& histogram = *std::make_unique<LatencyHistogram>().release();
  std::int64_t latency_ns = 1;
  repeat([&] {
    latency_ns = (latency_ns * 31) % 1'000'003;
    histogram.record(std::chrono::nanoseconds{latency_ns});
  });
}

[[gnu::noinline]] void counted_events_match() {
  static Crowd crowd(100, true, by_type);
  repeat([] {
    bool is_taken = crowd.offer();
    keep(is_taken);
  });
}

[[gnu::noinline]] void counted_events_match_by_field() {
  static Crowd crowd(100, true, by_value);
  repeat([] {
    bool is_taken = crowd.offer();
    keep(is_taken);
  });
}

[[gnu::noinline]] void counted_events_queue() {
  static Crowd crowd(100, false, by_type);
  repeat([] {
    bool is_taken = crowd.offer();
    keep(is_taken);
  });
}

[[gnu::noinline]] void counted_generated_call_48_bytes() {
  static Tip tip;
  static GeneratedCall call;
  rpc::Servant* servant = &tip;
  keep(servant);
  repeat([&] {
    bool is_done = call.run(*servant);
    keep(is_done);
  });
}

[[gnu::noinline]] void counted_local_call_48_bytes() {
  call_served_tip<rpc::Transport::kLocal, false>();
}
[[gnu::noinline]] void counted_local_call_while_tapped() {
  call_served_tip<rpc::Transport::kLocal, true>();
}
[[gnu::noinline]] void counted_memory_call_48_bytes() {
  call_served_tip<rpc::Transport::kSharedMemory, false>();
}
[[gnu::noinline]] void counted_memory_call_while_tapped() {
  call_served_tip<rpc::Transport::kSharedMemory, true>();
}
[[gnu::noinline]] void counted_udp_call_48_bytes() {
  call_served_tip<rpc::Transport::kUdp, false>();
}
[[gnu::noinline]] void counted_udp_call_while_tapped() {
  call_served_tip<rpc::Transport::kUdp, true>();
}
}  // extern "C"

namespace {

struct Subject {
  const char* name;
  void (*run)();
};
constexpr Subject kSubjects[] = {
    {"counted_encode_header", counted_encode_header},
    {"counted_decode_header", counted_decode_header},
    {"counted_siphash_40_bytes", counted_siphash_40_bytes},
    {"counted_protocol_call_48_bytes", counted_protocol_call_48_bytes},
    {"counted_protocol_call_64_kib", counted_protocol_call_64_kib},
    {"counted_latest_write_and_read", counted_latest_write_and_read},
    {"counted_ring_push_and_pop", counted_ring_push_and_pop},
    {"counted_histogram_record", counted_histogram_record},
    {"counted_events_match", counted_events_match},
    {"counted_events_match_by_field", counted_events_match_by_field},
    {"counted_events_queue", counted_events_queue},
    {"counted_generated_call_48_bytes", counted_generated_call_48_bytes},
    {"counted_local_call_48_bytes", counted_local_call_48_bytes},
    {"counted_local_call_while_tapped", counted_local_call_while_tapped},
    {"counted_memory_call_48_bytes", counted_memory_call_48_bytes},
    {"counted_memory_call_while_tapped", counted_memory_call_while_tapped},
    {"counted_udp_call_48_bytes", counted_udp_call_48_bytes},
    {"counted_udp_call_while_tapped", counted_udp_call_while_tapped},
};

void print_key() {
#ifdef __clang__
  std::string version = __clang_version__;
  version.resize(std::min(version.size(), version.find(' ')));
  const char* const compiler = "Clang";
#else
  const std::string version = __VERSION__;
  const char* const compiler = "GCC";
#endif
  std::printf("%s-%s-%s-%s\n", compiler, version.c_str(), RTPM_BENCH_PROCESSOR, RTPM_BENCH_BUILD);
}

}  // namespace
}  // namespace rtpm::bench::micro

int main(int argc, char** argv) {
  const std::string_view argument = argc == 2 ? argv[1] : "";
  if (argument == "--key") {
    rtpm::bench::micro::print_key();
  } else if (argument == "--list") {
    for (const auto& subject : rtpm::bench::micro::kSubjects)
      std::printf("%s\n", subject.name);
  } else {
    for (int run = 0; run < 2; ++run) {
      for (const auto& subject : rtpm::bench::micro::kSubjects)
        subject.run();
    }
  }
  return 0;
}
