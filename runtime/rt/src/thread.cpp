#include "rtpm/rt/thread.hpp"

#include <sched.h>
#include <sys/resource.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <memory>
#include <semaphore>
#include <utility>

#include "native_level.hpp"
#include "rtpm/base/assert.hpp"
#include "rtpm/rt/priority.hpp"
#include "rtpm/rt/report.hpp"
#include "setup_text.hpp"

namespace rtpm::rt {
namespace {

#if defined(__SANITIZE_THREAD__)
// ThreadSanitizer keeps half a megabyte of per-thread state at the end of the stack.
constexpr std::size_t kStackSize = std::size_t{4096} * 1024;
#else
constexpr std::size_t kStackSize = std::size_t{512} * 1024;
#endif
// The part of the stack that is made resident before a thread starts: more than RTPM's code needs.
constexpr std::size_t kStackPrefaultSize = std::size_t{128} * 1024;

// Memory is locked when touched, so the stack is touched before it matters.
[[gnu::noinline]] void prefault_stack() noexcept {
  std::array<volatile std::byte, kStackPrefaultSize> stack;
  constexpr std::size_t kPageSize = 4096;
  for (std::size_t i = 0; i < stack.size(); i += kPageSize)
    stack[i] = std::byte{0};
}

std::string subject_of(const ThreadConfig& config) {
  return "thread '" + config.name + "'";
}

SetupError scheduling_refusal(const ThreadConfig& config, int level, int error) {
  rlimit limit{};
  getrlimit(RLIMIT_RTPRIO, &limit);
  const std::error_code cause = system_error(error);
  return {subject_of(config) + " can't run at SCHED_FIFO " + std::to_string(level) + " (" +
              cause.message() + "; the limit is " + std::to_string(limit.rlim_cur) + ")",
          "its latency is not bounded",
          is_group_without_realtime()
              ? "give the control group of this process (see: /proc/self/cgroup) some "
                "cpu.rt_runtime_us, or start it in the root group; or say --realtime off."
              : "give the user the right (a line '<user> - rtprio 90' in "
                "/etc/security/limits.conf, LimitRTPRIO=90 in a systemd unit, or CAP_SYS_NICE), or "
                "say --realtime off.",
          cause};
}

// Reports the thread's CPUs and scheduling.
void note_scheduling(const ThreadConfig& config, Grant grant, const std::string& how,
                     const std::string& remedy) {
  std::string text = how;
  for (const int cpu : config.cpus)
    text += (cpu == config.cpus.front() ? ", on CPU " : ",") + std::to_string(cpu);
  note_setup({subject_of(config), grant, text, remedy});
}

void warn_once(const std::string& text) {
  static std::atomic<bool> is_told{false};
  if (!is_told.exchange(true)) std::fprintf(stderr, "rtpm: warning: %s\n", text.c_str());
}

expected<void, SetupError> set_affinity(const ThreadConfig& config) {
  if (config.cpus.empty()) return {};
  cpu_set_t cpus;
  CPU_ZERO(&cpus);
  bool is_possible = true;
  std::string list;
  for (const int cpu : config.cpus) {
    if (cpu >= 0 && cpu < CPU_SETSIZE) {
      CPU_SET(static_cast<std::size_t>(cpu), &cpus);
    } else {
      is_possible = false;
    }
    if (!list.empty()) list += ',';
    list += std::to_string(cpu);
  }
  int error = is_possible ? pthread_setaffinity_np(pthread_self(), sizeof cpus, &cpus) : EINVAL;
  // The system silently ignores CPUs that the machine does not have.
  cpu_set_t granted;
  if (error == 0) error = pthread_getaffinity_np(pthread_self(), sizeof granted, &granted);
  if (error == 0 && !CPU_EQUAL(&cpus, &granted)) error = EINVAL;
  if (error == 0) return {};
  return setup_error(subject_of(config) + " can't be confined to CPU " + list, system_error(error),
                     "name CPUs that this machine has and the process may use (see: nproc, "
                     "taskset -p $$)");
}

}  // namespace

std::string_view to_string(RealtimeMode mode) noexcept {
  switch (mode) {
    case RealtimeMode::kPrefer:
      return "prefer";
    case RealtimeMode::kRequire:
      return "require";
    case RealtimeMode::kOff:
      return "off";
  }
  return "unknown";
}

std::string_view to_string(Schedule schedule) noexcept {
  switch (schedule) {
    case Schedule::kFifo:
      return "fifo";
    case Schedule::kTimeShared:
      return "time-shared";
  }
  return "unknown";
}

std::string throttling_text(RealtimeLimit limit) {
  const auto ms = [](Duration time) {
    return std::to_string(std::chrono::duration_cast<std::chrono::milliseconds>(time).count());
  };
  return "the kernel stops the real-time threads of a CPU that run for more than " +
         ms(limit.runtime) + " of " + ms(limit.period) + " ms";
}

std::string throttling_remedy() {
  return "sysctl -w kernel.sched_rt_runtime_us=-1, where every real-time thread is known to leave "
         "the CPU by itself.";
}

expected<void, SetupError> configure_this_thread(const ThreadConfig& config) {
  // The system accepts at most 15 bytes; truncate the name instead of losing it.
  pthread_setname_np(pthread_self(), config.name.substr(0, 15).c_str());
  if (auto confined = set_affinity(config); !confined) return confined;
  if (!config.priority) return {};
  if (config.realtime == RealtimeMode::kOff || config.schedule == Schedule::kTimeShared) {
    note_thread_priority(*config.priority, false);
    const bool is_asked_for = config.schedule == Schedule::kTimeShared;
    note_scheduling(config, is_asked_for ? Grant::kGranted : Grant::kNotAsked, "time-shared", "");
    return {};
  }
  const int level = level_of(*config.priority);
  sched_param parameter{};
  parameter.sched_priority = level;
  const int error = pthread_setschedparam(pthread_self(), SCHED_FIFO, &parameter);
  note_thread_priority(*config.priority, error == 0);
  if (error == 0) {
    note_scheduling(config, Grant::kGranted, "SCHED_FIFO " + std::to_string(level), "");
    return {};
  }
  const SetupError refusal = scheduling_refusal(config, level, error);
  if (config.realtime == RealtimeMode::kRequire) return unexpected{refusal};
  note_scheduling(config, Grant::kRefused, "time-shared: " + refusal.reason(), refusal.remedy);
  warn_once(refusal.text());
  return {};
}

expected<void, SetupError> check_spinning(const ThreadConfig& config) {
  const RealtimeLimit limit = realtime_limit();
  if (!limit.is_limited() || !config.priority || config.realtime == RealtimeMode::kOff ||
      config.schedule == Schedule::kTimeShared) {
    return {};
  }
  const std::string remedy = throttling_remedy() +
                             " Or let it wait 'adaptive' or 'periodic', or spin time-shared on a "
                             "CPU of its own.";
  if (config.realtime == RealtimeMode::kRequire) {
    return setup_error(subject_of(config) + " can't spin without end at SCHED_FIFO",
                       throttling_text(limit), remedy);
  }
  const RealtimeBudget budget(limit, MonotonicTime{});
  const auto per_mille = static_cast<int>(1000 * budget.sleep_share());
  note_setup({"spin of '" + config.name + "'", Grant::kPartly,
              "it blocks for " + std::to_string(per_mille / 10) + "." +
                  std::to_string(per_mille % 10) + " % of its time, " +
                  std::to_string(RealtimeBudget::kPause.count() / 1000) +
                  " µs at a time or until a call comes, because " + throttling_text(limit),
              remedy});
  return {};
}

namespace {

// Passed from start() to the new thread, which answers through `outcome` and then runs the body.
struct Launch {
  ThreadConfig config;
  std::function<void()> body;
  expected<void, SetupError> outcome{};
  std::binary_semaphore is_configured{0};
};

void* run_thread(void* argument) {
  auto* launch = static_cast<Launch*>(argument);
  launch->outcome = configure_this_thread(launch->config);
  if (!launch->outcome) {
    launch->is_configured.release();
    return nullptr;
  }
  const std::function<void()> body = std::move(launch->body);
  prefault_stack();
  launch->is_configured.release();
  body();
  return nullptr;
}

}  // namespace

expected<Thread, SetupError> Thread::start(const ThreadConfig& config, std::function<void()> body) {
  Launch launch{config, std::move(body)};
  pthread_attr_t attributes;
  pthread_attr_init(&attributes);
  // With locked memory the whole stack is resident, so the system's 8 MiB would be wasteful.
  pthread_attr_setstacksize(&attributes, kStackSize);
  // Otherwise the thread would inherit its starter's level, and keep it if it has no priority.
  const sched_param time_shared{};
  pthread_attr_setinheritsched(&attributes, PTHREAD_EXPLICIT_SCHED);
  pthread_attr_setschedpolicy(&attributes, SCHED_OTHER);
  pthread_attr_setschedparam(&attributes, &time_shared);
  pthread_t handle{};
  const int error = pthread_create(&handle, &attributes, run_thread, &launch);
  pthread_attr_destroy(&attributes);
  if (error != 0) {
    return setup_error(subject_of(config) + " can't be started", system_error(error),
                       "raise the limit of processes (ulimit -u), of memory (ulimit -v) or of "
                       "locked memory (ulimit -l)");
  }
  launch.is_configured.acquire();
  Thread thread;
  thread.handle_ = handle;
  if (!launch.outcome) {
    thread.join();
    return unexpected{launch.outcome.error()};
  }
  return thread;
}

Thread::Thread(Thread&& other) noexcept : handle_(std::exchange(other.handle_, std::nullopt)) {}

Thread& Thread::operator=(Thread&& other) noexcept {
  join();
  handle_ = std::exchange(other.handle_, std::nullopt);
  return *this;
}

Thread::~Thread() {
  join();
}

void Thread::join() noexcept {
  if (!handle_) return;
  RTPM_ASSERT(pthread_equal(*handle_, pthread_self()) == 0, "a thread can't wait for its own end");
  pthread_join(*handle_, nullptr);
  handle_.reset();
}

}  // namespace rtpm::rt
