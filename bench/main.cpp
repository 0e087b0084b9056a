#include <algorithm>
#include <CLI/CLI.hpp>
#include <cstdio>
#include <map>
#include <string>
#include <vector>

#include "cases/case.hpp"
#include "figures/disturbance.hpp"
#include "rtpm/rt/memory.hpp"
#include "runs/peers.hpp"
#include "settings.hpp"
#include "sides/floor.hpp"
#include "sides/standalone.hpp"

namespace rtpm::bench {
namespace {

template <class T>
using Choices = std::map<std::string, T>;

const Choices<Carrier> kCarriers{
    {"udp", Carrier::kUdp}, {"tcp", Carrier::kTcp}, {"shm", Carrier::kSharedMemory}};
const Choices<rt::WaitStrategy> kWaits{{"adaptive", rt::WaitStrategy::kAdaptive},
                                       {"periodic", rt::WaitStrategy::kPeriodic},
                                       {"block", rt::WaitStrategy::kBlock},
                                       {"spin", rt::WaitStrategy::kSpin}};
const Choices<rt::RealtimeMode> kRealtimeModes{{"prefer", rt::RealtimeMode::kPrefer},
                                               {"require", rt::RealtimeMode::kRequire},
                                               {"off", rt::RealtimeMode::kOff}};

/// Values by name: CLI11 would print these types by our to_string(), which it can't.
template <class T>
void add_choices(CLI::App& app, const std::string& name, std::vector<T>& values,
                 const Choices<T>& choices, const std::string& help) {
  const auto take = [&](const std::vector<std::string>& texts) {
    values.clear();
    std::ranges::transform(texts, std::back_inserter(values),
                           [&](const std::string& text) { return choices.at(text); });
  };
  app.add_option_function<std::vector<std::string>>(name, take, help)
      ->delimiter(',')
      ->allow_extra_args(false)
      ->check(CLI::IsMember(choices));
}

/// An option with several values, separated by commas.
template <class T>
CLI::Option* add_list(CLI::App& app, const std::string& name, std::vector<T>& values,
                      const std::string& help) {
  return app.add_option(name, values, help)->delimiter(',')->allow_extra_args(false);
}

/// Adds the options that all cases and `serve` share.
void add_common_options(CLI::App& app, Settings& settings) {
  add_choices(app, "--transport", settings.carriers, kCarriers, "all three, unless some are named");
  add_choices(app, "--wait", settings.waits, kWaits, "how callers and lanes wait");
  app.add_option_function<std::string>(
         "--realtime",
         [&](const std::string& text) { settings.realtime = kRealtimeModes.at(text); },
         "SCHED_FIFO, locked memory")
      ->check(CLI::IsMember(kRealtimeModes));
  app.add_option("--samples", settings.sample_count,
                 "calls or events per side and result; 0: the case's own")
      ->check(CLI::Range(0, 100'000'000));
  app.add_option("--rounds", settings.round_count,
                 "parts of a run, whose middles are shown; paced calls have one for each turn")
      ->check(CLI::Range(1, 1000));
  app.add_flag("--latencies", settings.tells_latencies, "with --json, tell every latency");
}

void add_case_options(CLI::App& app, Settings& settings) {
  constexpr std::size_t kPayloadSizeMax = std::size_t{8} << 20;
  add_list(app, "--payload", settings.payload_sizes,
           "call: bytes each way: 0, 48, 1Ki, 1Mi or several")
      ->transform(CLI::AsSizeValue(false))
      ->check(CLI::Range(std::size_t{0}, kPayloadSizeMax));
  app.add_option("--rate", settings.rate_hz, "calls or events a second where they are paced")
      ->check(CLI::Range(1.0, 100'000.0));
  add_list(app, "--low-callers", settings.low_caller_counts, "isolation: low-priority callers")
      ->check(CLI::Range(0, 64));
  add_list(app, "--clients", settings.client_counts, "scale: bound clients")
      ->check(CLI::Range(1, 4000));
  add_list(app, "--consumers", settings.consumer_counts, "events: consumers")
      ->check(CLI::Range(1, 256));
  app.add_flag("--multicast", settings.has_multicast,
               "events over UDP: the hub sends each once for all consumers");
  app.add_flag(
      "--sealed", settings.is_sealed,
      "call, isolation over UDP and TCP: sealed sessions; the floor seals and opens as many "
      "frames");
  std::vector<std::string> peers{std::string(kAllPeers)};
  std::ranges::transform(known_peers(), std::back_inserter(peers),
                         [](const PeerEntry& peer) { return std::string(peer.name); });
  add_list(app, "--peers", settings.peers,
           "call, paced, isolation, events: measure other middleware, too")
      ->check(CLI::IsMember(peers));
  app.add_flag("--own-hub", settings.has_own_hub,
               "events with --peers: the supplier's program has the hub, beside peers without a "
               "broker");
}

/// Returns why the options contradict each other; empty if they do not.
std::string fault_of(const std::vector<std::string>& cases, const Settings& settings) {
  const bool has_events = std::ranges::count(cases, "events") > 0;
  if (settings.has_own_hub && (!has_events || settings.peers.empty())) {
    return "--own-hub is for the case events beside peers: give --peers";
  }
  for (const PeerEntry* peer : chosen_peers(settings)) {
    const std::string name(peer->name);
    if (settings.has_own_hub && peer->has_broker && std::ranges::count(settings.peers, name) > 0) {
      return "--own-hub is for peers without a broker, and " + name + " has one";
    }
  }
  if (settings.has_multicast && (!has_events || settings.carriers != std::vector{Carrier::kUdp})) {
    return "--multicast is for the case events: give --transport udp, too";
  }
  if (settings.is_sealed) {
    const bool is_of_others = std::ranges::any_of(
        cases, [](const std::string& each) { return each != "call" && each != "isolation"; });
    const bool is_large = std::ranges::max(settings.payload_sizes) > kSealedPayloadMax;
    if (std::ranges::count(settings.carriers, Carrier::kSharedMemory) > 0)
      return "shared memory is not sealed: give --transport udp or tcp with --sealed";
    if (is_of_others || is_large || !settings.peers.empty()) {
      return "--sealed is for the cases call and isolation, without peers, and for payloads of one "
             "datagram";
    }
  }
  return {};
}

int usage_error(const std::string& what) {
  say("usage", what + "; rtpm-bench run --help says more");
  return 2;
}

/// Finds out, on a thread that ends at once, whether the run may have SCHED_FIFO; if not, says so
/// once here instead of in every server process.
/// @return the reason if the run cannot be as asked
Outcome<> settle_realtime(Settings& settings) {
  if (settings.realtime == rt::RealtimeMode::kOff) return {};
  const auto thread = rt::Thread::start(
      {.name = "bench-probe", .priority = kHighPriority, .realtime = rt::RealtimeMode::kRequire},
      [] {});
  if (!thread && settings.realtime == rt::RealtimeMode::kRequire) {
    return failure(thread.error());
  }
  if (!thread) {
    say("warning", thread.error().text());
    settings.realtime = rt::RealtimeMode::kOff;
  }
  if (auto locked = rt::lock_memory(settings.realtime); !locked) {
    return failure(locked.error());
  }
  return {};
}

int run(const std::vector<std::string>& names, Report::Form form, Settings settings) {
  if (auto settled = settle_realtime(settings); !settled) {
    say("error", settled.error());
    return 1;
  }
  Report report(
      form, describe_environment(choose_placement(), settings.realtime != rt::RealtimeMode::kOff));
  say_missing_peers(settings, report);
  for (const std::string& name : names)
    run_case(*std::ranges::find(cases(), name, &Case::name), settings, report);
  return report.is_complete() ? 0 : 1;
}

int run_program(int argc, char** argv) {
  CLI::App app("Measures RTPM beside the raw sockets below it, in one interleaved run.",
               "rtpm-bench");
  app.require_subcommand(0, 1);
  app.option_defaults()->always_capture_default();
  Settings settings;
  std::vector<std::string> names;
  bool is_json = false;
  std::string server;
  app.add_subcommand("list", "say which cases there are");
  CLI::App& run_cases = *app.add_subcommand("run", "run cases");
  CLI::App& serve = *app.add_subcommand("serve", "what startup, memory and idle start");
  std::vector<std::string> known;
  std::ranges::transform(cases(), std::back_inserter(known),
                         [](const Case& each) { return std::string(each.name); });
  run_cases.add_option("CASE", names, "what to run")->required()->check(CLI::IsMember(known));
  run_cases.add_flag("--json", is_json, "print one JSON object per result");
  add_common_options(run_cases, settings);
  add_case_options(run_cases, settings);
  serve.add_option("SERVER", server, "rtpm or floor")
      ->required()
      ->check(CLI::IsMember({"rtpm", "floor"}));
  add_common_options(serve, settings);
  try {
    app.parse(argc, argv);
  } catch (const CLI::Success& help) {
    return app.exit(help);
  } catch (const CLI::ParseError& error) {
    return usage_error(error.what());
  }
  if (app.get_subcommands().empty()) return usage_error("give list, run or serve");
  if (const std::string fault = fault_of(names, settings); !fault.empty())
    return usage_error(fault);
  if (serve.parsed())
    return serve_standalone(server == "rtpm" ? Side::kRtpm : Side::kFloor, settings);
  if (run_cases.parsed()) {
    return run(names, is_json ? Report::Form::kJsonLines : Report::Form::kTable, settings);
  }
  for (const Case& each : cases()) {
    std::printf("%-12s %s\n", std::string(each.name).c_str(),
                std::string(each.description).c_str());
  }
  return 0;
}

}  // namespace
}  // namespace rtpm::bench

int main(int argc, char** argv) {
  return rtpm::bench::run_program(argc, argv);
}
