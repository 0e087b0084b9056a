#include "runs/peer_contender.hpp"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <filesystem>
#include <string_view>
#include <utility>

namespace rtpm::bench {
namespace {

/// Beyond what a turn takes by its plan. A peer whose calls fail says so after a second.
constexpr Duration kTurnPatience = std::chrono::seconds{15};

/// Folders have the number of their process in their name, so that those that killed runs left are
/// known.
constexpr std::string_view kFolderPrefix = "rtpm-peer-";

void remove_left_folders() {
  std::error_code ignored;
  for (const auto& entry : std::filesystem::directory_iterator(
           std::filesystem::temp_directory_path(ignored), ignored)) {
    const std::string name = entry.path().filename();
    if (!name.starts_with(kFolderPrefix)) continue;
    const std::string process =
        name.substr(kFolderPrefix.size(), name.find_last_of('-') - kFolderPrefix.size());
    const bool is_ours = std::ranges::all_of(process, [](char c) { return c >= '0' && c <= '9'; });
    if (!is_ours || std::filesystem::exists("/proc/" + process, ignored)) continue;
    std::filesystem::remove_all(entry.path(), ignored);
  }
}

expected<std::string, std::string> make_folder() {
  remove_left_folders();
  std::string name = std::filesystem::temp_directory_path() /
                     (std::string(kFolderPrefix) + std::to_string(getpid()) + "-XXXXXX");
  if (mkdtemp(name.data()) == nullptr) return unexpected{"no folder like " + name};
  return name;
}

void take(const std::array<std::int64_t, kPeerSampleMax>& latencies, std::uint64_t count,
          Samples& samples) {
  for (std::size_t i = 0; i < std::min<std::uint64_t>(count, kPeerSampleMax); ++i)
    samples.add(Duration{latencies[i]});
}

}  // namespace

expected<std::unique_ptr<PeerContender>, std::string> PeerContender::start(
    const PeerEntry& peer, const std::string& program, const std::string& verb,
    const PeerSetting& setting) {
  auto board = SharedBoard::create();
  if (!board) return unexpected{board.error()};
  auto folder = make_folder();
  if (!folder) return unexpected{folder.error()};
  (*board)->setting = setting;
  (*board)->setting.folder.set(*folder);
  std::unique_ptr<PeerContender> contender(new PeerContender(peer.name, std::move(*board)));
  if (auto started = contender->start_programs(program, verb); !started) {
    return unexpected{peer_title(peer.name, setting.transport.get()) + ": " + started.error()};
  }
  return contender;
}

expected<void, std::string> PeerContender::start_programs(const std::string& program,
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

PeerContender::~PeerContender() {
  processes_.clear();
  std::error_code ignored;
  std::filesystem::remove_all(std::string(board_->setting.folder.get()), ignored);
}

expected<void, std::string> PeerContender::take_turn(const TurnPlan& plan, Samples& high,
                                                     Samples& low) {
  PeerBoard& board = *board_.operator->();
  for (const ServerProcess& process : processes_)
    process.resume();
  board.plan = plan;
  const auto planned = Duration{plan.period_ns} * static_cast<Duration::rep>(plan.count);
  const bool is_over = board.run_plan(planned + kTurnPatience);
  for (const ServerProcess& process : processes_)
    process.pause();
  if (!is_over) return unexpected{std::string("its program said nothing for 15 s")};
  if (!board.error.get().empty()) return unexpected{std::string(board.error.get())};
  take(board.high_ns, board.high_count, high);
  take(board.low_ns, board.low_count, low);
  missing_count_ += board.missing_count;
  return {};
}

std::string peer_title(std::string_view name, std::string_view transport) {
  return std::string(name) + ", " + std::string(transport);
}

}  // namespace rtpm::bench
