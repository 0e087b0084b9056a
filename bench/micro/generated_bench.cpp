// What generated code costs by itself: a call of 48 bytes through the stub's encoding, the
// skeleton's check and dispatch, the servant, and the stub's decoding, without lane or network.
// Beside it, the same servant called as a local object, which is what the rest adds to.
#include <benchmark/benchmark.h>

#include <array>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <new>
#include <string>

#include "rtpm/schema/back_end.hpp"
#include "rtpm/schema/compile.hpp"
#include "wrench.rtpm.hpp"

namespace {

std::uint64_t allocation_count = 0;

}  // namespace

// Counted in the whole program; only the benchmarks of generated calls report it. Not inlined: GCC
// would see malloc and delete side by side, and take them for a mistake.
[[gnu::noinline]] void* operator new(std::size_t size) {
  ++allocation_count;
  void* memory = std::malloc(size);
  if (memory == nullptr) std::abort();
  return memory;
}
[[gnu::noinline]] void operator delete(void* memory) noexcept {
  std::free(memory);
}
[[gnu::noinline]] void operator delete(void* memory, std::size_t) noexcept {
  std::free(memory);
}

namespace rtpm::bench::micro {
namespace {

class Tip final : public TipServant {
 public:
  rpc::Result<Wrench> exchange(const Wrench& request, const rpc::CallContext&) override {
    return Wrench(request.fx() + 1, request.fy(), request.fz(), request.tx(), request.ty(),
                  request.tz());
  }
};

const rpc::CallContext kContext{.priority = 0, .deadline = kNever, .received = {}, .trace_id = 0};

void local_call_48_bytes(benchmark::State& state) {
  Tip tip;
  TipServant* servant = &tip;
  benchmark::DoNotOptimize(servant);
  Wrench wrench(1, 2, 3, 4, 5, 6);
  for (auto _ : state) {
    const auto reply = servant->exchange(wrench, kContext);
    wrench = *reply;
    benchmark::DoNotOptimize(wrench);
  }
}
BENCHMARK(local_call_48_bytes);

void generated_call_48_bytes(benchmark::State& state) {
  Tip tip;
  rpc::Servant* servant = &tip;
  benchmark::DoNotOptimize(servant);
  alignas(16) std::array<std::byte, 64> request{};
  alignas(16) std::array<std::byte, 64> reply{};
  Wrench wrench(1, 2, 3, 4, 5, 6);
  const std::uint64_t before = allocation_count;
  for (auto _ : state) {
    // The stub's side: the request's bytes go into the transport's memory.
    const ConstBytes bytes = rpc::struct_bytes(wrench);
    std::memcpy(request.data(), bytes.data(), bytes.size());
    benchmark::ClobberMemory();
    const rpc::DispatchResult result =
        servant->dispatch(1, {request.data(), bytes.size()}, reply, kContext);
    benchmark::DoNotOptimize(result);
    if (result.reply_size != sizeof wrench) state.SkipWithError("the call failed");
    std::memcpy(&wrench, reply.data(), sizeof wrench);
    benchmark::DoNotOptimize(wrench);
  }
  state.counters["allocations"] = static_cast<double>(allocation_count - before);
}
BENCHMARK(generated_call_48_bytes);

/// A schema of `services` services with ten methods each.
std::string large_schema(int services) {
  std::string text = "attribute \"rtpm_id\";\nnamespace big;\n";
  for (int service = 0; service < services; ++service) {
    const std::string number = std::to_string(service);
    text += "struct S" + number + " { a:double; b:double; c:int; }\ntable M" + number +
            " { value:S" + number + " (required); }\ntable T" + number +
            " { name:string; count:int = 3; values:[S" + number + "]; }\nrpc_service Service" +
            number + " {\n";
    for (int method = 1; method <= 10; ++method) {
      const std::string type = (method % 2 == 0 ? "M" : "T") + number;
      text += "  method_" + std::to_string(method) + '(' + type + "):" + type +
              " (rtpm_id: " + std::to_string(method) + ");\n";
    }
    text += "}\n";
  }
  return text;
}

/// rtpmc in process: parse, check, fingerprint, generate.
void compile_schema(benchmark::State& state) {
  const std::string text = large_schema(static_cast<int>(state.range(0)));
  for (auto _ : state) {
    const auto result = schema::compile_text(text, "big.fbs");
    if (!result.model) {
      state.SkipWithError("the schema does not compile");
      break;
    }
    benchmark::DoNotOptimize(schema::make_cpp_back_end("0")->generate(*result.model));
  }
}
BENCHMARK(compile_schema)->ArgName("services")->Arg(20)->Arg(200)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace rtpm::bench::micro
