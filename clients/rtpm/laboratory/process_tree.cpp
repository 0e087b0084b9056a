#include "laboratory/process_tree.hpp"

#include <dirent.h>
#include <poll.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <memory>
#include <set>
#include <sstream>
#include <string>
#include <string_view>

#include "laboratory/process.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::laboratory {
namespace {

constexpr Duration kKillTime = std::chrono::seconds{2};
constexpr int kTurnMs = 10;

struct Stat {
  ProcessIdentity identity{};
  pid_t parent = 0;
  bool is_zombie = false;
};

std::optional<Stat> stat_of(pid_t id) {
  std::ifstream file("/proc/" + std::to_string(id) + "/stat");
  const std::string text{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  // The command in parentheses may contain blanks and parentheses.
  const std::size_t command_end = text.rfind(')');
  if (command_end == std::string::npos) return std::nullopt;
  std::istringstream fields(text.substr(command_end + 1));
  char state = 0;
  Stat stat;
  fields >> state >> stat.parent;
  constexpr int kFieldsBetween = 17;  // proc(5): from pgrp, the 5th, to itrealvalue, the 21st.
  std::string ignored;
  for (int i = 0; i < kFieldsBetween; ++i)
    fields >> ignored;
  fields >> stat.identity.start_ticks;
  if (!fields) return std::nullopt;
  stat.identity.id = id;
  stat.is_zombie = state == 'Z' || state == 'X';
  return stat;
}

std::vector<Stat> all_processes() {
  std::vector<Stat> processes;
  const std::unique_ptr<DIR, int (*)(DIR*)> folder(::opendir("/proc"), &::closedir);
  if (folder == nullptr) return processes;
  while (const dirent* const entry = ::readdir(folder.get())) {
    const std::string_view name = entry->d_name;
    pid_t id = 0;
    const auto read = std::from_chars(name.data(), name.data() + name.size(), id);
    if (read.ec != std::errc{} || read.ptr != name.data() + name.size()) continue;
    if (auto stat = stat_of(id)) processes.push_back(*stat);
  }
  return processes;
}

/// @return whether this process has children
bool reap() {
  for (;;) {
    const pid_t id = ::waitpid(-1, nullptr, WNOHANG);
    if (id == 0) return true;
    if (id < 0 && errno != EINTR) return false;
  }
}

void signal_descendants(int signal) {
  for (const ProcessIdentity& process : descendants_of(::getpid()))
    send_signal(process, signal);
}

}  // namespace

std::optional<ProcessIdentity> identity_of(pid_t id) {
  const auto stat = stat_of(id);
  if (!stat || stat->is_zombie) return std::nullopt;
  return stat->identity;
}

std::vector<ProcessIdentity> descendants_of(pid_t id) {
  const std::vector<Stat> processes = all_processes();
  std::set<pid_t> family{id};
  std::vector<ProcessIdentity> found;
  for (std::size_t before = 0; before != family.size();) {
    before = family.size();
    for (const Stat& process : processes) {
      if (!family.contains(process.parent) || !family.insert(process.identity.id).second) continue;
      if (!process.is_zombie) found.push_back(process.identity);
    }
  }
  return found;
}

bool send_signal(const ProcessIdentity& process, int signal) {
  const Handle handle(static_cast<int>(::syscall(SYS_pidfd_open, process.id, 0)));
  // The descriptor refers to the process that has the number now; it may be another one.
  if (!handle.is_open() || identity_of(process.id) != process) return false;
  return ::syscall(SYS_pidfd_send_signal, handle.number(), signal, nullptr, 0) == 0;
}

void adopt_orphans() {
  ::prctl(PR_SET_CHILD_SUBREAPER, 1);
}

bool end_descendants(Duration patience) {
  if (!reap()) return true;
  if (patience > Duration{0}) signal_descendants(SIGTERM);
  const MonotonicTime kill_time = rt::now() + patience;
  const MonotonicTime end = kill_time + kKillTime;
  while (reap()) {
    const MonotonicTime now = rt::now();
    if (now >= end) return false;
    // Repeated, because a process may have started other processes meanwhile.
    if (now >= kill_time) signal_descendants(SIGKILL);
    static_cast<void>(::poll(nullptr, 0, kTurnMs));
  }
  return true;
}

}  // namespace rtpm::laboratory
