#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <string>

#include "rtpm/rt/survey.hpp"
#include "rtpm/test/child.hpp"
#include "rtpm/test/os.hpp"

// The judgements on a host's facts: each in every branch.
namespace rtpm::rt {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;

class Judgement : public testing::Test {
 protected:
  [[nodiscard]] Finding finding(const std::string& id) const {
    const std::vector<Finding> all = judge_host(files_, answers_);
    const auto found = std::ranges::find(all, id, &Finding::id);
    EXPECT_NE(found, all.end()) << id;
    return found == all.end() ? Finding{} : *found;
  }
  /// Every finding that is not good has a cost and a remedy.
  void expect_finding(const std::string& id, Severity severity, const std::string& text,
                      const std::string& remedy = "") const {
    const Finding found = finding(id);
    EXPECT_EQ(found.severity, severity) << id << ": " << found.text;
    EXPECT_NE(found.text.find(text), std::string::npos) << found.text;
    EXPECT_NE(found.remedy.find(remedy), std::string::npos) << found.remedy;
    EXPECT_EQ(found.remedy.empty(), remedy.empty()) << found.remedy;
    EXPECT_TRUE(severity <= Severity::kNote || !found.cost.empty()) << id;
    EXPECT_TRUE(severity != Severity::kGood || found.cost.empty()) << id;
    EXPECT_EQ(found.is_fixable(), !found.lasting.empty()) << id;
  }
  [[nodiscard]] static HostFiles good_files() {
    HostFiles files;
    files.is_realtime_kernel = true;
    files.clock_source = "tsc";
    files.online_cpus = {0, 1, 2, 3};
    files.isolated_cpus = {3};
    files.tickless_cpus = {3};
    files.rmem_max = 4 << 20;
    files.wmem_max = 4 << 20;
    files.load = 0.5;
    return files;
  }
  [[nodiscard]] static HostAnswers good_answers() {
    HostAnswers answers;
    answers.usable_cpu_count = 4;
    answers.timer_resolution = Duration{1};
    answers.timer_slack = microseconds{50};
    answers.is_clock_synchronised = true;
    answers.shared_memory_size = std::uint64_t{1} << 30;
    answers.shared_memory_free = std::uint64_t{1} << 30;
    return answers;
  }
  HostFiles files_ = good_files();
  HostAnswers answers_ = good_answers();
};

TEST_F(Judgement, FindsNoFaultOnAWellConfiguredHost) {
  std::set<std::string> ids;
  for (const Finding& found : judge_host(files_, answers_)) {
    EXPECT_EQ(found.severity, Severity::kGood) << found.id << ": " << found.text;
    EXPECT_EQ(found.remedy, "") << found.id;
    EXPECT_FALSE(found.is_fixable()) << found.id;
    EXPECT_TRUE(ids.insert(found.id).second) << found.id << " is there twice";
  }
}

TEST_F(Judgement, NamesTheLimitForRefusedRights) {
  answers_.realtime_refusal = SetupError{"thread 'x' can't run at SCHED_FIFO 89", "", "ask"};
  answers_.memory_lock_refusal = SetupError{"memory can't be locked (no; the limit is 64 KiB): y"};
  expect_finding("realtime", Severity::kProblem, "can't run at SCHED_FIFO 89",
                 "echo \"$USER - rtprio 90\" | sudo tee -a /etc/security/limits.d/90-rtpm.conf");
  expect_finding("memory-lock", Severity::kProblem, "the limit is 64 KiB)",
                 "$USER - memlock unlimited");
  answers_.is_group_without_realtime = true;
  expect_finding("realtime", Severity::kProblem, "", "ask");
}

TEST_F(Judgement, StatesHowLongThrottlingStopsThreads) {
  answers_.realtime_limit = {milliseconds{950}, milliseconds{1000}};
  expect_finding("throttling", Severity::kNote, "950 of 1000 ms", "kernel.sched_rt_runtime_us=-1");
  EXPECT_NE(finding("throttling").cost.find("for 50 ms of each 1000 ms"), std::string::npos);
  EXPECT_FALSE(finding("throttling").is_fixable()) << "a thread that hangs would hang the host";
}

TEST_F(Judgement, RatesTimerSlackByTheRightToRealTime) {
  answers_.timer_slack = milliseconds{5};
  expect_finding("timer-slack", Severity::kWarning, "5000 µs", "TimerSlackNSec=50us");
  answers_.timer_slack = microseconds{50};
  answers_.realtime_refusal = SetupError{"no"};
  expect_finding("timer-slack", Severity::kNote, "50 µs", "see realtime");
}

TEST_F(Judgement, RatesKernelAndMachine) {
  files_.is_realtime_kernel = false;
  files_.is_virtual_machine = true;
  expect_finding("kernel", Severity::kWarning, "not a real-time kernel", "linux-image-rt-amd64");
  expect_finding("machine", Severity::kNote, "virtual machine", "on the host itself");
}

TEST_F(Judgement, StatesTheSettingsThatAContainerNeeds) {
  files_.container = "docker";
  expect_finding("container", Severity::kNote, "(docker)",
                 "--cap-add SYS_NICE --ulimit rtprio=90 --ulimit memlock=-1 --network host");
}

TEST_F(Judgement, RatesTheLoadByTheCpus) {
  answers_.usable_cpu_count = 2;
  files_.load = 17;
  expect_finding("load", Severity::kWarning, "17.0 threads wanted a CPU", "top");
  answers_.usable_cpu_count = 32;
  expect_finding("load", Severity::kGood, "of 32");
  files_.load.reset();
  expect_finding("load", Severity::kNote, "does not tell");
}

TEST_F(Judgement, WarnsOfASingleCpu) {
  answers_.usable_cpu_count = 1;
  expect_finding("cpus", Severity::kWarning, "1 CPU is usable", "a second CPU");
}

TEST_F(Judgement, NamesACpuToIsolateIfThereAreEnough) {
  files_.isolated_cpus = {};
  expect_finding("isolation", Severity::kNote, "no CPU is kept free",
                 "isolcpus=managed_irq,domain,3 nohz_full=3");
  files_.online_cpus = {0, 1};
  expect_finding("isolation", Severity::kNote, "no CPU is kept free", "a machine with more CPUs");
  files_.isolated_cpus = {2, 3};
  expect_finding("isolation", Severity::kNote, "the timer's tick still interrupts CPU 2",
                 "nohz_full=2,3");
}

TEST_F(Judgement, CountsInterruptsThatLandOnReservedCpus) {
  files_.interrupts = {{36, "disk", {3}, {{3, 7}}},
                       {37, "eth0", {0, 3}, {{0, 9}}},  // It never interrupted CPU 3.
                       {38, "usb", {0}, {{3, 5}}}};     // It has moved away since.
  expect_finding("interrupts", Severity::kWarning, "1 interrupt lands on CPU 3: 36 (disk, 7 times)",
                 "echo 0-2 | sudo tee /proc/irq/36/smp_affinity_list");
  files_.isolated_cpus = {};
  expect_finding("interrupts", Severity::kGood, "no CPU is isolated");
  files_.pinned_cpus = {0};
  expect_finding("interrupts", Severity::kWarning, "1 interrupt lands on CPU 0: 37 (eth0, 9 times)",
                 "echo 1-3 | sudo tee /proc/irq/37/smp_affinity_list");
  files_.pinned_cpus = files_.online_cpus;
  expect_finding("interrupts", Severity::kWarning, "2 interrupts land on CPUs 0-3",
                 "confine lanes to fewer CPUs");
}

TEST_F(Judgement, NamesAFewOfManyInterrupts) {
  for (int number = 1; number <= 40; ++number)
    files_.interrupts.push_back({number, "queue", {3}, {{3, 1}}});
  expect_finding("interrupts", Severity::kWarning, "40 interrupts land on CPU 3", "/proc/irq/4/");
  EXPECT_EQ(finding("interrupts").remedy.find("/proc/irq/5/"), std::string::npos);
}

TEST_F(Judgement, AllowsIrqbalanceBesideIsolatedCpus) {
  files_.has_irqbalance = true;
  expect_finding("irqbalance", Severity::kGood, "leaves isolated CPUs alone");
  files_.pinned_cpus = {1};
  expect_finding("irqbalance", Severity::kWarning, "also to CPU 1",
                 "IRQBALANCE_BANNED_CPULIST=1,3");
  files_.pinned_cpus = files_.isolated_cpus = {};
  expect_finding("irqbalance", Severity::kGood, "no CPU is kept from it");
}

TEST_F(Judgement, FixesGovernorsBelowFullSpeed) {
  files_.frequencies = {{"/a", "performance"}, {"/b", "schedutil"}};
  expect_finding("frequency", Severity::kWarning, "1 of 2 CPUs is 'schedutil'",
                 "rtpm doctor --fix");
  EXPECT_EQ(finding("frequency").fixes, (std::vector<Setting>{{"/b", "performance"}}));
  files_.frequencies.pop_back();
  expect_finding("frequency", Severity::kGood, "'performance'");
}

TEST_F(Judgement, RatesTheDeepestEnabledIdleState) {
  files_.idle_driver = "intel_idle";
  files_.idle_states = {
      {"POLL", Duration{0}, true}, {"C1", microseconds{2}, true}, {"C6", microseconds{133}, false}};
  expect_finding("idle-states", Severity::kGood, "");
  files_.idle_states.back().is_enabled = true;
  expect_finding("idle-states", Severity::kNote, "as deep as C6", "--cpu-latency 0us");
  EXPECT_NE(finding("idle-states").cost.find("133 µs"), std::string::npos);
  answers_.cpu_latency_refusal = SetupError{"no"};
  expect_finding("idle-states", Severity::kWarning, "this user may not ask",
                 "KERNEL==\"cpu_dma_latency\"");
}

TEST_F(Judgement, RatesClocks) {
  files_.clock_source = "hpet";
  expect_finding("clock", Severity::kWarning, "'hpet' takes a system call", "dmesg");
  files_.clock_source = "";
  expect_finding("clock", Severity::kNote, "does not name");
  answers_.timer_resolution = milliseconds{4};
  expect_finding("timers", Severity::kProblem, "4000 µs", "highres=off");
  answers_.is_clock_synchronised = false;
  expect_finding("clock-sync", Severity::kNote, "no program keeps the clock", "chrony");
}

TEST_F(Judgement, FixesSocketBuffersThatAreTooSmall) {
  files_.rmem_max = 212992;
  expect_finding("socket-buffers", Severity::kWarning, "208 KiB to receive",
                 "sudo sysctl -w net.core.rmem_max=4194304");
  EXPECT_EQ(finding("socket-buffers").fixes,
            (std::vector<Setting>{{"/proc/sys/net/core/rmem_max", "4194304"}}));
  EXPECT_NE(finding("socket-buffers").lasting.find("/etc/sysctl.d/90-rtpm.conf"),
            std::string::npos);
  files_.wmem_max = 212992;
  EXPECT_EQ(finding("socket-buffers").fixes.size(), 2u);
  files_.wmem_max.reset();
  expect_finding("socket-buffers", Severity::kNote, "does not tell");
}

TEST_F(Judgement, RatesSharedMemoryBySizeAndFreeBytes) {
  answers_.shared_memory_free = 1 << 20;
  expect_finding("shared-memory", Severity::kWarning, "1024 MiB, 1 MiB of them free", "size=1g");
  answers_.shared_memory_size = 64 << 20;
  expect_finding("shared-memory", Severity::kWarning, "64 MiB", "--shm-size=1g");
  answers_.shared_memory_size.reset();
  expect_finding("shared-memory", Severity::kWarning, "there is no /dev/shm", "mount -t tmpfs");
}

TEST_F(Judgement, RatesHugePagesAndSwap) {
  files_.huge_pages = "madvise";
  expect_finding("huge-pages", Severity::kGood, "'madvise'");
  files_.huge_pages = "always";
  expect_finding("huge-pages", Severity::kWarning, "'always'", "rtpm doctor --fix");
  EXPECT_EQ(finding("huge-pages").fixes.at(0).value, "madvise");
  files_.swap_kib = 2048;
  expect_finding("swap", Severity::kGood, "2 MiB of it, which locked memory does not use");
  answers_.memory_lock_refusal = SetupError{"memory can't be locked"};
  expect_finding("swap", Severity::kWarning, "can't be locked", "swapoff -a");
}

TEST(Survey, ReportsProblemsWithoutTheRights) {
  if (test::kHasSanitizer) GTEST_SKIP() << test::kSanitizersLockNothing;
  const auto child = test::run_in_child([] {
    test::drop_realtime_rights();
    std::string text;
    for (const Finding& finding : survey_host())
      text += finding.id + "=" + std::string(to_string(finding.severity)) + ";";
    return text;
  });
  for (const char* id : {"realtime=problem", "memory-lock=problem"})
    EXPECT_NE(child.said.find(id), child.said.npos) << id << " is not in " << child.said;
}

}  // namespace
}  // namespace rtpm::rt
