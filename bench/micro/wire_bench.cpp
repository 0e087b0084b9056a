#include <benchmark/benchmark.h>

#include <algorithm>
#include <array>
#include <cstddef>

#include "allocations.hpp"
#include "rtpm/base/hash.hpp"
#include "rtpm/wire/header.hpp"
#include "wire_subjects.hpp"

namespace rtpm::bench::micro {
namespace {

void encode_header(benchmark::State& state) {
  wire::Header header = call_header();
  alignas(16) CallFrame frame{};
  const AllocationCounter allocations(state);
  for (auto _ : state) {
    ++header.call_id;
    wire::encode(header, frame.data());
    benchmark::DoNotOptimize(frame);
  }
}
BENCHMARK(encode_header);

void decode_header(benchmark::State& state) {
  alignas(16) CallFrame frame = call_frame();
  const AllocationCounter allocations(state);
  for (auto _ : state) {
    benchmark::DoNotOptimize(frame);
    auto header = wire::decode_frame(frame);
    benchmark::DoNotOptimize(header);
  }
}
BENCHMARK(decode_header);

void refuse_garbage(benchmark::State& state) {
  alignas(16) CallFrame frame{};
  frame.fill(std::byte{0xa5});
  const AllocationCounter allocations(state);
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
  const AllocationCounter allocations(state);
  for (auto _ : state) {
    benchmark::DoNotOptimize(input);
    auto hash = siphash_2_4(key, input);
    benchmark::DoNotOptimize(hash);
  }
}
BENCHMARK(siphash_40_bytes);

/// All that the protocol does for a call, both sides, without a transport.
void protocol_call(benchmark::State& state) {
  const auto size = static_cast<std::size_t>(state.range(0));
  JoinedProtocol protocol(static_cast<std::uint32_t>(std::max<std::size_t>(size, 1024)));
  protocol.call(size);
  const AllocationCounter allocations(state);
  for (auto _ : state)
    protocol.call(size);
}
BENCHMARK(protocol_call)->ArgName("bytes")->Arg(48)->Arg(std::int64_t{64} * 1024);

}  // namespace
}  // namespace rtpm::bench::micro
