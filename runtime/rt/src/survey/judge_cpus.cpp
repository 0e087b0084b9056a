#include <algorithm>
#include <array>
#include <cstdio>
#include <string>

#include "survey/host_tree.hpp"
#include "survey/judgements.hpp"

// Judges whether the CPUs are free, awake and undisturbed when a real-time thread needs one.
namespace rtpm::rt {
namespace {

std::string us_text(Duration time) {
  return std::to_string(std::chrono::duration_cast<std::chrono::microseconds>(time).count()) +
         " µs";
}

/// The CPUs reserved for real-time threads.
std::vector<int> kept_cpus(const HostFiles& files) {
  return united(files.isolated_cpus, files.pinned_cpus);
}

std::string cpus_text(const std::vector<int>& cpus) {
  return (cpus.size() == 1 ? "CPU " : "CPUs ") + cpu_list_text(cpus);
}

/// The other CPUs, for all other work.
std::vector<int> other_cpus(const HostFiles& files) {
  return without(files.online_cpus, kept_cpus(files));
}

}  // namespace

Finding judge_kernel(const HostFiles& files) {
  if (files.is_realtime_kernel) {
    return {"kernel", Severity::kGood, "it is a real-time kernel (PREEMPT_RT)"};
  }
  return {"kernel", Severity::kWarning, "it is not a real-time kernel (PREEMPT_RT)",
          "its own work, of drivers and network, delays real-time threads: mostly by some 10 µs, "
          "at times by ms",
          "where the longest delay matters, start such a kernel:\n"
          "sudo apt-get install linux-image-rt-amd64"};
}

Finding judge_machine(const HostFiles& files) {
  if (!files.is_virtual_machine) {
    return {"machine", Severity::kGood, "no hypervisor shows"};
  }
  return {"machine", Severity::kNote, "it is a virtual machine",
          "its host takes a CPU away for some ms at any time, and nothing in here bounds that",
          "run what is urgent on the host itself, or give each virtual CPU a CPU of its own there"};
}

Finding judge_container(const HostFiles& files) {
  if (files.container.empty()) return {"container", Severity::kGood, "no container shows"};
  return {"container", Severity::kNote, "it is a container (" + files.container + ")",
          "it grants real-time threads, locked memory, shared memory and devices by its own "
          "settings; behind a network of its own, calls take some 10 µs more and no other host is "
          "discovered",
          "docker run --cap-add SYS_NICE --ulimit rtprio=90 --ulimit memlock=-1 --network host "
          "--shm-size 1g, with --device for each device"};
}

Finding judge_cpus(const HostAnswers& answers) {
  if (answers.usable_cpu_count > 1) {
    return {"cpus", Severity::kGood, std::to_string(answers.usable_cpu_count) + " CPUs are usable"};
  }
  return {"cpus", Severity::kWarning, "1 CPU is usable",
          "nothing can spin, so each wait blocks: some 10 µs more for each call",
          "give the process a second CPU (taskset, docker run --cpuset-cpus)"};
}

Finding judge_load(const HostFiles& files, const HostAnswers& answers) {
  if (!files.load) return {"load", Severity::kNote, "the system does not tell its load"};
  const int count = answers.usable_cpu_count;
  std::array<char, 64> text{};
  std::snprintf(text.data(), text.size(), "%.1f threads wanted a CPU in the last minute, of %d",
                *files.load, count);
  if (*files.load <= count) return {"load", Severity::kGood, text.data()};
  return {"load", Severity::kWarning, text.data(),
          "what is not real-time waits for its turn: services, names and displays by some ms to "
          "some 100 ms, and so do real-time threads where the system refuses them that",
          "end other work, see it by: top"};
}

Finding judge_isolation(const HostFiles& files) {
  if (files.isolated_cpus.empty()) {
    const bool has_some = files.online_cpus.size() > 2;
    return {"isolation", Severity::kNote, "no CPU is kept free of other work",
            "an urgent thread shares caches and kernel threads with all programs: some 10 µs at "
            "times",
            has_some ? "add to the kernel's command line, for the last CPU: isolcpus=managed_irq,"
                       "domain," +
                           std::to_string(files.online_cpus.back()) +
                           " nohz_full=" + std::to_string(files.online_cpus.back()) +
                           "\nthen name it to the lane: --lane-haptic-cpus " +
                           std::to_string(files.online_cpus.back())
                     : "isolate one on a machine with more CPUs"};
  }
  const std::string text = cpus_text(files.isolated_cpus) + " are kept free of other work";
  const std::vector<int> ticking = without(files.isolated_cpus, files.tickless_cpus);
  if (!ticking.empty()) {
    return {"isolation", Severity::kNote,
            text + "; the timer's tick still interrupts " + cpus_text(ticking),
            "some µs, 100 to 1000 times a second",
            "add to the kernel's command line: nohz_full=" + cpu_list_text(files.isolated_cpus)};
  }
  return {"isolation", Severity::kGood, text + ", and of the timer's tick"};
}

Finding judge_interrupts(const HostFiles& files) {
  const std::vector<int> kept = kept_cpus(files);
  if (kept.empty()) {
    return {"interrupts", Severity::kGood,
            "no CPU is isolated or has a lane of its own to disturb"};
  }
  constexpr std::size_t kShownMax = 4;
  std::string names;
  std::string commands;
  std::size_t count = 0;
  for (const InterruptFacts& interrupt : files.interrupts) {
    std::uint64_t handled_count = 0;
    for (const int cpu : common(interrupt.cpus, kept)) {
      const auto handled = interrupt.counts.find(cpu);
      if (handled != interrupt.counts.end()) handled_count += handled->second;
    }
    if (handled_count == 0 || ++count > kShownMax) continue;
    const std::string number = std::to_string(interrupt.number);
    names += (names.empty() ? "" : ", ") + number + " (" + interrupt.name + ", " +
             std::to_string(handled_count) + " times)";
    commands += "echo " + cpu_list_text(other_cpus(files)) + " | sudo tee /proc/irq/" + number +
                "/smp_affinity_list\n";
  }
  if (count == 0) {
    return {"interrupts", Severity::kGood, "no device interrupts " + cpus_text(kept)};
  }
  if (commands.ends_with('\n')) commands.pop_back();
  const bool has_others = !other_cpus(files).empty();
  return {"interrupts", Severity::kWarning,
          std::to_string(count) + (count == 1 ? " interrupt lands" : " interrupts land") + " on " +
              cpus_text(kept) + ": " + names + (count > kShownMax ? ", …" : ""),
          "each takes the CPU from an urgent thread for some µs to some 10 µs",
          has_others ? commands : "leave a CPU to the interrupts: confine lanes to fewer CPUs"};
}

Finding judge_irqbalance(const HostFiles& files) {
  if (!files.has_irqbalance) return {"irqbalance", Severity::kGood, "irqbalance does not run"};
  const std::vector<int> kept = kept_cpus(files);
  if (without(kept, files.isolated_cpus).empty()) {
    return {"irqbalance", Severity::kGood,
            kept.empty() ? "irqbalance runs, and no CPU is kept from it"
                         : "irqbalance runs, and leaves isolated CPUs alone"};
  }
  return {"irqbalance", Severity::kWarning,
          "irqbalance moves interrupts, also to " + cpus_text(without(kept, files.isolated_cpus)),
          "an interrupt that was moved away from a lane's CPU comes back within 10 s",
          "echo 'IRQBALANCE_BANNED_CPULIST=" + cpu_list_text(kept) +
              "' | sudo tee -a /etc/default/irqbalance\nsudo systemctl restart irqbalance"};
}

Finding judge_frequency(const HostFiles& files) {
  if (files.frequencies.empty()) {
    return {"frequency", Severity::kGood, "the system does not change that of the CPUs"};
  }
  Finding finding{"frequency", Severity::kWarning, "", "", ""};
  std::string governor;
  for (const FrequencyFacts& facts : files.frequencies) {
    if (facts.governor == "performance") continue;
    governor = facts.governor;
    finding.fixes.push_back({facts.path, "performance"});
  }
  if (finding.fixes.empty()) {
    return {"frequency", Severity::kGood, "the governor of all CPUs is 'performance'"};
  }
  finding.text = "the governor of " + std::to_string(finding.fixes.size()) + " of " +
                 std::to_string(files.frequencies.size()) + " CPUs is '" + governor + "'";
  finding.cost =
      "a CPU that was idle begins at a fraction of its speed: calls take up to several "
      "times as long for some ms";
  finding.remedy =
      "rtpm doctor --fix, or:\necho performance | sudo tee "
      "/sys/devices/system/cpu/cpu*/cpufreq/scaling_governor";
  finding.lasting =
      "echo 'w /sys/devices/system/cpu/cpu*/cpufreq/scaling_governor - - - - "
      "performance' | sudo tee /etc/tmpfiles.d/rtpm-governor.conf";
  return finding;
}

Finding judge_idle_states(const HostFiles& files, const HostAnswers& answers) {
  IdleStateFacts deepest;
  for (const IdleStateFacts& state : files.idle_states) {
    if (state.is_enabled && state.wake_time >= deepest.wake_time) deepest = state;
  }
  constexpr Duration kWakeTimeMax = std::chrono::microseconds{10};
  if (files.idle_driver.empty() || deepest.wake_time <= kWakeTimeMax) {
    return {"idle-states", Severity::kGood, "no CPU sleeps so deep that it wakes late"};
  }
  const std::string text =
      "'" + files.idle_driver + "' lets idle CPUs sleep as deep as " + deepest.name;
  const std::string cost =
      "a call that wakes a CPU comes up to " + us_text(deepest.wake_time) + " later";
  if (answers.cpu_latency_refusal) {
    return {"idle-states", Severity::kWarning,
            text + ", and this user may not ask for less (/dev/cpu_dma_latency)", cost,
            "echo 'KERNEL==\"cpu_dma_latency\", GROUP=\"users\", MODE=\"0660\"' | sudo tee "
            "/etc/udev/rules.d/90-rtpm-latency.rules\n"
            "sudo udevadm control --reload && sudo udevadm trigger /dev/cpu_dma_latency\n"
            "then run servers with --cpu-latency 0us"};
  }
  return {"idle-states", Severity::kNote, text + " unless a server asks for less", cost,
          "run servers with --cpu-latency 0us"};
}

}  // namespace rtpm::rt
