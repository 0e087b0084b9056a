#include <windows.h>

#include <powrprof.h>

#include <algorithm>
#include <array>
#include <string>
#include <string_view>

#include "os/native_clock.hpp"
#include "rtpm/rt/host.hpp"
#include "rtpm/rt/memory.hpp"
#include "rtpm/rt/report.hpp"
#include "rtpm/rt/survey.hpp"
#include "rtpm/rt/thread.hpp"
#include "survey/judgements.hpp"
#include "thread_timer.hpp"
#include "windows_survey.hpp"

namespace rtpm::rt {
namespace {

constexpr const wchar_t* kMultimediaKey =
    L"SOFTWARE\\Microsoft\\Windows NT\\CurrentVersion\\Multimedia\\SystemProfile";

std::optional<std::uint32_t> registry_number(const wchar_t* key, const wchar_t* name) {
  DWORD value = 0;
  DWORD size = sizeof value;
  const LSTATUS status =
      RegGetValueW(HKEY_LOCAL_MACHINE, key, name, RRF_RT_REG_DWORD, nullptr, &value, &size);
  return status == ERROR_SUCCESS ? std::optional<std::uint32_t>(value) : std::nullopt;
}

std::wstring machine_text(const wchar_t* name) {
  std::array<wchar_t, 128> text{};
  DWORD size = sizeof text;
  const LSTATUS status = RegGetValueW(HKEY_LOCAL_MACHINE, L"HARDWARE\\DESCRIPTION\\System\\BIOS",
                                      name, RRF_RT_REG_SZ, nullptr, text.data(), &size);
  return status == ERROR_SUCCESS ? text.data() : L"";
}

// By name: the processor also shows a hypervisor on a machine that only protects itself by one.
bool is_virtual_machine() {
  const std::wstring names =
      machine_text(L"SystemManufacturer") + L" " + machine_text(L"SystemProductName");
  constexpr std::array<std::wstring_view, 5> kSigns{L"Virtual", L"VMware", L"QEMU", L"KVM", L"Xen"};
  return std::ranges::any_of(kSigns, [&](auto sign) { return names.find(sign) != names.npos; });
}

PowerScheme power_scheme() {
  constexpr GUID kHighPerformance{
      0x8c5e7fda, 0xe8bf, 0x4a96, {0x9a, 0x85, 0xa6, 0xe2, 0x3a, 0x8c, 0x63, 0x5c}};
  constexpr GUID kUltimatePerformance{
      0xe9a42b02, 0xd5df, 0x448d, {0xaa, 0x00, 0x03, 0xf1, 0x47, 0x49, 0xeb, 0x61}};
  GUID* active = nullptr;
  if (PowerGetActiveScheme(nullptr, &active) != ERROR_SUCCESS || active == nullptr)
    return PowerScheme::kUnknown;
  const bool is_quick = IsEqualGUID(*active, kHighPerformance) != 0 ||
                        IsEqualGUID(*active, kUltimatePerformance) != 0;
  LocalFree(active);
  return is_quick ? PowerScheme::kPerformance : PowerScheme::kOther;
}

// Whether one is on for any kind of network. Windows comes with all of them on.
bool has_firewall() {
  const std::wstring policy =
      L"SYSTEM\\CurrentControlSet\\Services\\SharedAccess\\Parameters\\FirewallPolicy\\";
  return std::ranges::any_of(std::array{L"Domain", L"Public", L"Standard"}, [&](auto kind) {
    const std::wstring key = policy + kind + L"Profile";
    return registry_number(key.c_str(), L"EnableFirewall") == 1u;
  });
}

std::uint32_t sleeps_after_s() {
  SYSTEM_POWER_POLICY policy{};
  const auto status =
      CallNtPowerInformation(SystemPowerPolicyAc, nullptr, 0, &policy, sizeof policy);
  return status == 0 && policy.Idle.Action == PowerActionSleep ? policy.IdleTimeout : 0;
}

std::uint64_t free_commit() {
  MEMORYSTATUSEX memory{};
  memory.dwLength = sizeof memory;
  return GlobalMemoryStatusEx(&memory) != 0 ? memory.ullAvailPageFile : 0;
}

bool runs_service(const wchar_t* name) {
  const SC_HANDLE manager = OpenSCManagerW(nullptr, nullptr, SC_MANAGER_CONNECT);
  if (manager == nullptr) return false;
  bool is_running = false;
  if (const SC_HANDLE service = OpenServiceW(manager, name, SERVICE_QUERY_STATUS);
      service != nullptr) {
    SERVICE_STATUS status{};
    is_running =
        QueryServiceStatus(service, &status) != 0 && status.dwCurrentState == SERVICE_RUNNING;
    CloseServiceHandle(service);
  }
  CloseServiceHandle(manager);
  return is_running;
}

Finding judge_realtime(const WindowsFacts& facts) {
  if (!facts.realtime_refusal) {
    return {"realtime", Severity::kGood, "threads may run as 'Pro Audio' of MMCSS, up to critical"};
  }
  return {"realtime", Severity::kWarning, facts.realtime_refusal->what,
          "threads of the system and of other programs' sound delay an urgent call, by some ms",
          facts.realtime_refusal->remedy};
}

Finding judge_memory(const WindowsFacts& facts) {
  if (!facts.memory_lock_refusal) return {"memory-lock", Severity::kGood, facts.memory_lock};
  return {"memory-lock", Severity::kProblem, facts.memory_lock_refusal->what,
          "a page that the system took away costs a real-time thread some µs, from a disk some ms",
          facts.memory_lock_refusal->remedy};
}

std::string registry_line(const char* name, const char* value) {
  return std::string(
             "as an administrator, then restart:\nreg add \"HKLM\\SOFTWARE\\Microsoft\\"
             "Windows NT\\CurrentVersion\\Multimedia\\SystemProfile\" /v ") +
         name + " /t REG_DWORD /d " + value + " /f";
}

Finding judge_throttling(const WindowsFacts& facts) {
  const std::string text =
      "MMCSS leaves " + std::to_string(facts.responsiveness) + " % of each CPU to other work";
  constexpr std::uint32_t kLeast = 10;
  if (facts.responsiveness <= kLeast) return {"throttling", Severity::kGood, text};
  return {"throttling", Severity::kNote, text,
          "an urgent thread that never sleeps is lowered for that part of each 10 ms",
          registry_line("SystemResponsiveness", "10")};
}

Finding judge_packets(const WindowsFacts& facts) {
  if (!facts.packets_per_ms) {
    return {"network-throttling", Severity::kGood, "MMCSS does not slow the network down"};
  }
  return {"network-throttling", Severity::kNote,
          "while MMCSS has threads, the system takes " + std::to_string(*facts.packets_per_ms) +
              " packets a millisecond from the network",
          "further ones wait, for up to some ms: a flood delays calls from other hosts",
          registry_line("NetworkThrottlingIndex", "0xffffffff")};
}

Finding judge_machine(const WindowsFacts& facts) {
  HostFiles files;
  files.is_virtual_machine = facts.is_virtual_machine;
  return rt::judge_machine(files);
}

Finding judge_cpu_count(const WindowsFacts& facts) {
  if (facts.usable_cpu_count > 1) {
    return {"cpus", Severity::kGood, std::to_string(facts.usable_cpu_count) + " CPUs are usable"};
  }
  return {"cpus", Severity::kWarning, "1 CPU is usable",
          "nothing can spin, so each wait blocks: some 10 µs more for each call",
          "give the process a second CPU (Task Manager: Details, Set affinity)"};
}

Finding judge_power(const WindowsFacts& facts) {
  if (facts.power == PowerScheme::kPerformance) {
    return {"power", Severity::kGood, "the power plan is that of high performance"};
  }
  if (facts.power == PowerScheme::kUnknown) {
    return {"power", Severity::kNote, "the system does not tell its power plan"};
  }
  return {
      "power", Severity::kWarning, "the power plan saves energy",
      "a CPU that was idle begins at a fraction of its speed: calls take up to several times as "
      "long for some ms",
      "powercfg /setactive SCHEME_MIN"};
}

Finding judge_counter(const WindowsFacts& facts) {
  constexpr std::int64_t kOfProcessor = 10'000'000;
  const std::string text =
      "the performance counter has " + std::to_string(facts.clock_frequency) + " Hz";
  if (facts.clock_frequency >= kOfProcessor && facts.clock_frequency % kOfProcessor == 0)
    return {"clock", Severity::kGood, text + ", that of the processor"};
  return {"clock", Severity::kWarning, text + ", that of another timer",
          "reading it takes about 1 µs, several times a call",
          "as an administrator, then restart: bcdedit /deletevalue useplatformclock"};
}

Finding judge_timers(const WindowsFacts& facts) {
  if (facts.has_fine_timers) {
    return {"timers", Severity::kGood, "timers have steps of about 0.5 ms"};
  }
  return {"timers", Severity::kProblem, "timers have steps of up to 15.6 ms",
          "each period and each deadline is that coarse, so 1 kHz is not kept",
          "use Windows 10, version 1803, or a later one"};
}

Finding judge_synchronisation(const WindowsFacts& facts) {
  if (facts.is_clock_synchronised) {
    return {"clock-sync", Severity::kGood, "the service W32Time keeps the clock to a reference"};
  }
  return {"clock-sync", Severity::kNote, "no service keeps the clock to a reference",
          "recordings of several hosts are apart by the difference of their clocks, which grows by "
          "some s a day; calls and deadlines are not affected",
          "as an administrator: sc start w32time"};
}

Finding judge_firewall(const WindowsFacts& facts) {
  if (!facts.has_firewall) return {"firewall", Severity::kGood, "Windows' firewall is off"};
  return {"firewall", Severity::kNote, "Windows' firewall is on",
          "callers of other hosts get no answer from a program that it does not pass",
          "as an administrator, for each server: netsh advfirewall firewall add rule name=RTPM "
          "dir=in action=allow program=C:\\rtpm\\bin\\rtpm-deviced.exe"};
}

Finding judge_sleep(const WindowsFacts& facts) {
  if (facts.sleeps_after_s == 0) {
    return {"sleep", Severity::kGood, "the machine does not sleep by itself"};
  }
  return {"sleep", Severity::kWarning,
          "the machine sleeps when nobody has used it for " +
              std::to_string(facts.sleeps_after_s / 60) + " min",
          "its servers then answer nobody: calls fail, and names and leases lapse",
          "powercfg /change standby-timeout-ac 0"};
}

Finding judge_commit(const WindowsFacts& facts) {
  constexpr std::uint64_t kMebibyte = 1024 * 1024;
  constexpr std::uint64_t kEnough = 512 * kMebibyte;
  const std::string text =
      std::to_string(facts.free_commit / kMebibyte) + " MiB are left for programs to ask for";
  if (facts.free_commit >= kEnough) return {"memory", Severity::kGood, text};
  return {"memory", Severity::kProblem, text,
          "a server that finds none when it starts, or for a large message, refuses",
          "end programs, or enlarge the page file (sysdm.cpl: Advanced, Performance)"};
}

}  // namespace

WindowsFacts read_windows() {
  WindowsFacts facts;
  const auto thread = Thread::start({.name = "rtpm-survey",
                                     .priority = Priority{Priority::kHighest},
                                     .realtime = RealtimeMode::kRequire},
                                    [] {});
  if (!thread) facts.realtime_refusal = thread.error();
  if (auto locked = lock_memory(RealtimeMode::kRequire); !locked) {
    facts.memory_lock_refusal = locked.error();
  }
  for (const SetupNote& note : setup_report()) {
    if (note.subject == "memory lock") facts.memory_lock = note.text;
  }
  constexpr std::uint32_t kNoLimit = 0xffff'ffff;
  facts.responsiveness =
      registry_number(kMultimediaKey, L"SystemResponsiveness").value_or(facts.responsiveness);
  const auto packets = registry_number(kMultimediaKey, L"NetworkThrottlingIndex");
  if (packets) {
    facts.packets_per_ms =
        *packets == kNoLimit ? std::nullopt : std::optional<std::uint32_t>(*packets);
  }
  facts.is_virtual_machine = is_virtual_machine();
  facts.usable_cpu_count = usable_cpu_count();
  facts.power = power_scheme();
  LARGE_INTEGER frequency{};
  QueryPerformanceFrequency(&frequency);
  facts.clock_frequency = frequency.QuadPart;
  facts.has_fine_timers = os::has_fine_timers();
  facts.is_clock_synchronised = runs_service(L"W32Time");
  facts.has_firewall = has_firewall();
  facts.sleeps_after_s = sleeps_after_s();
  facts.free_commit = free_commit();
  return facts;
}

std::vector<Finding> judge_windows(const WindowsFacts& facts) {
  return {judge_realtime(facts),        judge_memory(facts),   judge_throttling(facts),
          judge_packets(facts),         judge_machine(facts),  judge_cpu_count(facts),
          judge_power(facts),           judge_counter(facts),  judge_timers(facts),
          judge_synchronisation(facts), judge_firewall(facts), judge_sleep(facts),
          judge_commit(facts)};
}

// Other processes' threads are not looked at.
std::vector<Finding> survey_host(const std::vector<int>&) {
  return judge_windows(read_windows());
}

}  // namespace rtpm::rt
