#include <string>

#include "cli/command.hpp"
#include "cli/output.hpp"
#include "events/commands.hpp"
#include "objects/unbound.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/events/hub_types.hpp"
#include "rtpm/events/trials.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::tool {
namespace {

struct MarkRequest {
  std::string hub{events::kHubPath};
  events::Trial trial{};
  events::SourceId source = 0;
  std::uint64_t seed = 0;
  bool has_seed = false;
  bool is_begin = false;
  bool is_end = false;
};

constexpr const char* word_of(events::TrialPhase phase) noexcept {
  return phase == events::TrialPhase::kBegin ? "begin"
         : phase == events::TrialPhase::kEnd ? "end"
                                             : "mark";
}

/// "marked: trial 3 begin, condition soft, subject yawns".
std::string text_of(const events::Trial& trial) {
  std::string text;
  const auto add = [&text](const std::string& part) {
    text += (text.empty() ? "marked: " : ", ") + part;
  };
  if (trial.number != 0) {
    add("trial " + std::to_string(trial.number) +
        (trial.phase == events::TrialPhase::kMark ? "" : std::string(" ") + word_of(trial.phase)));
  }
  if (!trial.condition.empty()) add("condition " + printable(trial.condition));
  if (!trial.response.empty()) add("response " + printable(trial.response));
  if (trial.seed) add("seed " + std::to_string(*trial.seed));
  if (!trial.note.empty()) add(printable(trial.note));
  return text;
}

int mark(Context& context, MarkRequest& request) {
  // The moment is that of the command, not of the hub's answers.
  const MonotonicTime origin = rt::now();
  events::Trial& trial = request.trial;
  const bool is_phase = request.is_begin || request.is_end;
  if (request.has_seed) trial.seed = request.seed;
  if (request.is_begin) trial.phase = events::TrialPhase::kBegin;
  if (request.is_end) trial.phase = events::TrialPhase::kEnd;
  if (is_phase && trial.number == 0) {
    return context.fail("--begin and --end need --trial with the trial's number", kMisused);
  }
  if (text_of(trial).empty()) {
    return context.fail("nothing to mark: a text or --trial is missing", kMisused);
  }
  const Duration deadline = context.deadline.value_or(std::chrono::seconds{1});
  if (const auto types = events::HubTypes::ask(context.node(), request.hub, deadline); !types) {
    return context.not_reached(with_similar_names(context, request.hub, types.error()));
  }
  events::SupplierConfig config{.name = "rtpm mark", .deadline = deadline};
  config.priority = context.priority.value_or(Priority{});
  auto supplier =
      events::TrialSupplier::create(context.node(), request.hub, request.source, config);
  if (!supplier) return context.fail(supplier.error());
  if (const auto pushed = supplier->push(trial, origin); !pushed) {
    return context.fail({"the mark was not pushed", std::string(to_string(pushed.error()))});
  }
  if (!context.json) {
    print_line(text_of(trial));
    return kDone;
  }
  Json json{{"phase", word_of(trial.phase)},
            {"number", trial.number},
            {"condition", trial.condition},
            {"response", trial.response},
            {"note", trial.note},
            {"source", request.source},
            {"origin_ns", origin.time_since_epoch().count()}};
  if (trial.seed) json["seed"] = *trial.seed;
  print_json(json);
  return kDone;
}

}  // namespace

void add_mark(CLI::App& program, Context& context) {
  const auto request = std::make_shared<MarkRequest>();
  CLI::App& command =
      add_command(program, context, "mark", "Push a note or a trial of an experiment to a hub",
                  "  rtpm mark 'subject yawns'\n"
                  "  rtpm mark --trial 3 --begin --condition soft --seed 7\n"
                  "  rtpm mark --trial 3 --end --response 'the first'\n"
                  "It is the event rtpm.Trial, which recordings, the console and exports have.\n",
                  [request](Context& c) { return mark(c, *request); });
  command.add_option("TEXT", request->trial.note, "A note")->type_name("");
  add_count(command, "--trial", request->trial.number, "The trial's number, from 1", 1u);
  CLI::Option* const begin = command.add_flag("--begin", request->is_begin, "The trial begins");
  command.add_flag("--end", request->is_end, "The trial ends")->excludes(begin);
  command.add_option("--condition", request->trial.condition, "The trial's condition")
      ->type_name("TEXT");
  command.add_option("--response", request->trial.response, "The subject's response")
      ->type_name("TEXT");
  add_count(command, "--seed", request->seed, "The seed of the trial's random numbers")
      .each([request](const std::string&) { request->has_seed = true; });
  add_count(command, "--source", request->source, "The source's number");
  command.add_option("--hub", request->hub, "The hub, by name or URL")->capture_default_str();
}

}  // namespace rtpm::tool
