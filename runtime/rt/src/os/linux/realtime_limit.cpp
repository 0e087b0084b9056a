#include <algorithm>
#include <array>
#include <charconv>
#include <cstdint>
#include <cstring>
#include <optional>
#include <string_view>

#include "file_text.hpp"
#include "rtpm/rt/budget.hpp"
#include "setup_text.hpp"

namespace rtpm::rt {
namespace {

std::optional<std::int64_t> number_in(const char* path) noexcept {
  std::array<char, 32> buffer{};
  const std::string_view text = read_file(path, buffer);
  std::int64_t number = 0;
  if (std::from_chars(text.data(), text.data() + text.size(), number).ec != std::errc{}) return {};
  return number;
}

RealtimeLimit limit_in(const char* runtime_path, const char* period_path) noexcept {
  const auto runtime_us = number_in(runtime_path);
  const auto period_us = number_in(period_path);
  if (!runtime_us || !period_us || *runtime_us < 0 || *period_us <= 0) return {};
  return {std::chrono::microseconds{*runtime_us}, std::chrono::microseconds{*period_us}};
}

// The folder of the version-1 control group that limits real-time work, if mounted at its usual
// path. Empty if there is none, or it is the root, which has the kernel's limit.
std::string_view group_folder(std::array<char, 512>& folder) noexcept {
  std::array<char, 4096> buffer{};
  std::string_view rest = read_file("/proc/self/cgroup", buffer);
  while (!rest.empty()) {
    const std::string_view line = rest.substr(0, rest.find('\n'));
    rest.remove_prefix(std::min(line.size() + 1, rest.size()));
    // "1:cpu,cpuacct:/the/group"
    const std::size_t begin = line.find(':');
    const std::size_t end = line.find(':', begin + 1);
    if (begin == line.npos || end == line.npos) continue;
    std::string_view controllers = line.substr(begin + 1, end - begin - 1);
    const std::string_view group = line.substr(end + 1);
    const bool has_cpu = controllers == "cpu" || controllers.starts_with("cpu,") ||
                         controllers.ends_with(",cpu") ||
                         controllers.find(",cpu,") != controllers.npos;
    constexpr std::string_view kMount = "/sys/fs/cgroup/cpu";
    if (!has_cpu || group == "/" || kMount.size() + group.size() + 32 > folder.size()) continue;
    std::memcpy(folder.data(), kMount.data(), kMount.size());
    std::memcpy(folder.data() + kMount.size(), group.data(), group.size());
    return {folder.data(), kMount.size() + group.size()};
  }
  return {};
}

// nullopt if no control group limits real-time work.
std::optional<RealtimeLimit> limit_of_group() noexcept {
  std::array<char, 512> folder{};
  const std::string_view group = group_folder(folder);
  if (group.empty()) return {};
  std::array<char, 512> runtime_path{};
  std::array<char, 512> period_path{};
  const auto put = [&](std::array<char, 512>& path, std::string_view name) {
    std::memcpy(path.data(), group.data(), group.size());
    std::memcpy(path.data() + group.size(), name.data(), name.size());
  };
  put(runtime_path, "/cpu.rt_runtime_us");
  put(period_path, "/cpu.rt_period_us");
  if (!number_in(runtime_path.data())) return {};
  return limit_in(runtime_path.data(), period_path.data());
}

// Whether the process has CAP_SYS_NICE in the host's own user namespace.
bool has_right_to_realtime() noexcept {
  std::array<char, 64> map{};
  if (read_file("/proc/self/uid_map", map).find("4294967295") == std::string_view::npos) {
    return false;
  }
  std::array<char, 4096> buffer{};
  const std::string_view status = read_file("/proc/self/status", buffer);
  constexpr std::string_view kLabel = "CapEff:\t";
  const std::size_t label = status.find(kLabel);
  if (label == std::string_view::npos) return false;
  const std::string_view digits = status.substr(label + kLabel.size());
  std::uint64_t capabilities = 0;
  std::from_chars(digits.data(), digits.data() + digits.size(), capabilities, 16);
  constexpr int kSysNice = 23;  // CAP_SYS_NICE of linux/capability.h
  return (capabilities >> kSysNice & 1) != 0;
}

}  // namespace

RealtimeLimit realtime_limit() noexcept {
  static const RealtimeLimit limit = [] {
    const RealtimeLimit kernel =
        limit_in("/proc/sys/kernel/sched_rt_runtime_us", "/proc/sys/kernel/sched_rt_period_us");
    const auto group = limit_of_group();
    // A group without its own runtime may not have real-time threads at all.
    if (!group || group->runtime == Duration{0}) return kernel;
    return group->share() < kernel.share() ? *group : kernel;
  }();
  return limit;
}

bool is_group_without_realtime() noexcept {
  const auto group = limit_of_group();
  if (group) return group->is_limited() && group->runtime == Duration{0};
  // With CONFIG_RT_GROUP_SCHED the kernel refuses threads of all version-2 groups but the root, and
  // shows that nowhere.
  return has_right_to_realtime();
}

}  // namespace rtpm::rt
