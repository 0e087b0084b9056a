#include "rtpm/options/server_options.hpp"

#include <algorithm>
#include <cstdio>
#include <string_view>
#include <utility>

#include "rtpm/access/fingerprint.hpp"
#include "rtpm/rt/log.hpp"
#include "rtpm/rt/report.hpp"
#include "rtpm/transport/shared_memory.hpp"
#include "rtpm/wire/limits.hpp"

namespace rtpm::options {
namespace {

constexpr std::string_view kLanePrefix = "lane-";
/// A thread's name has at most 15 bytes, the prefix included.
constexpr std::size_t kLaneNameSizeMax = 10;

/// A lane's name in options.
std::string short_name_of(const rpc::LaneConfig& lane) {
  const std::string_view name = lane.name;
  return std::string(name.starts_with(kLanePrefix) ? name.substr(kLanePrefix.size()) : name);
}

void add_lane(Options options, rpc::LaneConfig& lane) {
  constexpr std::uint32_t kThreadCountMax = 64;
  options.add("low", lane.low, "The lowest priority that the lane serves");
  options.add("priority", lane.priority, "The lowest priority at which it waits and receives");
  options.add("cpus", lane.cpus, "The CPUs it may run on; none: all");
  options.add_wait(lane.wait);
  options.add("schedule", lane.schedule,
              "fifo: before all time-shared threads; time-shared: behind every real-time "
              "thread");
  options.add("threads", lane.static_threads, "How many calls run concurrently",
              {1, kThreadCountMax});
  options.add("dynamic-threads", lane.dynamic_threads,
              "How many more may, on threads started on demand", {0, kThreadCountMax});
  options.add("dynamic-idle", lane.dynamic_idle,
              "How long such a thread may be idle before it ends");
  options.add("buffered-requests", lane.buffered_request_max,
              "How many calls may wait while all threads are busy", {0, 4096});
  options.add("buffered-bytes", lane.buffered_byte_max,
              "How many bytes their requests may have together");
}

void add_limits(Options options, rpc::ServerConfig& server) {
  options.add("ceiling", server.ceiling, "The highest priority that callers are granted");
  options.add("borrows", server.borrows,
              "Lets a lane whose threads are all busy take one of a lower lane");
  options.add("sessions-max", server.session_count_max, "Callers' sessions, per lane and transport",
              {1, 0xffff});
  options.add("message-size-max", server.message_size_max, "Bytes of a request or reply",
              {static_cast<std::uint32_t>(wire::kMessageSizeFloor),
               static_cast<std::uint32_t>(wire::kMessageSizeCeiling)});
  options.add("large-messages-max", server.large_message_count_max,
              "Messages larger than a frame that a lane holds at a time, per transport", {0, 1024});
  options.add("deferred-calls-max", server.deferred_call_count_max,
              "Calls of a lane that may be unfinished at a time", {0, 4096});
  options.add("streams-max", server.stream_count_max,
              "How many of them may be streams, per transport", {0, 1024});
  options.add("stream-bytes-max", server.stream_byte_max,
              "Bytes of items that a stream holds while its caller takes no more",
              {4096, static_cast<std::uint32_t>(wire::kMessageSizeCeiling)});
  options.add("local-oneways-max", server.local_oneway_count_max,
              "Oneways of the same program that wait or run in a lane at a time", {0, 4096});
}

void add_key(Options options, std::string& file) {
  options.add("key", file,
              "The program's key; empty: ~/.config/rtpm/key, or in the folder of RTPM_KEYS");
}

void add_key_log(Options options, std::string& file) {
  options.add(
      "key-log", file,
      "Write keys of sessions here, for Wireshark; with them anybody can read all; empty: nowhere");
}

void add_known_servers(Options options, std::string& file) {
  options.add("known-servers", file,
              "Servers to call over sealed sessions only, from `rtpm key learn`; empty: "
              "~/.config/rtpm/known_servers");
}

void add_server_security(Options options, rpc::ServerSecurity& security) {
  options.add("authorized", security.authorized_file,
              "Who may do what, lines from `rtpm key authorize`; empty: ~/.config/rtpm/authorized "
              "for other addresses than loopback");
  add_key(options, security.key_file);
  options.add("insecure", security.is_insecure,
              "Serve everybody who reaches the port: they can move devices");
  add_key_log(options.rare(), security.key_log_file);
  options.rare().add("audit", security.audit_file,
                     "Write sessions, refusals and administration here; empty: nowhere");
}

}  // namespace

void add_caller(const Options& options, rpc::NodeSecurity& security) {
  const Options rare = options.of_all_programs("security").rare();
  add_key(rare, security.key_file);
  add_known_servers(rare, security.known_servers_file);
  add_key_log(rare, security.key_log_file);
}

void add_caller(const Options& options, ServerSettings& settings) {
  add_known_servers(options.of_all_programs("security").rare(), settings.known_servers_file);
}

rpc::NodeSecurity node_security(const ServerSettings& settings) {
  const rpc::ServerSecurity& own = settings.server.security;
  return {own.key_file, settings.known_servers_file, own.key_log_file};
}

void add_server(const Options& options, ServerSettings& settings) {
  Options shared = options.of_all_programs();
  rpc::ServerConfig& server = settings.server;
  shared.add("host", server.host,
             "What to serve: addresses (IPv4, IPv6), host names and interfaces, with ',' between; "
             "or any. The default is this host only; any opens it to every network");
  shared.add("port", server.port, "Port to serve, UDP and TCP; 0: any");
  add_server_security(options.of_all_programs("security"), server.security);
  Options rare = shared.rare();
  rare.add("advertise", server.advertise,
           "The hosts to be found at, with ',' between, if callers reach others than those that "
           "are served (a container, NAT); empty: those");
  // By default served where the system offers it; prepare() refuses what a user asks for in vain.
  server.shared_memory = server.shared_memory && transport::offers_shared_memory();
  rare.add("shared-memory", server.shared_memory,
           "Whether callers of the same user on this host are served through memory");
  rare.add("shared-memory-folder", server.shared_memory_folder,
           "Where the socket for that is; empty: an abstract name");
  rare.add_realtime(server.realtime);
  rare.add("cpu-latency", settings.cpu_latency,
           "Longest wake-up of any CPU of the machine; off: the system's choice");
  rare.add("setup-report", settings.shows_setup, "Print on standard error what the system granted");
  add_limits(rare, server);
  settings.lanes.clear();
  for (const rpc::LaneConfig& lane : server.lanes)
    settings.lanes.push_back(short_name_of(lane));
  rare.add_group("lanes", "lane", settings.lanes,
                 "The names of the lanes, each with options --lane-NAME-… or in [lane.NAME]",
                 kLaneNameSizeMax, [rare, &settings](const std::vector<std::string>& names) {
                   auto& lanes = settings.server.lanes;
                   const auto defaults = std::exchange(lanes, {});
                   for (const std::string& name : names) {
                     const auto known = std::ranges::find(defaults, name, &short_name_of);
                     lanes.push_back(known == defaults.end()
                                         ? rpc::LaneConfig{.name = std::string(kLanePrefix) + name}
                                         : *known);
                   }
                   for (std::size_t i = 0; i < lanes.size(); ++i)
                     add_lane(rare.of_member("lane", names[i]), lanes[i]);
                 });
}

expected<rt::CpuLatencyRequest, SetupError> prepare(const ServerSettings& settings) {
  if (settings.server.shared_memory && !transport::offers_shared_memory()) {
    return setup_error("--shared-memory: this system offers no shared memory to callers", "",
                       "leave it out; callers use UDP or TCP");
  }
  if (!settings.cpu_latency) return rt::CpuLatencyRequest{};
  return rt::CpuLatencyRequest::open(*settings.cpu_latency, settings.server.realtime);
}

void show_setup(const ServerSettings& settings, const rpc::Server& server,
                std::string_view program) {
  const auto served = server.served_addresses();
  const bool is_for_others = std::ranges::any_of(
      served, [](const rpc::ServedAddress& address) { return address.interface != "lo"; });
  for (const rpc::ServedAddress& address : served) {
    if (!is_for_others) break;
    const std::string on = address.interface.empty() ? "" : " on " + address.interface;
    rt::print_error(program, "serves " + address.host + ":" + std::to_string(server.port()) + on);
  }
  // A server without grants reports by itself whom it serves.
  if (const auto callers = server.served_callers(); !callers.authorized_file.empty()) {
    rt::print_error(program, "its key is " + access::public_key_text(callers.key) +
                                 ", fingerprint " + access::fingerprint(callers.key));
    rt::print_error(program, "serves whom " + callers.authorized_file + " lets in");
  }
  if (settings.shows_setup) std::fputs(rt::to_text(rt::setup_report()).c_str(), stderr);
}

}  // namespace rtpm::options
