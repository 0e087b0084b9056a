#include <benchmark/benchmark.h>

#include <array>
#include <cstddef>

#include "rtpm/base/hash.hpp"
#include "rtpm/wire/header.hpp"
#include "rtpm/wire/limits.hpp"

namespace rtpm::bench {
namespace {

/// A call as the force loop makes it.
wire::Header call_header() {
  wire::Header header;
  header.kind = wire::FrameKind::kCall;
  header.priority = 24000;
  header.session = 0x123456789abcdefULL;
  header.call_id = 1000;
  header.service = 3;
  header.method = 2;
  header.payload_size = 48;
  header.message_size = 48;
  header.budget_us = 800;
  header.sender_time_ns = 1'000'000'007;
  return header;
}

using Frame = std::array<std::byte, wire::kHeaderSize + 48>;

Frame call_frame() {
  alignas(16) Frame frame{};
  wire::encode(call_header(), frame.data());
  return frame;
}

void encode_header(benchmark::State& state) {
  wire::Header header = call_header();
  alignas(16) Frame frame{};
  for (auto _ : state) {
    ++header.call_id;
    wire::encode(header, frame.data());
    benchmark::DoNotOptimize(frame);
  }
}
BENCHMARK(encode_header);

void decode_header(benchmark::State& state) {
  alignas(16) Frame frame = call_frame();
  for (auto _ : state) {
    benchmark::DoNotOptimize(frame);
    auto header = wire::decode_frame(frame);
    benchmark::DoNotOptimize(header);
  }
}
BENCHMARK(decode_header);

void refuse_garbage(benchmark::State& state) {
  alignas(16) Frame frame{};
  frame.fill(std::byte{0xa5});
  for (auto _ : state) {
    benchmark::DoNotOptimize(frame);
    auto header = wire::decode_frame(frame);
    benchmark::DoNotOptimize(header);
  }
}
BENCHMARK(refuse_garbage);

/// The hash of a handshake's cookie.
void siphash_40_bytes(benchmark::State& state) {
  std::array<std::byte, 40> input{};
  const SipKey key{.low = 1, .high = 2};
  for (auto _ : state) {
    benchmark::DoNotOptimize(input);
    auto hash = siphash_2_4(key, input);
    benchmark::DoNotOptimize(hash);
  }
}
BENCHMARK(siphash_40_bytes);

}  // namespace
}  // namespace rtpm::bench
