#include <gtest/gtest.h>

#include "fake_host.hpp"
#include "rtpm/rt/survey.hpp"
#include "survey/host_tree.hpp"

// Facts from a host's files, some of which the tests make up.
namespace rtpm::rt {
namespace {

using Cpus = std::vector<int>;

class HostFilesTest : public testing::Test {
 protected:
  [[nodiscard]] HostFiles read(const std::vector<int>& process_ids = {}) const {
    return read_host(host_.root(), process_ids);
  }
  void put_thread(const std::string& thread, const std::string& policy,
                  const std::string& cpus) const {
    // The name contains characters that may mislead a parser; the policy is field 41.
    std::string stat = "7 (a) b (c) S";
    for (int field = 4; field <= 40; ++field)
      stat += " 0";
    host_.put("/proc/" + thread + "/stat", stat + " " + policy + " 0 0");
    host_.put("/proc/" + thread + "/status", "Name:\tx\nCpus_allowed_list:\t" + cpus);
  }
  FakeHost host_;
};

TEST(CpuLists, AreReadAndWrittenAsTheKernelDoes) {
  EXPECT_EQ(parse_cpu_list("0-2,5,7-7"), (Cpus{0, 1, 2, 5, 7}));
  EXPECT_EQ(parse_cpu_list(""), Cpus{});
  EXPECT_EQ(parse_cpu_list("x,3,4-,-1,5-4,1-99999999"), Cpus{3});
  EXPECT_EQ(cpu_list_text({0, 1, 2, 5, 7, 8}), "0-2,5,7,8");
  EXPECT_EQ(cpu_list_text({}), "");
}

TEST_F(HostFilesTest, AreEmptyForAnEmptyHost) {
  const HostFiles files = read({1});
  EXPECT_FALSE(files.is_realtime_kernel);
  EXPECT_FALSE(files.is_virtual_machine);
  EXPECT_EQ(files.clock_source, "");
  EXPECT_TRUE(files.frequencies.empty());
  EXPECT_TRUE(files.idle_states.empty());
  EXPECT_TRUE(files.interrupts.empty());
  EXPECT_FALSE(files.rmem_max);
  EXPECT_EQ(files.swap_kib, 0u);
  EXPECT_FALSE(files.load);
}

TEST_F(HostFilesTest, ReportTheKindOfContainer) {
  EXPECT_EQ(read().container, "");
  using namespace std::string_literals;
  host_.put("/proc/1/environ", "PATH=/bin\0container=lxc\0TERM=dumb"s);
  EXPECT_EQ(read().container, "lxc");
  host_.put("/run/.containerenv", "");
  EXPECT_EQ(read().container, "podman");
  host_.put("/.dockerenv", "");
  EXPECT_EQ(read().container, "docker");
  host_.put("/run/systemd/container", "systemd-nspawn");
  EXPECT_EQ(read().container, "systemd-nspawn");
}

TEST_F(HostFilesTest, ReportKernelMachineClockAndMemory) {
  host_.put("/sys/kernel/realtime", "1");
  host_.put("/proc/cpuinfo", "processor : 0\nflags : fpu hypervisor\nflags : fpu");
  host_.put("/sys/devices/system/clocksource/clocksource0/current_clocksource", "hpet");
  host_.put("/proc/sys/net/core/rmem_max", "212992");
  host_.put("/proc/sys/net/core/wmem_max", "4194304");
  host_.put("/sys/kernel/mm/transparent_hugepage/enabled", "[always] madvise never");
  host_.put("/proc/loadavg", "17.25 9.10 3.00 21/512 4242");
  host_.put("/proc/swaps",
            "Filename Type Size Used Priority\n/dev/sda2 partition 2048 0 -2\n"
            "/swap file 1024 0 -3");
  const HostFiles files = read();
  EXPECT_TRUE(files.is_realtime_kernel);
  EXPECT_TRUE(files.is_virtual_machine);
  EXPECT_EQ(files.clock_source, "hpet");
  EXPECT_EQ(files.rmem_max, 212992);
  EXPECT_EQ(files.wmem_max, 4194304);
  EXPECT_EQ(files.huge_pages, "always");
  EXPECT_EQ(files.swap_kib, 3072u);
  EXPECT_EQ(files.load, 17.25);
}

TEST_F(HostFilesTest, ReportTheGovernorOfEachCpu) {
  const std::string folder = "/sys/devices/system/cpu/";
  host_.put(folder + "cpu0/cpufreq/scaling_governor", "powersave");
  host_.put(folder + "cpu10/cpufreq/scaling_governor", "performance");
  host_.put(folder + "cpu2/cpufreq/scaling_governor", "performance");
  host_.put(folder + "cpufreq/policy0/scaling_governor", "powersave");
  const HostFiles files = read();
  ASSERT_EQ(files.frequencies.size(), 3u);
  EXPECT_EQ(files.frequencies[0].governor, "powersave");
  EXPECT_TRUE(files.frequencies[2].path.ends_with("/cpu10/cpufreq/scaling_governor"));
}

TEST_F(HostFilesTest, ReportEachIdleStateOnceAndWhetherACpuUsesIt) {
  const std::string folder = "/sys/devices/system/cpu/";
  host_.put(folder + "cpuidle/current_driver", "intel_idle");
  for (const char* cpu : {"cpu0", "cpu1"}) {
    const std::string state = folder + cpu + "/cpuidle/state1/";
    host_.put(state + "name", "C6");
    host_.put(state + "latency", "133");
    host_.put(state + "disable", cpu == std::string("cpu0") ? "1" : "0");
  }
  const HostFiles files = read();
  EXPECT_EQ(files.idle_driver, "intel_idle");
  ASSERT_EQ(files.idle_states.size(), 1u);
  EXPECT_EQ(files.idle_states[0].wake_time, std::chrono::microseconds{133});
  EXPECT_TRUE(files.idle_states[0].is_enabled);
  host_.put(folder + "cpuidle/current_driver", "none");
  EXPECT_EQ(read().idle_driver, "");
}

TEST_F(HostFilesTest, ReportIsolatedCpusOfCommandLineAndCpusets) {
  host_.put("/sys/devices/system/cpu/online", "0-7");
  host_.put("/sys/devices/system/cpu/isolated", "6");
  host_.put("/sys/devices/system/cpu/nohz_full", "6-7");
  host_.put("/sys/fs/cgroup/cpuset.cpus.isolated", "7");
  const HostFiles files = read();
  EXPECT_EQ(files.isolated_cpus, (Cpus{6, 7}));
  EXPECT_EQ(files.tickless_cpus, (Cpus{6, 7}));
  EXPECT_EQ(files.online_cpus.size(), 8u);
}

TEST_F(HostFilesTest, CountConfinedRealtimeThreadsAsPinned) {
  host_.put("/sys/devices/system/cpu/online", "0-3");
  put_thread("40/task/41", "1", "2");    // SCHED_FIFO, confined.
  put_thread("40/task/42", "1", "0-3");  // Anywhere.
  put_thread("40/task/43", "0", "1");    // Time-shared.
  put_thread("50/task/51", "1", "3");    // Another process.
  EXPECT_EQ(read({40}).pinned_cpus, Cpus{2});
  EXPECT_EQ(read({40, 50, 60}).pinned_cpus, (Cpus{2, 3}));
}

TEST_F(HostFilesTest, ReportInterruptsByCpuAndTheirAffinity) {
  host_.put("/proc/interrupts",
            "           CPU0       CPU2\n"
            " 36:          0      45573 PCI-MSIX-0000:00:02.0   1-edge      virtio1-req.0\n"
            " 37:          5          0 PCI-MSIX-0000:00:03.0   0-edge      eth0\n"
            "LOC:      89613      90831   Local timer interrupts\n"
            "ERR:          0");
  host_.put("/proc/irq/36/effective_affinity_list", "2");
  host_.put("/proc/irq/36/smp_affinity_list", "0-2");
  host_.put("/proc/irq/37/smp_affinity_list", "0,2");
  const HostFiles files = read();
  ASSERT_EQ(files.interrupts.size(), 2u);
  EXPECT_EQ(files.interrupts[0].name, "virtio1-req.0");
  EXPECT_EQ(files.interrupts[0].cpus, Cpus{2});
  EXPECT_EQ(files.interrupts[0].counts.at(2), 45573u);
  EXPECT_FALSE(files.interrupts[0].counts.contains(0));
  EXPECT_EQ(files.interrupts[1].cpus, (Cpus{0, 2}));
  host_.put("/proc/interrupts", "what is no table\n1: 2");
  EXPECT_TRUE(read().interrupts.empty());
}

TEST_F(HostFilesTest, ReportWhetherIrqbalanceRuns) {
  host_.put("/proc/12/comm", "irqbalance-ui");
  EXPECT_FALSE(read().has_irqbalance);
  host_.put("/proc/13/comm", "irqbalance");
  EXPECT_TRUE(read().has_irqbalance);
}

TEST_F(HostFilesTest, AreChangedByASettingAndReadBack) {
  const std::string file = host_.root() + "/value";
  host_.put("/value", "212992");
  const Setting setting{file, "4194304"};
  const auto dry = apply(setting, true);
  ASSERT_TRUE(dry);
  EXPECT_EQ(dry->from, "212992");
  EXPECT_EQ(dry->problem, "");
  EXPECT_EQ(HostTree("").text(file), "212992") << "nothing is written";
  const auto done = apply(setting, false);
  ASSERT_TRUE(done);
  EXPECT_EQ(done->problem, "");
  EXPECT_EQ(HostTree("").text(file), "4194304");
  const auto absent = apply({host_.root() + "/none", "1"}, false);
  ASSERT_TRUE(absent);
  EXPECT_NE(absent->problem, "");
}

TEST_F(HostFilesTest, AreUnchangedIfTheyHoldTheValue) {
  host_.put("/value", "always [madvise] never");
  EXPECT_FALSE(apply({host_.root() + "/value", "madvise"}, false));
}

TEST_F(HostFilesTest, RefuseChangesByAnOrdinaryUser) {
  if (geteuid() == 0) GTEST_SKIP() << "needs a user other than root";
  const auto change = apply({"/proc/sys/net/core/rmem_max", "4194305"}, false);
  ASSERT_TRUE(change);
  EXPECT_NE(change->problem.find("needs root"), std::string::npos) << change->problem;
}

TEST_F(HostFilesTest, ReportAValueThatTheSystemKeeps) {
  const auto change = apply({"/dev/null", "never"}, false);
  ASSERT_TRUE(change);
  EXPECT_NE(change->problem.find("the system keeps"), std::string::npos) << change->problem;
}

}  // namespace
}  // namespace rtpm::rt
