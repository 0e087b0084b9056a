#include "laboratory/bring_up.hpp"

#include <poll.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <utility>

#include "cli/output.hpp"
#include "laboratory/guard.hpp"
#include "laboratory/process.hpp"
#include "laboratory/state_folder.hpp"
#include "laboratory/view.hpp"
#include "rtpm/options/duration.hpp"
#include "rtpm/rt/log.hpp"

namespace rtpm::tool {
namespace {

using laboratory::Handle;
using laboratory::Plan;
using laboratory::ProgramStatus;
using laboratory::Record;
using laboratory::RunningLaboratory;
using laboratory::StateFolder;

/// The time that the front has for its own work between the stop signal and its exit.
constexpr int kTurnMs = 100;

/// A view that also keeps the laboratory's record, and releases the front when everything serves.
class RecordingView final : public LaboratoryView {
 public:
  RecordingView(const Plan& plan, bool as_json, bool is_quiet, const Record& record,
                RunningLaboratory facts, std::string log_path, Handle report)
      : LaboratoryView(plan, as_json, is_quiet),
        record_(record),
        facts_(std::move(facts)),
        processes_(plan.programs.size()),
        log_path_(std::move(log_path)),
        report_(std::move(report)) {}

  void on_change(std::size_t program, const ProgramStatus& status) override {
    LaboratoryView::on_change(program, status);
    if (std::exchange(processes_[program], status.process) == status.process) return;
    facts_.programs.clear();
    for (std::size_t i = 0; i < processes_.size(); ++i) {
      if (processes_[i] > 0) facts_.programs.push_back(plan().programs[i].name);
    }
    record_.write(facts_);
  }

  void on_up() override {
    LaboratoryView::on_up();
    is_up_ = true;
  }

  void on_turn(const laboratory::Supervision& supervision) override {
    LaboratoryView::on_turn(supervision);
    if (is_up_ && report_.is_open()) leave();
  }

 private:
  /// Continues in a log; the front then ends.
  void leave() {
    std::remove(log_path_.c_str());
    if (auto log = laboratory::LogFile::open(log_path_)) move_to(std::move(*log));
    laboratory::leave_terminal();
    static_cast<void>(!::write(report_.number(), "u", 1));
    report_.reset();
  }

  const Record& record_;
  RunningLaboratory facts_;
  std::vector<int> processes_;
  const std::string log_path_;
  Handle report_;
  bool is_up_ = false;
};

/// The work of the supervising process.
int supervise(Context& context, const Plan& plan, const BringUpOptions& how, const Record& record,
              const std::string& log_path, int lifeline, Handle report) {
  RunningLaboratory facts{
      .name = plan.name,
      .file = plan.file,
      .supervisor = laboratory::identity_of(::getppid()).value_or(laboratory::ProcessIdentity{}),
      .stop_patience = plan.stop_patience()};
  record.write(facts);
  const bool is_quiet = plan.has_terminal() && !how.is_detached;
  RecordingView view(plan, context.json, is_quiet, record, facts, log_path, std::move(report));
  const auto supervisor =
      laboratory::Supervisor::create(plan, view,
                                     {.registry_url = context.registry,
                                      .has_terminal = !how.is_detached && !context.json,
                                      .lifeline = lifeline,
                                      .time = how.time});
  if (!supervisor) return context.fail(supervisor.error());
  const bool is_well = (*supervisor)->run();
  view.finish();
  // The process above removes it, unless it was killed.
  if (laboratory::identity_of(::getppid()) != facts.supervisor) record.remove();
  if (how.must_end_before && (*supervisor)->has_run_out_of_time()) {
    return context.fail("the laboratory '" + plan.name + "' has not ended by itself within " +
                        options::duration_text(*how.time));
  }
  if (is_well) return kDone;
  const std::string failed = view.failed_programs();
  return context.fail({"the laboratory '" + plan.name + "' failed",
                       failed.empty() ? "a process of it could not be ended" : failed});
}

int guard(Context& context, const Plan& plan, const BringUpOptions& options,
          const StateFolder& folder, const Record& record, Handle report) {
  const auto end = laboratory::run_guarded(
      [&](int lifeline) {
        return supervise(context, plan, options, record, folder.log_path(plan.name), lifeline,
                         std::move(report));
      },
      plan.longest_stop_patience(), options.is_detached);
  record.remove();
  if (!end) return context.fail(end.error());
  if (!end->was_killed) return end->exit_code;
  return context.fail({"the laboratory '" + plan.name + "' has ended", "its supervisor was killed",
                       "see the system's log (dmesg)"});
}

/// Waits until the background process reports that everything serves, or ends.
int await_background(Context& context, const Plan& plan, const StateFolder& folder,
                     pid_t background, int report) {
  const options::StopSignal& stop = context.stop();
  bool has_passed_stop = false;
  char byte = 0;
  for (;;) {
    pollfd waited{report, POLLIN, 0};
    if (::poll(&waited, 1, kTurnMs) > 0) break;
    if (stop.is_requested() && !std::exchange(has_passed_stop, true)) ::kill(background, SIGTERM);
  }
  if (::read(report, &byte, 1) == 1) {
    if (!context.json) {
      print_line(plan.name + " serves in the background; `rtpm down " + plan.name +
                 "` ends it, its log is " + folder.log_path(plan.name));
    }
    return kDone;
  }
  int status = 0;
  while (::waitpid(background, &status, 0) < 0 && errno == EINTR) {
  }
  return WIFEXITED(status) ? WEXITSTATUS(status) : kFailed;
}

int detach(Context& context, const Plan& plan, const BringUpOptions& options,
           const StateFolder& folder, const Record& record) {
  auto report = laboratory::make_pipe();
  if (!report) return context.fail(report.error());
  std::fflush(nullptr);
  const pid_t background = ::fork();
  if (background < 0)
    return context.fail(
        SetupError{"the background process does not start", system_error(errno).message()});
  if (background > 0) {
    (*report)[1].reset();
    return await_background(context, plan, folder, background, (*report)[0].number());
  }
  ::setsid();
  (*report)[0].reset();
  std::exit(guard(context, plan, options, folder, record, std::move((*report)[1])));
}

}  // namespace

int bring_up(Context& context, const Plan& plan, const BringUpOptions& options) {
  const auto folder = StateFolder::open();
  if (!folder) return context.fail(folder.error());
  const auto record = Record::create(*folder, plan.name);
  if (!record) return context.fail(record.error());
  for (const std::string& name : plan.left_out)
    rt::print_error("rtpm", "the program '" + name + "' is left out: it is not installed");
  if (options.is_detached) return detach(context, plan, options, *folder, *record);
  return guard(context, plan, options, *folder, *record, Handle());
}

int refuse_file(const Context& context, const std::vector<SetupError>& errors) {
  for (const SetupError& error : errors)
    context.fail(error, kMisused);
  return kMisused;
}

}  // namespace rtpm::tool
