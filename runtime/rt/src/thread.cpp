#include "rtpm/rt/thread.hpp"

#include <atomic>
#include <cstdio>
#include <string>
#include <utility>

#include "native_level.hpp"
#include "os/native_thread.hpp"
#include "rtpm/rt/priority.hpp"
#include "rtpm/rt/report.hpp"
#include "setup_text.hpp"

namespace rtpm::rt {
namespace {

std::string subject_of(const ThreadConfig& config) {
  return "thread '" + config.name + "'";
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
  os::name_this_thread(config.name);
  if (!config.cpus.empty()) {
    auto confined = os::confine_this_thread(subject_of(config), config.cpus);
    if (!confined) return confined;
  }
  if (!config.priority) return {};
  if (config.realtime == RealtimeMode::kOff || config.schedule == Schedule::kTimeShared) {
    note_thread_priority(*config.priority, false);
    const bool is_asked_for = config.schedule == Schedule::kTimeShared;
    note_scheduling(config, is_asked_for ? Grant::kGranted : Grant::kNotAsked, "time-shared", "");
    return {};
  }
  const int level = level_of(*config.priority);
  const int error = os::request_level(level);
  note_thread_priority(*config.priority, error == 0);
  if (error == 0) {
    const std::string remedy = os::remedy_of_level(level);
    if (!remedy.empty() && config.realtime == RealtimeMode::kRequire) {
      return setup_error(subject_of(config) + " can run at " + os::name_of_level(level) + " only",
                         "its latency is not bounded", remedy);
    }
    note_scheduling(config, remedy.empty() ? Grant::kGranted : Grant::kPartly,
                    os::name_of_level(level), remedy);
    return {};
  }
  const SetupError refusal = os::level_refusal(subject_of(config), level, error);
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
    return setup_error(subject_of(config) + " can't spin without end at a real-time level",
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

}  // namespace rtpm::rt
