#include <algorithm>
#include <array>
#include <vector>

#include "cases/case.hpp"
#include "cases/peers_case.hpp"
#include "figures/disturbance.hpp"
#include "rtpm/rt/clock.hpp"
#include "runs/duel.hpp"

namespace rtpm::bench {
namespace {

constexpr int kPartCount = 20;  ///< Starts of the servers in a run.

/// How many calls of a payload are worth their time, and how many one side makes before the other's
/// turn: few enough that both see the same minutes, and that no turn fills a second, after which
/// the kernel throttles real-time threads.
struct Amount {
  std::size_t payload_size_max;
  std::uint64_t sample_count;
  std::size_t block_size;
  int warm_up_count;  ///< Untimed, at the begin of a turn, which meets a server that was stopped.
};
constexpr std::array<Amount, 3> kAmounts{{{std::size_t{16} * 1024, 100'000, 500, 50},
                                          {std::size_t{256} * 1024, 10'000, 100, 10},
                                          {SIZE_MAX, 1'000, 20, 2}}};

const Amount& amount_of(std::size_t payload_size) {
  return *std::ranges::find_if(
      kAmounts, [=](const Amount& amount) { return payload_size <= amount.payload_size_max; });
}

/// The two sides' connections, and what is measured through them.
struct Sides {
  std::array<std::unique_ptr<Caller>, 2> callers;
  std::array<Samples, 2>& samples;
};

std::size_t index_of(Side side) {
  return static_cast<std::size_t>(side);
}

expected<void, std::string> connect(Duel& duel, Sides& sides) {
  for (const Side side : kBothSides) {
    duel.take_turn(side);
    auto caller = duel.connect_high();
    if (!caller) return unexpected{caller.error()};
    sides.callers[index_of(side)] = std::move(*caller);
  }
  return {};
}

expected<void, std::string> measure_block(Duel& duel, Side side, Sides& sides, std::size_t count,
                                          int warm_up_count) {
  Caller& caller = *sides.callers[index_of(side)];
  Samples& samples = sides.samples[index_of(side)];
  duel.take_turn(side);
  for (int i = 0; i < warm_up_count; ++i) {
    if (auto called = caller.echo(); !called) return called;
  }
  const MonotonicTime begin = rt::now();
  for (std::size_t i = 0; i < count; ++i) {
    const MonotonicTime sent = rt::now();
    if (auto called = caller.echo(); !called) return called;
    samples.add(rt::now() - sent);
  }
  duel.rest_after(rt::now() - begin, 0.1);
  return {};
}

expected<void, std::string> measure(Duel& duel, Sides& sides, Rounds rounds,
                                    std::size_t count_per_round, const Amount& amount) {
  if (auto connected = connect(duel, sides); !connected) return connected;
  bool is_rtpm_first = true;
  for (int round = rounds.begin; round < rounds.end; ++round) {
    for (Samples& samples : sides.samples)
      samples.begin_round(round);
    const RoundWatch round_watch = duel.watch_round();
    for (std::size_t done = 0; done < count_per_round; done += amount.block_size) {
      const std::size_t count = std::min(amount.block_size, count_per_round - done);
      for (const Side side : {is_rtpm_first ? Side::kRtpm : Side::kFloor,
                              is_rtpm_first ? Side::kFloor : Side::kRtpm}) {
        auto measured = measure_block(duel, side, sides, count, amount.warm_up_count);
        if (!measured) return measured;
      }
      is_rtpm_first = !is_rtpm_first;
    }
    const bool was_disturbed = round_watch.was_disturbed();
    for (Samples& samples : sides.samples)
      samples.note_disturbed(was_disturbed);
  }
  return {};
}

/// What the sides are measured with in one way, and what that showed.
class CallRow {
 public:
  /// Refers to `settings`.
  CallRow(const Settings& settings, const DuelConfig& config)
      : settings_(settings), config_(config), amount_(amount_of(config.payload_size)) {
    const std::uint64_t count =
        settings.sample_count == 0 ? amount_.sample_count : settings.sample_count;
    count_per_round_ = static_cast<std::size_t>(
        std::max<std::uint64_t>(1, count / static_cast<std::uint64_t>(settings.round_count)));
    for (Samples& samples : samples_)
      samples = Samples(settings.round_count, count_per_round_);
  }

  /// Starts the servers and measures so many rounds. After a failure, which is told once, it does
  /// nothing more.
  void measure_part(Rounds rounds) {
    if (has_failed_) return;
    if (auto measured = try_part(rounds); !measured) {
      say_not_measured(title_of("call", config_), measured.error());
      has_failed_ = true;
    }
  }
  [[nodiscard]] bool has_failed() const noexcept { return has_failed_; }

  [[nodiscard]] Result result() const {
    Result result{.title = title_of("call", config_)};
    const Samples& rtpm = samples_[index_of(Side::kRtpm)];
    const Samples& floor = samples_[index_of(Side::kFloor)];
    add_comparison(result, "call", config_, rtpm, floor);
    if (settings_.tells_latencies) add_latencies(result, rtpm, floor);
    watch_.finish(result, longest_us(result));
    return result;
  }

 private:
  expected<void, std::string> try_part(Rounds rounds) {
    auto duel = Duel::start(config_);
    if (!duel) return unexpected{duel.error()};
    return run_as_caller(config_, [&]() -> expected<void, std::string> {
      watch_.follow((*duel)->server_ids());
      Sides sides{.callers = {}, .samples = samples_};
      auto done = measure(**duel, sides, rounds, count_per_round_, amount_);
      watch_.note();
      return done;
    });
  }

  const Settings& settings_;
  DuelConfig config_;
  const Amount& amount_;
  std::size_t count_per_round_ = 0;
  std::array<Samples, 2> samples_{Samples(0, 0), Samples(0, 0)};
  DisturbanceWatch watch_{{}};
  bool has_failed_ = false;
};

std::vector<CallRow> rows_of(const Settings& settings) {
  std::vector<CallRow> rows;
  for (const std::size_t payload_size : settings.payload_sizes) {
    for (const Carrier carrier : settings.carriers) {
      for (const rt::WaitStrategy strategy : settings.waits) {
        rows.emplace_back(settings,
                          DuelConfig{.carrier = carrier,
                                     .wait = {.strategy = strategy, .spin = settings.spin},
                                     .payload_size = payload_size,
                                     .placement = choose_placement(),
                                     .realtime = settings.realtime});
      }
    }
  }
  return rows;
}

}  // namespace

// All rows are gone through so many times, and told in the last: so each has seen the machine at
// several moments, between which a hypervisor moves the cores.
bool run_call(const Settings& settings, Report& report) {
  if (!settings.peers.empty()) return run_call_with_peers(settings, report);
  std::vector<CallRow> rows = rows_of(settings);
  for (const Rounds rounds : parts_of_run(settings.round_count, kPartCount)) {
    for (CallRow& row : rows) {
      row.measure_part(rounds);
      if (rounds.end == settings.round_count && !row.has_failed()) report.add(row.result());
    }
  }
  return std::ranges::none_of(rows, &CallRow::has_failed);
}

}  // namespace rtpm::bench
