#include <algorithm>
#include <cstdio>
#include <optional>
#include <string>
#include <vector>

#include "cases/case.hpp"
#include "cases/peers_case.hpp"
#include "figures/disturbance.hpp"
#include "figures/report.hpp"
#include "rtpm/options/options.hpp"
#include "rtpm/rt/memory.hpp"
#include "runs/peer_table.hpp"
#include "settings.hpp"
#include "sides/standalone.hpp"

namespace rtpm::bench {
namespace {

/// The command line as people write it, before it is checked.
struct Arguments {
  std::string verb;
  std::vector<std::string> cases;
  std::vector<std::string> transports{"udp", "tcp", "shm"};
  std::vector<std::string> waits{"adaptive"};
  std::vector<std::string> payloads{"48"};
  std::vector<std::string> low_callers{"0", "1", "4", "16"};
  std::vector<std::string> clients{"1", "10", "100", "1000"};
  std::vector<std::string> consumers{"1", "4", "16", "64", "256"};
  bool is_json = false;
};

void add_options(options::Options& options, Arguments& arguments, Settings& settings) {
  options.add_positional("VERB", arguments.verb,
                         "list, run followed by cases, or serve followed by rtpm or floor",
                         options::Presence::kRequired);
  options.add_positional("CASE", arguments.cases, "what to run; `list` says which there are");
  options.add("json", arguments.is_json, "print one JSON object per result");
  options.add("transport", arguments.transports, "udp, tcp, shm or several");
  options.add("wait", arguments.waits,
              "how callers and lanes wait: adaptive, periodic, block, spin, or several");
  options.add("spin", settings.spin, "how long the adaptive wait spins");
  options.add(
      "samples", settings.sample_count,
      "calls per side and result; 0: 100000 for call (fewer of large payloads), 2000 for events, "
      "10000 for the others",
      {0, 100'000'000});
  options.add("payload", arguments.payloads,
              "bytes that each call of `call` carries each way: 0, 48, 1Ki, 1Mi or several");
  options.add("latencies", settings.tells_latencies,
              "with --json, tell every latency of call, two-node, events, isolation and large");
  options.add("rounds", settings.round_count, "parts of a run, of which the middles are shown",
              {1, 1000});
  options.add("rate", settings.rate_hz, "calls per second of paced, isolation and large",
              {1, 100'000});
  options.add("low-callers", arguments.low_callers,
              "numbers of low-priority callers for isolation");
  options.add("clients", arguments.clients, "numbers of bound clients for scale");
  options.add("consumers", arguments.consumers, "numbers of consumers for events");
  options.add("own-threads", settings.has_own_threads,
              "each consumer of events has a thread of its own, and shares none");
  options.add(
      "own-hub", settings.has_own_hub,
      "with --peers: the supplier's program has the hub of events, beside peers that have no "
      "broker");
  options.add("multicast", settings.has_multicast,
              "with --transport udp: RTPM's hub of events sends each once for all consumers");
  options.add("work", settings.work, "how long each low-priority call computes",
              {std::chrono::microseconds{1}, std::chrono::seconds{1}});
  options.add("in-flight", settings.in_flight, "calls of throughput on their way at a time",
              {1, 64});
  options.add("calls", settings.call_count, "calls of two-node; 0: as --samples says",
              {0, 10'000'000});
  options.add("deadline", settings.deadline, "deadline of each call of two-node",
              {std::chrono::microseconds{10}, std::chrono::seconds{10}});
  options.add("drop", settings.drop_percent,
              "percent of the packets that two-node loses in each direction, at random", {0, 90});
  options.add(
      "peers", settings.peers,
      "measure other middleware, too: all, or names; call, paced, isolation and events heed it");
  options.add_realtime(settings.realtime);
}

std::optional<Carrier> carrier_of(const std::string& text) {
  if (text == "udp") return Carrier::kUdp;
  if (text == "tcp") return Carrier::kTcp;
  if (text == "shm") return Carrier::kSharedMemory;
  return std::nullopt;
}

std::optional<rt::WaitStrategy> wait_of(const std::string& text) {
  for (const auto strategy : {rt::WaitStrategy::kAdaptive, rt::WaitStrategy::kPeriodic,
                              rt::WaitStrategy::kBlock, rt::WaitStrategy::kSpin}) {
    if (text == rt::to_string(strategy)) return strategy;
  }
  return std::nullopt;
}

/// A number of bytes, with Ki or Mi behind it if wanted, of at most 8 MiB.
std::optional<std::size_t> payload_of(std::string text) {
  std::size_t unit = 1;
  if (text.ends_with("Ki")) unit = std::size_t{1} << 10;
  if (text.ends_with("Mi")) unit = std::size_t{1} << 20;
  if (unit > 1) text.resize(text.size() - 2);
  const bool is_number = !text.empty() && text.size() <= 7 &&
                         std::all_of(text.begin(), text.end(),
                                     [](char digit) { return digit >= '0' && digit <= '9'; });
  if (!is_number) return std::nullopt;
  const std::size_t size = unit * std::stoul(text);
  if (size > std::size_t{8} << 20) return std::nullopt;
  return size;
}

std::optional<int> caller_count_of(const std::string& text) {
  const bool is_number = !text.empty() && text.size() <= 2 &&
                         std::all_of(text.begin(), text.end(),
                                     [](char digit) { return digit >= '0' && digit <= '9'; });
  if (!is_number || std::stoi(text) > 64) return std::nullopt;
  return std::stoi(text);
}

std::optional<int> client_count_of(const std::string& text) {
  const bool is_number = !text.empty() && text.size() <= 4 &&
                         std::all_of(text.begin(), text.end(),
                                     [](char digit) { return digit >= '0' && digit <= '9'; });
  if (!is_number || std::stoi(text) < 1 || std::stoi(text) > 4000) return std::nullopt;
  return std::stoi(text);
}

std::optional<int> consumer_count_of(const std::string& text) {
  const bool is_number = !text.empty() && text.size() <= 3 &&
                         std::all_of(text.begin(), text.end(),
                                     [](char digit) { return digit >= '0' && digit <= '9'; });
  if (!is_number || std::stoi(text) < 1 || std::stoi(text) > 256) return std::nullopt;
  return std::stoi(text);
}

/// Turns every text of a list into what it means.
/// @return the first that means nothing, or nothing if all do.
template <class T, class Parse>
std::optional<std::string> translate(const std::vector<std::string>& texts, std::vector<T>& values,
                                     Parse parse) {
  values.clear();
  for (const std::string& text : texts) {
    const auto value = parse(text);
    if (!value) return text;
    values.push_back(*value);
  }
  if (values.empty()) return "";
  return std::nullopt;
}

/// What is wrong with the arguments, or nothing; the rest of `settings` is set.
std::optional<std::string> check(const Arguments& arguments, Settings& settings) {
  if (const auto wrong = translate(arguments.transports, settings.carriers, carrier_of)) {
    return "--transport takes udp, tcp and shm, not '" + *wrong + "'";
  }
  if (const auto wrong = translate(arguments.waits, settings.waits, wait_of)) {
    return "--wait takes adaptive, periodic, block and spin, not '" + *wrong + "'";
  }
  if (const auto wrong = translate(arguments.payloads, settings.payload_sizes, payload_of)) {
    return "--payload takes bytes up to 8Mi, such as 48 or 1Ki, not '" + *wrong + "'";
  }
  if (const auto wrong =
          translate(arguments.low_callers, settings.low_caller_counts, caller_count_of)) {
    return "--low-callers takes numbers from 0 to 64, not '" + *wrong + "'";
  }
  if (const auto wrong = translate(arguments.clients, settings.client_counts, client_count_of)) {
    return "--clients takes numbers from 1 to 4000, not '" + *wrong + "'";
  }
  if (const auto wrong =
          translate(arguments.consumers, settings.consumer_counts, consumer_count_of)) {
    return "--consumers takes numbers from 1 to 256, not '" + *wrong + "'";
  }
  if (arguments.verb == "list") {
    if (!arguments.cases.empty()) return "list takes no case, but got '" + arguments.cases[0] + "'";
    return std::nullopt;
  }
  if (arguments.verb == "serve") {
    if (arguments.cases.size() == 1 && standalone_of(arguments.cases.front())) return std::nullopt;
    return "serve takes rtpm or floor: it is what the cases startup, memory and idle start";
  }
  if (arguments.verb != "run")
    return "there is no verb '" + arguments.verb + "', only list, run and serve";
  if (const auto peers = choose_peers(settings.peers); !peers) {
    return "there is no peer '" + peers.error() + "', only all, " + peer_names();
  }
  const bool has_events = std::ranges::find(arguments.cases, "events") != arguments.cases.end();
  if (settings.has_own_hub && (!has_events || settings.peers.empty())) {
    return "--own-hub is for the case events beside peers without a broker, such as --peers lcm";
  }
  if (settings.has_multicast && (!has_events || settings.carriers != std::vector{Carrier::kUdp})) {
    return "--multicast is for the case events over UDP: give --transport udp, too";
  }
  std::string names;
  for (const Case& known : cases()) {
    if (!names.empty()) names += ", ";
    names += known.name;
  }
  if (arguments.cases.empty()) return "run needs at least one case of " + names;
  const auto unknown = std::ranges::find_if(arguments.cases, [](const std::string& name) {
    return std::ranges::none_of(cases(), [&](const Case& known) { return known.name == name; });
  });
  if (unknown == arguments.cases.end()) return std::nullopt;
  return "there is no case '" + *unknown + "', only " + names;
}

int list() {
  for (const Case& known : cases()) {
    std::printf("%-12.*s %.*s\n", static_cast<int>(known.name.size()), known.name.data(),
                static_cast<int>(known.description.size()), known.description.data());
  }
  return 0;
}

/// Finds out, on a thread that ends at once, whether the run may have SCHED_FIFO; if not, says so
/// once here instead of in every server process.
/// @return nothing if the run cannot be as asked.
std::optional<bool> settle_realtime(Settings& settings) {
  if (settings.realtime == rt::RealtimeMode::kOff) return false;
  const auto thread = rt::Thread::start(
      {.name = "bench-probe", .priority = kHighPriority, .realtime = rt::RealtimeMode::kRequire},
      [] {});
  if (thread) return true;
  say_not_measured(settings.realtime == rt::RealtimeMode::kRequire ? "error" : "warning",
                   thread.error().text());
  if (settings.realtime == rt::RealtimeMode::kRequire) return std::nullopt;
  settings.realtime = rt::RealtimeMode::kOff;
  return false;
}

int run(const Arguments& arguments, Settings settings) {
  const auto is_realtime = settle_realtime(settings);
  if (!is_realtime) return 1;
  if (auto locked = rt::lock_memory(settings.realtime); !locked) {
    say_not_measured("error", locked.error().text());
    return 1;
  }
  const Environment environment = describe_environment(choose_placement(), *is_realtime);
  Report report(arguments.is_json ? Report::Form::kJsonLines : Report::Form::kTable,
                environment.json, environment.text);
  bool is_complete = say_missing_peers(settings);
  for (const std::string& name : arguments.cases) {
    for (const Case& known : cases()) {
      if (known.name == name) is_complete = known.run(settings, report) && is_complete;
    }
  }
  return is_complete ? 0 : 1;
}

}  // namespace
}  // namespace rtpm::bench

int main(int argc, char** argv) {
  namespace bench = rtpm::bench;
  rtpm::options::Options options(
      "rtpm-bench", "Measures RTPM beside the raw sockets below it, in one interleaved run.");
  bench::Arguments arguments;
  bench::Settings settings;
  bench::add_options(options, arguments, settings);
  if (const auto exit_code = options.parse(argc, argv)) return *exit_code;
  if (const auto wrong = bench::check(arguments, settings)) return options.usage_error(*wrong);
  if (arguments.verb == "list") return bench::list();
  if (arguments.verb == "serve") {
    return bench::serve_standalone(*bench::standalone_of(arguments.cases.front()), settings);
  }
  return bench::run(arguments, settings);
}
