#include <algorithm>
#include <array>
#include <map>

#include "cases/case.hpp"
#include "figures/disturbance.hpp"
#include "rtpm/rt/clock.hpp"
#include "runs/duel.hpp"
#include "sides/network_pair.hpp"

namespace rtpm::bench {
namespace {

constexpr std::uint64_t kCallCountDefault = 10'000;
/// Calls of one side before the other's turn.
constexpr std::size_t kBlockSize = 500;
constexpr int kWarmUpCount = 50;

/// What became of RTPM's calls.
struct Outcomes {
  std::uint64_t call_count = 0;
  std::uint64_t answered_count = 0;
  std::map<std::string_view, std::uint64_t> failures{};  ///< By the error's name.
  std::uint64_t repeat_count = 0;
  std::uint64_t dropped_count = 0;
  NumberedRuns runs{};
};

class TwoNodeRun {
 public:
  TwoNodeRun(const Settings& settings, const DuelConfig& config, const NetworkPair& network,
             Duel& duel);

  [[nodiscard]] expected<void, std::string> measure();
  [[nodiscard]] Result result() const;

 private:
  [[nodiscard]] expected<void, std::string> connect();
  void measure_rtpm(std::size_t count);
  [[nodiscard]] expected<void, std::string> measure_floor(std::size_t count);
  void rest(Duration turn);
  [[nodiscard]] expected<void, std::string> ask_server();
  void call_once(bool is_counted);
  [[nodiscard]] std::uint64_t sent_count() const;

  const Settings& settings_;
  const DuelConfig& config_;
  const NetworkPair& network_;
  Duel& duel_;
  std::size_t count_per_round_;
  std::unique_ptr<NumberedCaller> rtpm_;
  std::unique_ptr<Caller> floor_;
  Samples rtpm_samples_;
  Samples floor_samples_;
  std::uint64_t next_number_ = 0;
  Outcomes outcomes_;
};

std::size_t count_per_round_of(const Settings& settings) {
  std::uint64_t count = settings.call_count == 0 ? settings.sample_count : settings.call_count;
  if (count == 0) count = kCallCountDefault;
  const auto round_count = static_cast<std::uint64_t>(settings.round_count);
  // No fewer calls than were asked for.
  return static_cast<std::size_t>((count + round_count - 1) / round_count);
}

TwoNodeRun::TwoNodeRun(const Settings& settings, const DuelConfig& config,
                       const NetworkPair& network, Duel& duel)
    : settings_(settings),
      config_(config),
      network_(network),
      duel_(duel),
      count_per_round_(count_per_round_of(settings)),
      rtpm_samples_(settings.round_count, count_per_round_),
      floor_samples_(settings.round_count, count_per_round_) {}

expected<void, std::string> TwoNodeRun::connect() {
  // Only this thread goes there, and with it the sockets that it opens.
  if (auto entered = network_.enter(NetworkPair::Host::kClient); !entered) return entered;
  if (settings_.drop_percent > 0) {
    auto dropping = network_.drop(config_.carrier, duel_.rtpm_port(), settings_.drop_percent);
    if (!dropping) return dropping;
  }
  duel_.take_turn(Side::kFloor);
  auto floor = duel_.connect_high();
  if (!floor) return unexpected{floor.error()};
  floor_ = std::move(*floor);
  duel_.take_turn(Side::kRtpm);
  auto rtpm = duel_.connect_numbered();
  if (!rtpm) return unexpected{rtpm.error()};
  rtpm_ = std::move(*rtpm);
  return {};
}

/// What the client's host sent by itself or again, so far.
std::uint64_t TwoNodeRun::sent_count() const {
  return config_.carrier == Carrier::kTcp ? network_counter("Tcp", "RetransSegs")
                                          : network_counter("Udp", "OutDatagrams");
}

void TwoNodeRun::call_once(bool is_counted) {
  const MonotonicTime sent = rt::now();
  const auto called = rtpm_->call(next_number_++, settings_.deadline);
  const Duration took = rt::now() - sent;
  if (!is_counted) return;
  // A call that failed has cost its caller time like any other.
  rtpm_samples_.add(took);
  ++outcomes_.call_count;
  if (called) {
    ++outcomes_.answered_count;
  } else {
    ++outcomes_.failures[rpc::to_string(called.error())];
  }
}

void TwoNodeRun::measure_rtpm(std::size_t count) {
  duel_.take_turn(Side::kRtpm);
  for (int i = 0; i < kWarmUpCount; ++i)
    call_once(false);
  const std::uint64_t sent_before = sent_count();
  const MonotonicTime begin = rt::now();
  for (std::size_t i = 0; i < count; ++i)
    call_once(true);
  const Duration took = rt::now() - begin;
  std::uint64_t repeat_count = sent_count() - sent_before;
  if (config_.carrier == Carrier::kUdp)
    repeat_count -= std::min<std::uint64_t>(repeat_count, count);
  outcomes_.repeat_count += repeat_count;
  rest(took);
}

expected<void, std::string> TwoNodeRun::measure_floor(std::size_t count) {
  duel_.take_turn(Side::kFloor);
  for (int i = 0; i < kWarmUpCount; ++i) {
    if (auto called = floor_->echo(); !called) return called;
  }
  const MonotonicTime begin = rt::now();
  for (std::size_t i = 0; i < count; ++i) {
    const MonotonicTime sent = rt::now();
    if (auto called = floor_->echo(); !called) return called;
    floor_samples_.add(rt::now() - sent);
  }
  rest(rt::now() - begin);
  return {};
}

/// A tenth of the time belongs to the rest of the system, as in `call`.
void TwoNodeRun::rest(Duration turn) {
  duel_.end_turn();
  rt::sleep_until(rt::now() + turn / 10);
}

/// What the server and the network noted.
expected<void, std::string> TwoNodeRun::ask_server() {
  duel_.take_turn(Side::kRtpm);
  const auto runs = rtpm_->runs();
  if (!runs) {
    return unexpected{"the server does not tell what ran: " +
                      std::string(rpc::to_string(runs.error()))};
  }
  outcomes_.runs = *runs;
  duel_.end_turn();
  if (settings_.drop_percent == 0) return {};
  const auto dropped = network_.dropped_count();
  if (!dropped) return unexpected{dropped.error()};
  outcomes_.dropped_count = *dropped;
  return {};
}

expected<void, std::string> TwoNodeRun::measure() {
  if (auto connected = connect(); !connected) return connected;
  bool is_rtpm_first = true;
  for (int round = 0; round < settings_.round_count; ++round) {
    rtpm_samples_.begin_round(round);
    floor_samples_.begin_round(round);
    const RoundWatch round_watch = duel_.watch_round();
    for (std::size_t done = 0; done < count_per_round_; done += kBlockSize) {
      const std::size_t count = std::min(kBlockSize, count_per_round_ - done);
      for (const bool is_rtpm : {is_rtpm_first, !is_rtpm_first}) {
        if (is_rtpm) {
          measure_rtpm(count);
        } else if (auto measured = measure_floor(count); !measured) {
          return measured;
        }
      }
      is_rtpm_first = !is_rtpm_first;
    }
    const bool was_disturbed = round_watch.was_disturbed();
    rtpm_samples_.note_disturbed(was_disturbed);
    floor_samples_.note_disturbed(was_disturbed);
  }
  return ask_server();
}

Result TwoNodeRun::result() const {
  Result result{.title = title_of("two-node", config_) + ", " + short_text(settings_.drop_percent) +
                         " % of the packets dropped each way"};
  add_comparison(result, "two-node", config_, rtpm_samples_, floor_samples_);
  if (settings_.tells_latencies) add_latencies(result, rtpm_samples_, floor_samples_);
  JsonObject& json = result.json;
  const auto add_count = [&json](std::string_view key, std::uint64_t count) {
    json.add(key, static_cast<std::int64_t>(count));
  };
  const double share = 100.0 * static_cast<double>(outcomes_.answered_count) /
                       static_cast<double>(outcomes_.call_count);
  json.add("drop_percent", settings_.drop_percent);
  json.add("deadline_us", std::chrono::duration<double, std::micro>(settings_.deadline).count());
  add_count("calls", outcomes_.call_count);
  add_count("succeeded", outcomes_.answered_count);
  json.add("succeeded_percent", share);
  JsonObject failures;
  std::string failure_text;
  for (const auto& [error, count] : outcomes_.failures) {
    failures.add(error, static_cast<std::int64_t>(count));
    failure_text += ", " + std::to_string(count) + " " + std::string(error);
  }
  json.add("failed", failures);
  // Of the warm-up's calls as well, because they might run twice, too.
  add_count("numbers_sent", next_number_);
  add_count("numbers_run", outcomes_.runs.distinct_count);
  add_count("run_twice", outcomes_.runs.again_count);
  add_count("repeats", outcomes_.repeat_count);
  add_count("dropped", outcomes_.dropped_count);
  result.notes.push_back(std::to_string(outcomes_.answered_count) + " of " +
                         std::to_string(outcomes_.call_count) + " calls succeeded" + failure_text +
                         "; run more than once: " + std::to_string(outcomes_.runs.again_count) +
                         "; repeats: " + std::to_string(outcomes_.repeat_count) +
                         "; packets dropped: " + std::to_string(outcomes_.dropped_count));
  return result;
}

/// How many numbers the calls of a run take, the warm-up's included.
std::uint64_t numbered_count_of(const Settings& settings) {
  const std::size_t count = count_per_round_of(settings);
  const std::size_t block_count = (count + kBlockSize - 1) / kBlockSize;
  return (count + block_count * kWarmUpCount) * static_cast<std::uint64_t>(settings.round_count);
}

expected<void, std::string> measure_one(const Settings& settings, DuelConfig config,
                                        Report& report) {
  const auto network = NetworkPair::create();
  if (!network) return unexpected{network.error()};
  config.host = NetworkPair::kServerAddress;
  config.enter_server_host = [&] { return network->enter(NetworkPair::Host::kServer); };
  config.numbered_count = numbered_count_of(settings);
  auto duel = Duel::start(config);
  if (!duel) return unexpected{duel.error()};
  TwoNodeRun run(settings, config, *network, **duel);
  return run_as_caller(config, [&]() -> expected<void, std::string> {
    const DisturbanceWatch watch((*duel)->server_ids());
    if (auto measured = run.measure(); !measured) return measured;
    Result result = run.result();
    watch.finish(result, longest_us(result));
    report.add(result);
    return {};
  });
}

}  // namespace

bool run_two_node(const Settings& settings, Report& report) {
  bool is_complete = true;
  int measured_count = 0;
  for (const Carrier carrier : settings.carriers) {
    // Memory is of one host. TCP repeats after 200 ms at the soonest, so that under loss this would
    // measure the kernel's patience, and take minutes.
    if (carrier == Carrier::kSharedMemory) continue;
    if (carrier == Carrier::kTcp && settings.drop_percent > 0) continue;
    for (const rt::WaitStrategy strategy : settings.waits) {
      const DuelConfig config{.carrier = carrier,
                              .wait = {.strategy = strategy, .spin = settings.spin},
                              .placement = choose_placement(),
                              .realtime = settings.realtime};
      ++measured_count;
      if (auto measured = measure_one(settings, config, report); !measured) {
        say_not_measured(title_of("two-node", config), measured.error());
        is_complete = false;
      }
    }
  }
  if (measured_count > 0) return is_complete;
  say_not_measured("two-node",
                   "only UDP and, where nothing is dropped, TCP run between two hosts; add "
                   "--transport udp");
  return false;
}

}  // namespace rtpm::bench
