#include "laboratory/supervision.hpp"

#include <csignal>
#include <cstring>

#include <algorithm>
#include <utility>

#include "rtpm/options/duration.hpp"

namespace rtpm::laboratory {
namespace {

/// A shell ends with this exit code plus the number of the signal that ended its command.
constexpr int kShellSignalBase = 128;

std::string signal_name(int signal) {
  const char* const name = ::sigabbrev_np(signal);
  return name == nullptr ? "signal " + std::to_string(signal) : "SIG" + std::string(name);
}

bool ended_as_asked(ProcessEnd end, int stop_signal) {
  if (end.exit_code) return *end.exit_code == 0 || *end.exit_code == kShellSignalBase + stop_signal;
  return end.signal == stop_signal;
}

/// The delay doubles with each recent restart.
Duration back_off(const ProgramPlan& plan, std::size_t restart_count) {
  Duration delay = plan.restart_delay;
  for (std::size_t i = 0; i < restart_count && delay < plan.restart_delay_max; ++i)
    delay *= 2;
  return std::min(delay, plan.restart_delay_max);
}

}  // namespace

std::string_view to_string(State state) noexcept {
  switch (state) {
    case State::kWaiting:
      return "waiting";
    case State::kStarting:
      return "starting";
    case State::kServing:
      return "serving";
    case State::kPausing:
      return "pausing";
    case State::kStopping:
      return "stopping";
    case State::kDone:
      return "done";
    case State::kFailed:
      return "failed";
    case State::kEnded:
      return "ended";
  }
  return "";
}

bool is_final(State state) noexcept {
  return state == State::kDone || state == State::kFailed || state == State::kEnded;
}

bool is_running(State state) noexcept {
  return state == State::kStarting || state == State::kServing || state == State::kStopping;
}

std::string ProcessEnd::text() const {
  return exit_code ? "exit code " + std::to_string(*exit_code) : signal_name(signal);
}

Supervision::Supervision(const Plan& plan, MonotonicTime now)
    : plan_(plan), programs_(plan.programs.size()) {
  for (Program& program : programs_)
    program.status.since = now;
}

const ProgramStatus& Supervision::status(std::size_t index) const {
  return programs_[index].status;
}

std::vector<std::size_t> Supervision::take_changes() {
  return std::exchange(changes_, {});
}

bool Supervision::is_over() const {
  return std::ranges::all_of(programs_,
                             [](const Program& program) { return is_final(program.status.state); });
}

MonotonicTime Supervision::next() const {
  MonotonicTime next = kNever;
  for (const Program& program : programs_)
    next = std::min(next, program.deadline);
  return next;
}

std::vector<Supervision::Action> Supervision::due(MonotonicTime now) {
  // The end of one program may let another proceed, so this repeats until nothing happens.
  std::vector<Action> actions = std::exchange(pending_, {});
  const auto count_events = [&] {
    return actions.size() + changes_.size() + std::size_t{is_stopping_};
  };
  for (std::size_t count = SIZE_MAX; count != count_events();) {
    count = count_events();
    advance(now, actions);
    settle(now);
  }
  return actions;
}

void Supervision::advance(MonotonicTime now, std::vector<Action>& actions) {
  if (is_stopping_) {
    for (std::size_t i = plan_.order.size(); i-- > 0;)
      advance_stop(plan_.order[i], now, actions);
  } else {
    for (const std::size_t program : plan_.order)
      advance_start(program, now, actions);
  }
  for (std::size_t i = 0; i < programs_.size(); ++i) {
    Program& program = programs_[i];
    if (program.status.state != State::kStopping || now < program.deadline) continue;
    program.deadline = kNever;
    program.is_killed = true;
    actions.push_back({Order::kKill, i});
  }
}

void Supervision::advance_start(std::size_t index, MonotonicTime now,
                                std::vector<Action>& actions) {
  Program& program = programs_[index];
  const ProgramPlan& plan = plan_.programs[index];
  const State state = program.status.state;
  if (state == State::kStarting && now >= program.deadline) {
    program.status.note = "it did not serve within " + options::duration_text(plan.ready_deadline);
    begin_stop(index, StopReason::kNotReady, now);
    actions.push_back({Order::kStop, index});
    return;
  }
  if (state != State::kWaiting && (state != State::kPausing || now < program.deadline)) return;
  for (const std::size_t other : plan.after) {
    const State before = programs_[other].status.state;
    if (before == State::kFailed) {
      fail(index, plan_.programs[other].name + ", which it comes after, has failed", now);
      return;
    }
    if (before != State::kServing && before != State::kDone) {
      program.deadline = kNever;
      if (state == State::kPausing) enter(index, State::kWaiting, program.status.note, now);
      return;
    }
  }
  program.is_condition_met = plan.readiness == Readiness::kStart;
  program.has_url = false;
  program.is_killed = false;
  enter(index, State::kStarting, {}, now);
  program.deadline = now + plan.ready_deadline;
  actions.push_back({Order::kStart, index});
}

void Supervision::advance_stop(std::size_t index, MonotonicTime now, std::vector<Action>& actions) {
  const State state = programs_[index].status.state;
  if (state == State::kWaiting || state == State::kPausing) {
    enter(index, State::kEnded, {}, now);
  } else if ((state == State::kStarting || state == State::kServing) &&
             !is_needed_by_running(index)) {
    begin_stop(index, StopReason::kLaboratory, now);
    actions.push_back({Order::kStop, index});
  }
}

bool Supervision::is_needed_by_running(std::size_t index) const {
  for (std::size_t i = 0; i < programs_.size(); ++i) {
    const auto& after = plan_.programs[i].after;
    if (is_running(programs_[i].status.state) && std::ranges::find(after, index) != after.end())
      return true;
  }
  return false;
}

void Supervision::begin_stop(std::size_t index, StopReason reason, MonotonicTime now) {
  Program& program = programs_[index];
  program.stop_reason = reason;
  enter(index, State::kStopping, program.status.note, now);
  program.deadline = now + plan_.programs[index].stop_patience;
}

void Supervision::started(std::size_t index, int process, MonotonicTime now) {
  programs_[index].status.process = process;
  changes_.push_back(index);
  serve_if_ready(index, now);
}

void Supervision::not_started(std::size_t index, const std::string& why, MonotonicTime now) {
  judge(index, false, why, now);
}

void Supervision::has_url(std::size_t index, const std::string& url, MonotonicTime now) {
  Program& program = programs_[index];
  if (program.has_url) return;
  program.has_url = true;
  const bool is_new = !program.status.url.empty() && program.status.url != url;
  program.status.url = url;
  if (plan_.programs[index].readiness == Readiness::kUrl) program.is_condition_met = true;
  serve_if_ready(index, now);
  if (!is_new || is_stopping_) return;
  // Programs that were started with the former URL would use it forever.
  for (std::size_t i = 0; i < programs_.size(); ++i) {
    const auto& uses = plan_.programs[i].uses;
    const State state = programs_[i].status.state;
    if (std::ranges::find(uses, index) == uses.end() ||
        (state != State::kStarting && state != State::kServing))
      continue;
    programs_[i].status.note = plan_.programs[index].name + " has another URL";
    begin_stop(i, StopReason::kNewUrl, now);
    pending_.push_back({Order::kStop, i});
  }
}

void Supervision::is_ready(std::size_t index, MonotonicTime now) {
  programs_[index].is_condition_met = true;
  serve_if_ready(index, now);
}

void Supervision::serve_if_ready(std::size_t index, MonotonicTime now) {
  Program& program = programs_[index];
  const bool lacks_url = plan_.programs[index].has_url && !program.has_url;
  if (program.status.state != State::kStarting || !program.is_condition_met || lacks_url ||
      plan_.programs[index].readiness == Readiness::kExit)
    return;
  enter(index, State::kServing, {}, now);
  program.deadline = kNever;
}

void Supervision::exited(std::size_t index, ProcessEnd end, MonotonicTime now) {
  Program& program = programs_[index];
  const bool was_serving = program.status.state == State::kServing;
  const bool is_one_shot = plan_.programs[index].readiness == Readiness::kExit;
  program.status.process = 0;
  if (program.status.state == State::kStopping) {
    end_while_stopping(index, end, now);
  } else if (end.exit_code == 0 && !was_serving && !is_one_shot) {
    judge(index, false, "it ended before it served", now);
  } else {
    judge(index, end.exit_code == 0, end.text(), now);
  }
}

void Supervision::end_while_stopping(std::size_t index, ProcessEnd end, MonotonicTime now) {
  Program& program = programs_[index];
  const ProgramPlan& plan = plan_.programs[index];
  const std::string note = std::exchange(program.status.note, {});
  if (program.stop_reason == StopReason::kNotReady && !is_stopping_) {
    judge(index, false, note, now);
  } else if (program.stop_reason == StopReason::kNewUrl && !is_stopping_) {
    program.deadline = kNever;
    ++program.status.restart_count;
    enter(index, State::kWaiting, note, now);
  } else if (program.stop_reason == StopReason::kNotReady) {
    fail(index, note, now);
  } else if (program.is_forced) {
    enter(index, State::kEnded, "killed", now);
  } else if (program.is_killed) {
    fail(index,
         "it did not end within " + options::duration_text(plan.stop_patience) + " of " +
             signal_name(plan.stop_signal) + " and was killed",
         now);
  } else if (ended_as_asked(end, plan.stop_signal)) {
    enter(index, State::kEnded, {}, now);
    program.deadline = kNever;
  } else {
    fail(index, end.text(), now);
  }
}

/// Decides the consequence of an unrequested end of a program.
void Supervision::judge(std::size_t index, bool is_success, const std::string& how,
                        MonotonicTime now) {
  Program& program = programs_[index];
  const ProgramPlan& plan = plan_.programs[index];
  program.deadline = kNever;
  const bool is_restarted =
      plan.restart == Restart::kAlways || (plan.restart == Restart::kOnFailure && !is_success);
  if (!is_restarted || is_stopping_) {
    if (!is_success) return fail(index, how, now);
    return enter(index, State::kDone, {}, now);
  }
  std::erase_if(program.restarts,
                [&](MonotonicTime time) { return now - time > plan.restart_window; });
  if (program.restarts.size() >= plan.restart_limit) {
    return fail(index,
                how + ", after " + std::to_string(program.restarts.size()) + " restarts within " +
                    options::duration_text(plan.restart_window),
                now);
  }
  const Duration delay = back_off(plan, program.restarts.size());
  program.restarts.push_back(now);
  ++program.status.restart_count;
  enter(index, State::kPausing, how, now);
  program.deadline = now + delay;
}

void Supervision::fail(std::size_t index, std::string note, MonotonicTime now) {
  has_failed_ = true;
  programs_[index].deadline = kNever;
  enter(index, State::kFailed, std::move(note), now);
  if (!is_up_ || plan_.programs[index].is_needed) stop(now);
}

void Supervision::enter(std::size_t index, State state, std::string note, MonotonicTime now) {
  ProgramStatus& status = programs_[index].status;
  status.state = state;
  status.since = now;
  status.note = std::move(note);
  if (!is_running(state)) status.process = 0;
  changes_.push_back(index);
}

/// Decides the consequences for the laboratory.
void Supervision::settle(MonotonicTime now) {
  if (!is_up_ && std::ranges::all_of(programs_, [](const Program& program) {
        return program.status.state == State::kServing || program.status.state == State::kDone;
      }))
    is_up_ = true;
  bool has_main = false;
  bool has_open_main = false;
  for (std::size_t i = 0; i < programs_.size(); ++i) {
    if (!plan_.programs[i].is_main) continue;
    has_main = true;
    has_open_main = has_open_main || !is_final(programs_[i].status.state);
  }
  if (has_main && !has_open_main) stop(now);
}

void Supervision::stop(MonotonicTime) {
  is_stopping_ = true;
}

void Supervision::kill(MonotonicTime now) {
  is_stopping_ = true;
  for (std::size_t i = 0; i < programs_.size(); ++i) {
    Program& program = programs_[i];
    if (!is_running(program.status.state)) continue;
    if (program.status.state != State::kStopping) begin_stop(i, StopReason::kLaboratory, now);
    program.deadline = kNever;
    program.is_forced = true;
    pending_.push_back({Order::kKill, i});
  }
}

}  // namespace rtpm::laboratory
