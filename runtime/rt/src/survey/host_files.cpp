#include <array>
#include <charconv>
#include <string>
#include <string_view>

#include "rtpm/rt/survey.hpp"
#include "survey/host_tree.hpp"
#include "survey/judgements.hpp"

// The facts about the host in the system's files.
namespace rtpm::rt {
namespace {

const std::string kCpuFolder = "/sys/devices/system/cpu/";

bool is_virtual_machine(const HostTree& tree) {
  for (const std::string& line : lines_of(tree.text("/proc/cpuinfo"))) {
    if (line.starts_with("flags")) return (line + " ").find(" hypervisor ") != std::string::npos;
  }
  return false;
}

/// The kind of container, by the files that the usual ones leave.
std::string container_of(const HostTree& tree) {
  const std::string named = tree.text("/run/systemd/container");
  if (!named.empty()) return named;
  if (tree.has("/.dockerenv")) return "docker";
  if (tree.has("/run/.containerenv")) return "podman";
  constexpr std::string_view kVariable = "container=";
  const std::string variables = tree.text("/proc/1/environ");
  for (std::size_t begin = 0; begin < variables.size();) {
    const std::string_view one(variables.c_str() + begin);
    if (one.starts_with(kVariable)) return std::string(one.substr(kVariable.size()));
    begin += one.size() + 1;
  }
  return {};
}

void read_frequencies(const HostTree& tree, HostFiles& files) {
  for (const std::string& cpu : tree.entries(kCpuFolder, "cpu")) {
    const std::string path = kCpuFolder + cpu + "/cpufreq/scaling_governor";
    std::string governor = tree.text(path);
    if (!governor.empty()) files.frequencies.push_back({path, std::move(governor)});
  }
}

/// The states of all CPUs, without duplicates.
void read_idle_states(const HostTree& tree, HostFiles& files) {
  files.idle_driver = tree.text(kCpuFolder + "cpuidle/current_driver");
  if (files.idle_driver == "none") files.idle_driver.clear();
  for (const std::string& cpu : tree.entries(kCpuFolder, "cpu")) {
    const std::string folder = kCpuFolder + cpu + "/cpuidle/";
    for (const std::string& state : tree.entries(folder, "state")) {
      const std::string base = folder + state + "/";
      const std::string name = tree.text(base + "name");
      const bool is_enabled = tree.number(base + "disable").value_or(0) == 0;
      const Duration wake_time =
          std::chrono::microseconds{tree.number(base + "latency").value_or(0)};
      bool is_known = false;
      for (IdleStateFacts& known : files.idle_states) {
        if (known.name != name) continue;
        known.is_enabled |= is_enabled;
        is_known = true;
      }
      if (!is_known) files.idle_states.push_back({name, wake_time, is_enabled});
    }
  }
}

/// Whether the thread's stat file gives its policy as SCHED_FIFO or SCHED_RR.
bool is_realtime(const HostTree& tree, const std::string& thread) {
  const std::string stat = tree.text(thread + "/stat");
  // The name, in brackets, may contain anything.
  const std::size_t name_end = stat.rfind(')');
  if (name_end == std::string::npos) return false;
  const std::vector<std::string> fields = words_of(std::string_view(stat).substr(name_end + 1));
  constexpr std::size_t kPolicy = 38;  // Field 41 of proc(5); index 0 is field 3.
  return fields.size() > kPolicy && (fields[kPolicy] == "1" || fields[kPolicy] == "2");
}

std::vector<int> cpus_of_thread(const HostTree& tree, const std::string& thread) {
  constexpr std::string_view kKey = "Cpus_allowed_list:";
  for (const std::string& line : lines_of(tree.text(thread + "/status"))) {
    if (!line.starts_with(kKey)) continue;
    const auto words = words_of(std::string_view(line).substr(kKey.size()));
    return words.empty() ? std::vector<int>{} : parse_cpu_list(words.front());
  }
  return {};
}

void read_pinned_cpus(const HostTree& tree, const std::vector<int>& process_ids, HostFiles& files) {
  for (const int id : process_ids) {
    const std::string folder = "/proc/" + std::to_string(id) + "/task/";
    for (const std::string& thread : tree.entries(folder)) {
      if (!is_realtime(tree, folder + thread)) continue;
      const std::vector<int> cpus = cpus_of_thread(tree, folder + thread);
      if (without(files.online_cpus, cpus).empty()) continue;
      files.pinned_cpus = united(files.pinned_cpus, cpus);
    }
  }
}

/// Parses " 36:  0  45573 PCI-MSIX-0000:00:02.0   1-edge      virtio1-req.0", with a column for
/// each of `cpus`.
void read_interrupt(const HostTree& tree, const std::string& line, const std::vector<int>& cpus,
                    HostFiles& files) {
  const std::vector<std::string> words = words_of(line);
  if (words.size() < cpus.size() + 2 || !words.front().ends_with(':')) return;
  const auto number = number_of(std::string_view(words.front()).substr(0, words[0].size() - 1));
  if (!number) return;  // One of the CPU's own, such as LOC.
  InterruptFacts facts{.number = static_cast<int>(*number), .name = words.back()};
  for (std::size_t i = 0; i < cpus.size(); ++i) {
    const std::int64_t count = number_of(words[i + 1]).value_or(0);
    if (count > 0) facts.counts[cpus[i]] = static_cast<std::uint64_t>(count);
  }
  const std::string folder = "/proc/irq/" + std::to_string(*number) + "/";
  facts.cpus = parse_cpu_list(tree.text(folder + "effective_affinity_list"));
  if (facts.cpus.empty()) facts.cpus = parse_cpu_list(tree.text(folder + "smp_affinity_list"));
  files.interrupts.push_back(std::move(facts));
}

void read_interrupts(const HostTree& tree, HostFiles& files) {
  const std::vector<std::string> lines = lines_of(tree.text("/proc/interrupts"));
  if (lines.empty()) return;
  std::vector<int> cpus;
  for (const std::string& head : words_of(lines.front())) {
    const auto cpu =
        head.starts_with("CPU") ? number_of(std::string_view(head).substr(3)) : std::nullopt;
    if (!cpu) return;
    cpus.push_back(static_cast<int>(*cpu));
  }
  for (std::size_t i = 1; i < lines.size(); ++i)
    read_interrupt(tree, lines[i], cpus, files);
}

bool runs(const HostTree& tree, std::string_view program) {
  for (const int id : tree.process_ids()) {
    if (tree.text("/proc/" + std::to_string(id) + "/comm") == program) return true;
  }
  return false;
}

std::uint64_t swap_kib(const HostTree& tree) {
  std::uint64_t size = 0;
  const std::vector<std::string> lines = lines_of(tree.text("/proc/swaps"));
  for (std::size_t i = 1; i < lines.size(); ++i) {
    const std::vector<std::string> words = words_of(lines[i]);
    if (words.size() > 2) size += static_cast<std::uint64_t>(number_of(words[2]).value_or(0));
  }
  return size;
}

/// The first number of "0.24 0.18 0.11 1/512 4242".
std::optional<double> load_in(const std::string& text) {
  double load = 0;
  const auto read = std::from_chars(text.data(), text.data() + text.size(), load);
  return read.ec == std::errc{} ? std::optional(load) : std::nullopt;
}

}  // namespace

std::string chosen_of(const std::string& text) {
  const std::size_t begin = text.find('[');
  const std::size_t end = text.find(']', begin);
  if (begin == std::string::npos || end == std::string::npos) return {};
  return text.substr(begin + 1, end - begin - 1);
}

HostFiles read_host(const std::string& root, const std::vector<int>& process_ids) {
  const HostTree tree(root);
  HostFiles files;
  files.is_realtime_kernel = tree.text("/sys/kernel/realtime") == "1";
  files.is_virtual_machine = is_virtual_machine(tree);
  files.container = container_of(tree);
  files.clock_source =
      tree.text("/sys/devices/system/clocksource/clocksource0/current_clocksource");
  read_frequencies(tree, files);
  read_idle_states(tree, files);
  files.online_cpus = parse_cpu_list(tree.text(kCpuFolder + "online"));
  files.isolated_cpus = united(parse_cpu_list(tree.text(kCpuFolder + "isolated")),
                               parse_cpu_list(tree.text("/sys/fs/cgroup/cpuset.cpus.isolated")));
  files.tickless_cpus = parse_cpu_list(tree.text(kCpuFolder + "nohz_full"));
  read_pinned_cpus(tree, process_ids, files);
  read_interrupts(tree, files);
  files.has_irqbalance = runs(tree, "irqbalance");
  files.load = load_in(tree.text("/proc/loadavg"));
  files.rmem_max = tree.number("/proc/sys/net/core/rmem_max");
  files.wmem_max = tree.number("/proc/sys/net/core/wmem_max");
  files.huge_pages = chosen_of(tree.text("/sys/kernel/mm/transparent_hugepage/enabled"));
  files.swap_kib = swap_kib(tree);
  return files;
}

}  // namespace rtpm::rt
