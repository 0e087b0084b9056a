#include "marks/mark_desk.hpp"

#include <algorithm>
#include <trial.rtpm.events.hpp>
#include <utility>

#include "rtpm/base/printable.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/utc.hpp"

namespace rtpm::console {
namespace {

constexpr const char* kChannel = "console/marks";
constexpr Duration kMarkDeadline = std::chrono::milliseconds{500};
/// How long a pushed mark may take to come back from the hub.
constexpr Duration kConfirmMax = std::chrono::milliseconds{1500};
/// The oldest time that a browser may state, for marks that waited for their connection.
constexpr std::int64_t kAgeMaxNs = 120'000'000'000;
constexpr std::size_t kPendingMax = 256;
constexpr std::size_t kConfirmedMax = 1024;
constexpr std::size_t kIncomingMax = 1000;
constexpr std::size_t kTextSizeMax = 200;
constexpr std::size_t kLabelSizeMax = 1000;

constexpr const char* word_of(events::TrialPhase phase) noexcept {
  return phase == events::TrialPhase::kBegin ? "begin"
         : phase == events::TrialPhase::kEnd ? "end"
                                             : "mark";
}

/// A text of the request; false if it can't be marked.
bool read_text(const nlohmann::json& request, const char* key, std::size_t size_max,
               std::string& text, std::string& problem) {
  const auto found = request.find(key);
  if (found == request.end()) return true;
  if (!found->is_string()) {
    problem = std::string("`") + key + "` is no text";
    return false;
  }
  text = found->get<std::string>();
  if (text.size() > size_max) {
    problem = std::string("`") + key + "` has more than " + std::to_string(size_max) + " bytes";
  } else if (printable(text, kShownWhole) != text) {
    problem = std::string("`") + key + "` has characters that can't be shown";
  }
  return problem.empty();
}

std::uint64_t whole_in(const nlohmann::json& request, const char* key) {
  const auto found = request.find(key);
  if (found == request.end()) return 0;
  if (found->is_number_unsigned()) return found->get<std::uint64_t>();
  if (!found->is_number_float()) return 0;
  const double number = found->get<double>();
  return number > 0 && number < 1.8e19 ? static_cast<std::uint64_t>(number) : 0;
}

/// The trial that a request describes; otherwise `problem` says why not.
std::optional<events::Trial> trial_in(const nlohmann::json& request, std::string& problem) {
  events::Trial trial;
  if (!read_text(request, "label", kLabelSizeMax, trial.note, problem) ||
      !read_text(request, "condition", kTextSizeMax, trial.condition, problem) ||
      !read_text(request, "response", kTextSizeMax, trial.response, problem)) {
    return std::nullopt;
  }
  std::string phase = "mark";
  if (!read_text(request, "phase", kTextSizeMax, phase, problem)) return std::nullopt;
  if (phase == "begin") trial.phase = events::TrialPhase::kBegin;
  if (phase == "end") trial.phase = events::TrialPhase::kEnd;
  if (phase != word_of(trial.phase)) {
    problem = "`phase` is mark, begin or end";
    return std::nullopt;
  }
  const std::uint64_t number = whole_in(request, "number");
  if (number > UINT32_MAX) {
    problem = "`number` is too large";
    return std::nullopt;
  }
  trial.number = static_cast<std::uint32_t>(number);
  if (trial.phase != events::TrialPhase::kMark && trial.number == 0) {
    problem = "a trial begins and ends with its `number`, from 1";
    return std::nullopt;
  }
  if (trial.number == 0 && trial.note.empty()) {
    problem = "nothing to mark: `label` or `number` is missing";
    return std::nullopt;
  }
  return trial;
}

std::string text_of(const flatbuffers::String* text) {
  return text == nullptr ? std::string{} : text->str();
}

bool is_same(const events::Trial& one, const events::Trial& other) {
  return one.phase == other.phase && one.number == other.number && one.note == other.note &&
         one.condition == other.condition && one.response == other.response;
}

}  // namespace

MarkDesk::MarkDesk(rpc::Node& node, std::string hub, CallRouter& router, ChannelTable& channels,
                   WorkerPool& pool, Post post)
    : node_(node),
      hub_(std::move(hub)),
      router_(router),
      channels_(channels),
      pool_(pool),
      post_(std::move(post)) {}

void MarkDesk::start() {
  channels_.add({.topic = kChannel, .encoding = "json"});
  router_.add_json("console/mark", [this](const PendingCall& call, const nlohmann::json& request) {
    mark(call, request);
  });
}

void MarkDesk::mark(const PendingCall& call, const nlohmann::json& request) {
  const std::uint64_t id = whole_in(request, "id");
  if (is_repeated(call, id)) return;
  std::string problem;
  auto trial = trial_in(request, problem);
  if (!trial) return router_.fail(call, problem);
  if (pending_.size() >= kPendingMax) {
    return router_.fail(call, "too many marks wait for the hub; mark again");
  }
  const MonotonicTime now = rt::now();
  const auto utc_ns = static_cast<std::int64_t>(rt::utc_ns(now));
  const auto stated_ns =
      static_cast<std::int64_t>(std::min<std::uint64_t>(whole_in(request, "time_ns"), INT64_MAX));
  // A time that can't be right, as after a jump of a clock, would put the mark anywhere.
  const bool is_stated = stated_ns > utc_ns - kAgeMaxNs && stated_ns <= utc_ns;
  const std::int64_t time_ns = is_stated ? stated_ns : utc_ns;
  complete(*trial, static_cast<std::uint64_t>(time_ns));
  const std::uint64_t number = ++last_number_;
  pending_.emplace_back(number, Pending{.id = id,
                                        .call = call,
                                        .trial = *trial,
                                        .time_ns = static_cast<std::uint64_t>(time_ns),
                                        .deadline = now + kMarkDeadline + kConfirmMax});
  push(number, *trial, now - Duration{utc_ns - time_ns});
}

bool MarkDesk::is_repeated(const PendingCall& call, std::uint64_t id) {
  if (id == 0) return false;
  if (std::ranges::count(confirmed_ids_, id) > 0) {
    router_.succeed(call, Json{{"ok", true}});
    return true;
  }
  for (auto& [number, pending] : pending_) {
    if (pending.id != id) continue;
    router_.fail(pending.call, "the mark was sent again");
    pending.call = call;
    return true;
  }
  return false;
}

void MarkDesk::complete(events::Trial& trial, std::uint64_t time_ns) const {
  if (trial.phase != events::TrialPhase::kEnd) return;
  for (auto mark = marks_.rbegin(); mark != marks_.rend(); ++mark) {
    if (mark->source != 0 || mark->trial.number != trial.number) continue;
    if (mark->trial.phase == events::TrialPhase::kEnd) return;
    if (mark->trial.phase != events::TrialPhase::kBegin) continue;
    if (trial.condition.empty()) trial.condition = mark->trial.condition;
    if (mark->time_ns <= time_ns) trial.duration = Duration{time_ns - mark->time_ns};
    return;
  }
}

void MarkDesk::push(std::uint64_t number, const events::Trial& trial, MonotonicTime origin) {
  const auto fail = [this, number](const std::string& why) {
    const auto found =
        std::ranges::find(pending_, number, [](const auto& one) { return one.first; });
    if (found == pending_.end()) return;
    router_.fail(found->second.call, why);
    pending_.erase(found);
  };
  const bool is_queued = pool_.run("marks", [this, trial, origin, fail] {
    std::string why;
    {
      const std::lock_guard lock(supplier_mutex_);
      if (!supplier_) {
        auto opened = events::TrialSupplier::create(
            node_, hub_, 0, {.name = "rtpm-console", .deadline = kMarkDeadline});
        if (opened) {
          supplier_.emplace(std::move(*opened));
        } else {
          why = "the mark was not set: " + opened.error().text();
        }
      }
      if (supplier_) {
        if (const auto pushed = supplier_->push(trial, origin); !pushed) {
          why = "the mark was not set: the hub answers " + std::string(to_string(pushed.error()));
          supplier_.reset();
        }
      }
    }
    if (!why.empty()) post_([fail, why] { fail(why); });
  });
  if (!is_queued) fail("too much waits to be done; mark again");
}

void MarkDesk::take(const HubEvent& event) {
  omitted_count_ += event.omitted_count;
  if (event.header.is_replayed || event.header.schema_id != TrialEvent::kSchemaId ||
      !rpc::is_valid_table<rtpm::Trial>(event.payload, TrialEvent::kLimits)) {
    return;
  }
  const auto& wire = *flatbuffers::GetRoot<rtpm::Trial>(event.payload.data());
  events::Trial trial{.phase = static_cast<events::TrialPhase>(wire.phase()),
                      .number = wire.number(),
                      .condition = text_of(wire.condition()),
                      .response = text_of(wire.response()),
                      .note = text_of(wire.note())};
  if (wire.duration_ns()) {
    trial.duration = Duration{std::min<std::uint64_t>(*wire.duration_ns(), INT64_MAX)};
  }
  if (event.header.source == 0) confirm(trial);
  for (std::string* const text : {&trial.condition, &trial.response})
    *text = printable(*text, kTextSizeMax);
  trial.note = printable(trial.note, kLabelSizeMax);
  // The hub may be on another host, so only differences of its times are valid.
  const MonotonicTime origin = event.arrived - (event.header.hub_sent - event.header.origin);
  Mark mark{rt::utc_ns(origin), event.header.source, std::move(trial)};
  marks_.push_back(mark);
  if (marks_.size() > kMarkCountMax) marks_.pop_front();
  if (incoming_.size() < kIncomingMax) {
    incoming_.push_back(std::move(mark));
  } else {
    ++omitted_count_;
  }
}

void MarkDesk::confirm(const events::Trial& trial) {
  const auto found = std::ranges::find_if(
      pending_, [&](const auto& one) { return is_same(one.second.trial, trial); });
  if (found == pending_.end()) return;
  const Pending& pending = found->second;
  Json reply{{"ok", true}, {"time_ns", pending.time_ns}};
  if (trial.duration) reply["duration_ns"] = trial.duration->count();
  router_.succeed(pending.call, reply);
  if (pending.id != 0) confirmed_ids_.push_back(pending.id);
  if (confirmed_ids_.size() > kConfirmedMax) confirmed_ids_.pop_front();
  pending_.erase(found);
}

MarkDesk::Json MarkDesk::json_of(const Mark& mark) {
  const events::Trial& trial = mark.trial;
  Json json{{"time_ns", mark.time_ns},   {"label", trial.note},   {"phase", word_of(trial.phase)},
            {"number", trial.number},    {"source", mark.source}, {"condition", trial.condition},
            {"response", trial.response}};
  if (trial.duration) json["duration_ns"] = trial.duration->count();
  return json;
}

void MarkDesk::greet(std::uint64_t connection_id, const foxglove::Subscribe& request) {
  const std::uint32_t channel = channels_.find(kChannel);
  const bool is_asked = std::ranges::any_of(
      request.subscriptions, [&](const auto& one) { return one.channel_id == channel; });
  if (!is_asked) return;
  Json marks = Json::array();
  for (const Mark& mark : marks_)
    marks.push_back(json_of(mark));
  channels_.publish_to(
      connection_id, channel, rt::utc_ns(rt::now()),
      foxglove::dumped(
          {{"is_first", true}, {"marks", std::move(marks)}, {"omitted", omitted_count_}}));
}

void MarkDesk::flush() {
  const MonotonicTime now = rt::now();
  while (!pending_.empty() && pending_.front().second.deadline <= now) {
    router_.fail(pending_.front().second.call,
                 "the mark did not come back from the hub, so it may be lost; mark again");
    pending_.pop_front();
  }
  if (incoming_.empty()) return;
  Json marks = Json::array();
  for (const Mark& mark : std::exchange(incoming_, {}))
    marks.push_back(json_of(mark));
  const std::uint64_t told_count = std::exchange(told_count_, omitted_count_);
  channels_.publish(
      channels_.find(kChannel), rt::utc_ns(now),
      foxglove::dumped({{"marks", std::move(marks)}, {"omitted", omitted_count_ - told_count}}));
}

}  // namespace rtpm::console
