#include <array>

#include "cases/case.hpp"
#include "figures/disturbance.hpp"
#include "rtpm/base/whole_number.hpp"
#include "rtpm/rt/clock.hpp"
#include "sides/floor.hpp"
#include "sides/standalone.hpp"

// The time from process start to the first answer: a server's program is started and announces its
// address, the caller binds there and calls once. The floor's program opens a socket instead.
namespace rtpm::bench {
namespace {

constexpr std::uint64_t kStartCountDefault = 100;
/// The whole; until the server announced its address; until the caller was bound, or connected; the
/// call alone.
constexpr std::array kStretches{"", "ready_", "bind_", "first_call_"};
using Stretches = std::vector<Samples>;

Outcome<> start_once(const Settings& settings, const DuelConfig& config, Side side,
                     Stretches& stretches) {
  const bool is_rtpm = side == Side::kRtpm;
  // Raw memory has no address by which another program could find it.
  const Carrier carrier =
      is_rtpm || config.carrier != Carrier::kSharedMemory ? config.carrier : Carrier::kUdp;
  std::array<MonotonicTime, 4> times{rt::now()};
  const auto server = start_standalone(side, carrier, config.wait.strategy, settings);
  if (!server) return failure(server.error());
  times[1] = rt::now();
  const auto node = is_rtpm ? make_node(carrier, config.wait) : nullptr;
  auto caller =
      is_rtpm ? connect_rtpm_caller(*node, server->address(), kHighPriority)
              : connect_floor_caller(carrier,
                                     whole_number_of<std::uint16_t>(server->address()).value_or(0),
                                     {.name = {}, .wait = config.wait});
  if (!caller) return failure(caller.error());
  times[2] = rt::now();
  if (auto called = (*caller)({}); !called) return called;
  times[3] = rt::now();
  stretches[0].add(times[3] - times[0]);
  for (std::size_t i = 1; i < times.size(); ++i)
    stretches[i].add(times[i] - times[i - 1]);
  return {};
}

}  // namespace

Outcome<> measure_startup(const Settings& settings, const DuelConfig& config, Report& report) {
  const std::uint64_t count =
      settings.sample_count == 0 ? kStartCountDefault : settings.sample_count;
  const auto round_count = static_cast<std::uint64_t>(settings.round_count);
  const auto per_round = static_cast<std::size_t>(std::max<std::uint64_t>(1, count / round_count));
  const CpuTime before = read_cpu_time();
  std::array<Stretches, 2> found;
  for (Stretches& stretches : found) {
    for (std::size_t i = 0; i < kStretches.size(); ++i)
      stretches.emplace_back(settings.round_count, per_round);
  }
  for (int round = 0; round < settings.round_count; ++round) {
    for (std::size_t i = 0; i < per_round; ++i) {
      for (std::size_t turn = 0; turn < 2; ++turn) {
        const std::size_t which = (static_cast<std::size_t>(round) + i + turn) % 2;
        for (Samples& samples : found[which])
          samples.begin_round(round);
        auto started = start_once(settings, config, kBothSides[which], found[which]);
        if (!started) return started;
      }
    }
  }
  Json result = head_of("startup", config);
  result["n"] = found[0][0].count();
  for (std::size_t i = 0; i < kStretches.size(); ++i) {
    add_distribution(result, kStretches[i], found[0][i]);
    add_distribution(result, std::string("floor_") + kStretches[i], found[1][i]);
  }
  add_ratios(result, "ratio_", found[0][0], found[1][0]);
  add_steal(result, before);
  report.add(std::move(result));
  return {};
}

}  // namespace rtpm::bench
