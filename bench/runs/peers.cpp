#include "runs/peers.hpp"

#include <fcntl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <sstream>
#include <utility>

#include "sides/server_process.hpp"

namespace rtpm::bench {
namespace {

namespace fs = std::filesystem;

/// Added to the time that a turn takes by its plan. A peer whose calls fail says so after a second.
constexpr Duration kTurnPatience = std::chrono::seconds{15};

/// A folder's name contains the number of its process, so that folders left by killed runs are
/// recognised.
constexpr std::string_view kFolderPrefix = "rtpm-peer-";

void remove_left_folders() {
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator(fs::temp_directory_path(ignored), ignored)) {
    const std::string name = entry.path().filename();
    if (!name.starts_with(kFolderPrefix)) continue;
    const std::string process =
        name.substr(kFolderPrefix.size(), name.find_last_of('-') - kFolderPrefix.size());
    const bool is_ours = std::ranges::all_of(process, [](char c) { return c >= '0' && c <= '9'; });
    if (is_ours && !fs::exists("/proc/" + process, ignored)) fs::remove_all(entry.path(), ignored);
  }
}

/// A peer's server and client, which are stopped except in the peer's turns.
struct PeerProcesses {
  PeerProcesses() = default;
  PeerProcesses(const PeerProcesses&) = delete;
  PeerProcesses& operator=(const PeerProcesses&) = delete;
  ~PeerProcesses() {
    processes.clear();
    if (link >= 0) close(link);
    std::error_code ignored;
    fs::remove_all(folder, ignored);
  }

  [[nodiscard]] Outcome<> start(const std::string& program, const std::string& verb,
                                PeerSetting setting);
  [[nodiscard]] Outcome<> take_turn(const TurnPlan& plan, Finding& finding) const;

  std::string folder{};
  int link = -1;
  std::vector<ServerProcess> processes{};
};

Outcome<> PeerProcesses::start(const std::string& program, const std::string& verb,
                               PeerSetting setting) {
  std::array<int, 2> ends{};
  if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data()) != 0) {
    return failure("no socket for a peer's program");
  }
  link = ends[0];
  setting.link = ends[1];
  setting.folder = folder;
  Outcome<> started;
  // Events go through a broker, calls to a server.
  for (const std::string& role : {std::string(verb == "call" ? "serve" : "broker"), verb}) {
    // Only the caller's program inherits its end, so that the stream ends with it.
    if (role == verb) fcntl(ends[1], F_SETFD, 0);
    auto process = ServerProcess::start_program({program, role, nlohmann::json(setting).dump()});
    if (!process) {
      started = failure(process.error());
      break;
    }
    setting.addresses = nlohmann::json::parse(process->address()).get<std::vector<std::string>>();
    processes.push_back(std::move(*process));
  }
  close(ends[1]);
  for (const ServerProcess& process : processes)
    process.pause();
  return started;
}

Outcome<> PeerProcesses::take_turn(const TurnPlan& plan, Finding& finding) const {
  std::optional<nlohmann::json> line;
  {
    const Running running({&processes[0], &processes[1]});
    const auto planned = Duration{plan.period_ns} * static_cast<Duration::rep>(plan.count);
    if (send_line(link, plan)) line = receive_line(link, planned + kTurnPatience);
  }
  if (!line) return failure("its program ended, or said nothing for 15 s");
  const auto answer = line->get<PeerAnswer>();
  if (!answer.error.empty()) return failure(answer.error);
  for (const std::int64_t latency_ns : answer.first_ns)
    finding.first.add(Duration{latency_ns});
  for (const std::int64_t latency_ns : answer.second_ns)
    finding.second.add(Duration{latency_ns});
  finding.missing_count += answer.missing_count;
  return {};
}

}  // namespace

std::vector<std::string> PeerEntry::transports(std::string_view verb, Carrier carrier) const {
  std::vector<std::string> chosen;
  std::istringstream words{std::string(verb == "call" ? call_transports : event_transports)};
  for (std::string word; words >> word;) {
    const bool is_beside = word == "tcp"   ? carrier != Carrier::kSharedMemory
                           : word == "udp" ? carrier == Carrier::kUdp
                                           : carrier == Carrier::kSharedMemory;
    if (is_beside) chosen.push_back(word);
  }
  return chosen;
}

std::span<const PeerEntry> known_peers() {
  static constexpr std::array kPeers{
      PeerEntry{"omniorb", "libomniorb4-dev omniidl", "tcp unix", ""},
      PeerEntry{"ice", "libzeroc-ice-dev zeroc-ice-compilers", "tcp", ""},
      PeerEntry{"grpc", "libgrpc++-dev protobuf-compiler-grpc libprotobuf-dev protobuf-compiler",
                "tcp unix", ""},
      PeerEntry{"capnproto", "libcapnp-dev capnproto", "tcp unix", ""},
      PeerEntry{"zeromq", "libzmq3-dev", "tcp ipc", "tcp ipc", true},
      PeerEntry{"nng", "libnng-dev", "tcp ipc", "tcp ipc", true},
      PeerEntry{"cyclonedds", "cyclonedds-dev cyclonedds-tools", "udp", "udp"},
      PeerEntry{"fastdds", "libfastrtps-dev libfastcdr-dev", "udp shm", "udp shm"},
      PeerEntry{"lcm", "liblcm-dev", "udp", "udp"},
  };
  return kPeers;
}

std::vector<const PeerEntry*> chosen_peers(const Settings& settings) {
  std::vector<const PeerEntry*> chosen;
  for (const PeerEntry& peer : known_peers()) {
    for (const std::string& name : settings.peers) {
      if (name == peer.name || name == kAllPeers) chosen.push_back(&peer);
    }
  }
  return chosen;
}

void say_missing_peers(const Settings& settings, Report& report) {
  for (const PeerEntry* peer : chosen_peers(settings)) {
    if (find_program(*peer)) continue;
    const std::string name(peer->name);
    const std::string why = "is not built, as rtpm-peer-" + name +
                            " is not beside this program. Remedy: apt-get install " +
                            std::string(peer->packages) + ", and build with -DRTPM_BENCH_PEERS=ON.";
    if (std::ranges::count(settings.peers, name) > 0) {
      report.fail("peer " + name, why);
    } else {
      say("peer " + name, why);
    }
  }
}

std::optional<std::string> find_program(const PeerEntry& peer) {
  std::error_code error;
  const auto self = fs::read_symlink("/proc/self/exe", error);
  const auto path = self.parent_path() / ("rtpm-peer-" + std::string(peer.name));
  if (error || !fs::exists(path, error)) return std::nullopt;
  return path.string();
}

Outcome<Contender> start_peer(const std::string& program, const std::string& verb,
                              const PeerSetting& setting) {
  remove_left_folders();
  auto peer = std::make_shared<PeerProcesses>();
  peer->folder = fs::temp_directory_path() /
                 (std::string(kFolderPrefix) + std::to_string(getpid()) + "-XXXXXX");
  if (mkdtemp(peer->folder.data()) == nullptr) return failure("no folder like " + peer->folder);
  if (auto started = peer->start(program, verb, setting); !started) {
    return failure(started.error());
  }
  return Contender(
      [peer](const TurnPlan& plan, Finding& finding) { return peer->take_turn(plan, finding); });
}

}  // namespace rtpm::bench
