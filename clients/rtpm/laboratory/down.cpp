#include <signal.h>

#include <string>
#include <vector>

#include "cli/command.hpp"
#include "cli/output.hpp"
#include "cli/progress.hpp"
#include "cli/table.hpp"
#include "laboratory/commands.hpp"
#include "laboratory/state_folder.hpp"
#include "rtpm/options/duration.hpp"
#include "rtpm/options/suggestion.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::tool {
namespace {

using laboratory::RunningLaboratory;
using laboratory::StateFolder;

constexpr Duration kTurn = std::chrono::milliseconds{20};
/// Time allowed beyond the patience with the programs.
constexpr Duration kGrace = std::chrono::seconds{5};

std::string joined(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words)
    text += (text.empty() ? "" : ", ") + word;
  return text;
}

void print_list(const Context& context, const std::vector<RunningLaboratory>& laboratories) {
  if (context.json) {
    Json list = Json::array();
    for (const RunningLaboratory& laboratory : laboratories) {
      list.push_back({{"name", laboratory.name},
                      {"file", laboratory.file},
                      {"process", laboratory.supervisor.id},
                      {"programs", laboratory.programs}});
    }
    return print_json(list);
  }
  std::vector<Row> rows{{"LABORATORY", "PROCESS", "FILE", "PROGRAMS"}};
  for (const RunningLaboratory& laboratory : laboratories) {
    rows.push_back({laboratory.name, std::to_string(laboratory.supervisor.id), laboratory.file,
                    joined(laboratory.programs)});
  }
  std::fputs(aligned(rows, 4).c_str(), stdout);
}

/// Waits until none of its processes is left.
int await_end(Context& context, const StateFolder& folder, const RunningLaboratory& laboratory) {
  const options::StopSignal& stop = context.stop();
  const Duration patience = laboratory.stop_patience + kGrace;
  const MonotonicTime end = rt::now() + patience;
  StatusLine progress(context);
  while (const auto running = folder.find(laboratory.name)) {
    if (running->supervisor != laboratory.supervisor) break;  // Another one was brought up.
    const auto& programs = running->programs;
    progress.show(laboratory.name + " ends" +
                  (programs.empty() ? "" : ", still running: " + joined(programs)));
    if (rt::now() >= end) {
      return context.fail({"the laboratory '" + laboratory.name + "' has not ended within " +
                               options::duration_text(patience),
                           programs.empty() ? "" : "still running: " + joined(programs),
                           "kill -9 " + std::to_string(laboratory.supervisor.id)});
    }
    if (stop.wait_for(kTurn))
      return context.fail("the laboratory '" + laboratory.name + "' goes on ending");
  }
  return kDone;
}

int end_laboratory(Context& context, const StateFolder& folder,
                   const RunningLaboratory& laboratory) {
  // If the supervisor was killed meanwhile, its other processes end by themselves.
  laboratory::send_signal(laboratory.supervisor, SIGTERM);
  if (const int exit_code = await_end(context, folder, laboratory); exit_code != kDone)
    return exit_code;
  if (context.json) {
    print_json({{"name", laboratory.name}, {"ended", true}});
  } else {
    print_line(laboratory.name + " has ended");
  }
  return kDone;
}

int down(Context& context, const std::string& name) {
  const auto folder = StateFolder::open();
  if (!folder) return context.fail(folder.error());
  const std::vector<RunningLaboratory> laboratories = folder->list();
  if (laboratories.empty()) {
    return context.fail("no laboratory " + (name.empty() ? "" : "'" + name + "' ") +
                        "of this user is up on this host");
  }
  if (name.empty() && laboratories.size() == 1)
    return end_laboratory(context, *folder, laboratories.front());
  std::vector<std::string> names;
  for (const RunningLaboratory& laboratory : laboratories) {
    if (laboratory.name == name) return end_laboratory(context, *folder, laboratory);
    names.push_back(laboratory.name);
  }
  if (!name.empty()) {
    return context.fail("no laboratory '" + name + "' is up" + options::suggestion(name, names) +
                        "; there are: " + joined(names));
  }
  print_list(context, laboratories);
  return context.fail({"several laboratories are up", "", "name one: rtpm down " + names.front()},
                      kMisused);
}

}  // namespace

void add_down(CLI::App& program, Context& context) {
  const auto name = std::make_shared<std::string>();
  CLI::App& command = add_command(
      program, context, "down", "End a laboratory that `rtpm up` has brought up on this host",
      "  rtpm down cell\n"
      "Ends all its programs in reverse order, and returns when no process is left. Without a "
      "name\n"
      "it ends the only one; of several it prints a list, and ends none.\n",
      [name](Context& c) { return down(c, *name); });
  command.add_option("NAME", *name, "The laboratory")->type_name("");
}

}  // namespace rtpm::tool
