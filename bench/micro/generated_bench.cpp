// What generated code costs by itself: a call of 48 bytes through the stub's encoding, the
// skeleton's check and dispatch, the servant, and the stub's decoding, without lane or network.
// Beside it, the same servant called as a local object, which is what the rest adds to.
#include <benchmark/benchmark.h>

#include <cstdint>
#include <cstring>
#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "allocations.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rpc/server.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/schema/back_end.hpp"
#include "rtpm/schema/compile.hpp"
#include "tip.hpp"

namespace rtpm::bench::micro {
namespace {

void local_call_48_bytes(benchmark::State& state) {
  Tip tip;
  TipServant* servant = &tip;
  benchmark::DoNotOptimize(servant);
  Wrench wrench(1, 2, 3, 4, 5, 6);
  const AllocationCounter allocations(state);
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
  GeneratedCall call;
  const AllocationCounter allocations(state);
  for (auto _ : state) {
    if (!call.run(*servant)) {
      state.SkipWithError("the call failed");
      break;
    }
    benchmark::DoNotOptimize(call.wrench);
  }
}
BENCHMARK(generated_call_48_bytes);

/// Does what Tip does with bytes alone: what a lane's round trip costs without generated code.
class RawTip final : public rpc::Servant {
 public:
  [[nodiscard]] const rpc::InterfaceDescriptor& interface() const noexcept override {
    return TipClient::interface();
  }
  rpc::DispatchResult dispatch(std::uint16_t, ConstBytes request, MutableBytes reply,
                               const rpc::CallContext&) override {
    double fx = 0;
    std::memcpy(reply.data(), request.data(), sizeof(Wrench));
    std::memcpy(&fx, reply.data(), sizeof fx);
    fx += 1;
    std::memcpy(reply.data(), &fx, sizeof fx);
    return {wire::Status::kOk, sizeof(Wrench)};
  }
};

/// Calls both from a method of the same lane, which then runs them at once: no thread stands
/// between, so that tens of nanoseconds show.
class Runner final : public rpc::Servant {
 public:
  static constexpr int kCallCount = 1000;
  struct Times {
    Duration raw{};
    Duration generated{};
    std::uint64_t allocation_count = 0;
  };

  Runner(rpc::Binding& raw, TipClient& generated) : raw_(raw), generated_(generated) {}
  [[nodiscard]] const rpc::InterfaceDescriptor& interface() const noexcept override {
    return TipClient::interface();
  }
  rpc::DispatchResult dispatch(std::uint16_t, ConstBytes, MutableBytes,
                               const rpc::CallContext&) override {
    const rpc::MethodDescriptor& method = TipClient::interface().methods.front();
    Wrench wrench(1, 2, 3, 4, 5, 6);
    const MonotonicTime begin = rt::now();
    for (int i = 0; i < kCallCount; ++i) {
      const auto reply = raw_.call(method, rpc::struct_bytes(wrench));
      if (!reply) return {wire::Status::kServantFailed, 0};
      std::memcpy(&wrench, reply->bytes().data(), sizeof wrench);
    }
    const MonotonicTime middle = rt::now();
    const std::uint64_t before = allocation_count();
    for (int i = 0; i < kCallCount; ++i) {
      const auto reply = generated_.exchange(wrench);
      if (!reply) return {wire::Status::kServantFailed, 0};
      wrench = *reply;
    }
    times.generated = rt::now() - middle;
    times.raw = middle - begin;
    times.allocation_count = allocation_count() - before;
    benchmark::DoNotOptimize(wrench);
    return {};
  }

  Times times{};

 private:
  rpc::Binding& raw_;
  TipClient& generated_;
};

/// The runner, once it is there.
class Late final : public rpc::Servant {
 public:
  explicit Late(std::optional<Runner>& runner) : runner_(runner) {}
  [[nodiscard]] const rpc::InterfaceDescriptor& interface() const noexcept override {
    return TipClient::interface();
  }
  rpc::DispatchResult dispatch(std::uint16_t method_id, ConstBytes request, MutableBytes reply,
                               const rpc::CallContext& context) override {
    return runner_->dispatch(method_id, request, reply, context);
  }

 private:
  std::optional<Runner>& runner_;
};

/// A call of 48 bytes to a collocated object through its lane: the whole of it, what of that is
/// generated code, and its allocations.
void collocated_call_48_bytes(benchmark::State& state) {
  Tip tip;
  RawTip raw_tip;
  rpc::ServerConfig config;
  config.realtime = rt::RealtimeMode::kOff;
  config.lanes = {{.wait = {.strategy = rt::WaitStrategy::kBlock}}};
  const auto server = *rpc::Server::create(config);
  rpc::Node node;
  // The bindings are made once the server runs; until then nobody calls the runner.
  std::optional<TipClient> generated;
  std::optional<rpc::Binding> raw;
  std::optional<Runner> runner;
  Late late(runner);
  if (!server->add("tip", tip) || !server->add("raw", raw_tip) || !server->add("run", late) ||
      !server->start()) {
    return state.SkipWithError("the server does not start");
  }
  const auto bind = [&](const char* path) {
    return rpc::Binding::bind(node, server->url(path), TipClient::interface());
  };
  auto client = TipClient::bind(node, server->url("tip"));
  auto raw_binding = bind("raw");
  auto run = bind("run");
  if (!client || !raw_binding || !run) return state.SkipWithError("the bind failed");
  generated.emplace(std::move(*client));
  raw.emplace(std::move(*raw_binding));
  runner.emplace(*raw, *generated);
  Duration total{0};
  Duration added{0};
  std::uint64_t allocations = 0;
  for (auto _ : state) {
    if (!run->call(TipClient::interface().methods.front(), {},
                   {.deadline = std::chrono::seconds{9}})) {
      state.SkipWithError("the call failed");
      break;
    }
    const Runner::Times& times = runner->times;
    state.SetIterationTime(std::chrono::duration<double>(times.generated).count());
    total += times.generated;
    added += times.generated - times.raw;
    allocations += times.allocation_count;
  }
  const double calls = static_cast<double>(state.iterations()) * Runner::kCallCount;
  state.counters["call_ns"] = static_cast<double>(total.count()) / calls;
  state.counters["added_ns"] = static_cast<double>(added.count()) / calls;
  state.counters["allocations"] = static_cast<double>(allocations);
  server->stop();
}
BENCHMARK(collocated_call_48_bytes)->UseManualTime()->Iterations(300);

/// A schema of `services` services with ten methods each.
std::string large_schema(int services) {
  std::string text = "attribute \"rtpm_id\";\nnamespace big;\n";
  const auto add = [&text](std::initializer_list<std::string_view> parts) {
    for (const std::string_view part : parts)
      text += part;
  };
  for (int service = 0; service < services; ++service) {
    const std::string number = std::to_string(service);
    add({"struct S", number, " { a:double; b:double; c:int; }\n"});
    add({"table M", number, " { value:S", number, " (required); }\n"});
    add({"table T", number, " { name:string; count:int = 3; values:[S", number, "]; }\n"});
    add({"rpc_service Service", number, " {\n"});
    for (int method = 1; method <= 10; ++method) {
      const std::string id = std::to_string(method);
      const std::string_view kind = method % 2 == 0 ? "M" : "T";
      add({"  method_", id, "(", kind, number, "):", kind, number, " (rtpm_id: ", id, ");\n"});
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
