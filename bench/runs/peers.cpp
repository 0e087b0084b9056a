#include "runs/peers.hpp"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <filesystem>
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

class PeerContender final : public Contender {
 public:
  explicit PeerContender(SharedBoard board) : board_(std::move(board)) {}
  ~PeerContender() override {
    processes_.clear();
    std::error_code ignored;
    fs::remove_all(std::string(board_->setting.folder.get()), ignored);
  }

  [[nodiscard]] expected<void, std::string> start(const std::string& program,
                                                  const std::string& verb) {
    const std::string file = std::to_string(board_.file());
    // Events go through a broker, calls to a server.
    for (const std::string& role : {std::string(verb == "call" ? "serve" : "broker"), verb}) {
      auto process = ServerProcess::start_program({program, role, file});
      if (!process) return unexpected{process.error()};
      processes_.push_back(std::move(*process));
    }
    for (const ServerProcess& process : processes_)
      process.pause();
    return {};
  }

  expected<void, std::string> take_turn(const TurnPlan& plan, Finding& finding) override {
    PeerBoard& board = *board_.operator->();
    board.plan = plan;
    {
      const Running running({&processes_[0], &processes_[1]});
      const auto planned = Duration{plan.period_ns} * static_cast<Duration::rep>(plan.count);
      if (!board.run_plan(planned + kTurnPatience)) {
        return unexpected{std::string("its program said nothing for 15 s")};
      }
    }
    if (!board.error.get().empty()) return unexpected{std::string(board.error.get())};
    take(std::span(board.high_ns).first(board.high_count), finding.first);
    take(std::span(board.low_ns).first(board.low_count), finding.second);
    finding.missing_count += board.missing_count;
    return {};
  }

 private:
  static void take(std::span<const std::int64_t> latencies_ns, Samples& samples) {
    for (const std::int64_t latency_ns : latencies_ns)
      samples.add(Duration{latency_ns});
  }

  SharedBoard board_;
  std::vector<ServerProcess> processes_{};  ///< The server and the client.
};

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

expected<std::unique_ptr<Contender>, std::string> start_peer(const std::string& program,
                                                             const std::string& verb,
                                                             const PeerSetting& setting) {
  auto board = SharedBoard::create();
  if (!board) return unexpected{board.error()};
  remove_left_folders();
  std::string folder = fs::temp_directory_path() /
                       (std::string(kFolderPrefix) + std::to_string(getpid()) + "-XXXXXX");
  if (mkdtemp(folder.data()) == nullptr) return unexpected{"no folder like " + folder};
  (*board)->setting = setting;
  (*board)->setting.folder.set(folder);
  auto contender = std::make_unique<PeerContender>(std::move(*board));
  if (auto started = contender->start(program, verb); !started) {
    return unexpected{started.error()};
  }
  return contender;
}

}  // namespace rtpm::bench
