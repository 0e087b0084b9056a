#include "incidents/incident_desk.hpp"

#include <algorithm>
#include <system_error>
#include <utility>

#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/utc.hpp"
#include "services/json_fields.hpp"

namespace rtpm::console {
namespace {

using incidents::Content;
using incidents::Incident;
using incidents::IncidentFile;
using Json = nlohmann::ordered_json;

constexpr const char* kTopic = "console/incidents";
constexpr Duration kKeepInterval = std::chrono::milliseconds{500};
/// The incidents of the channel; others are listed by the service.
constexpr std::size_t kShownCount = 200;
constexpr std::size_t kIdCountMax = incidents::IncidentBook::kCountMax;

std::string lower_case(std::string text) {
  std::ranges::transform(text, text.begin(), [](unsigned char c) {
    return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : static_cast<char>(c);
  });
  return text;
}

/// Open ones first, then the newest.
void sort_by_need(std::vector<const Incident*>& list) {
  std::ranges::sort(list, [](const Incident* a, const Incident* b) {
    if (a->is_open() != b->is_open()) return a->is_open();
    return a->id > b->id;
  });
}

}  // namespace

IncidentDesk::IncidentDesk(Config config, CallRouter& router, ChannelTable& channels, Post post,
                           std::function<std::string(std::uint64_t)> name_of)
    : config_(std::move(config)),
      router_(router),
      channels_(channels),
      post_(std::move(post)),
      name_of_(std::move(name_of)) {}

expected<void, SetupError> IncidentDesk::start() {
  channels_.add({.topic = kTopic, .encoding = "json"});
  router_.add_json(kTopic, [this](const PendingCall& call, const nlohmann::json& request) {
    list(call, request);
  });
  router_.add_json("console/incident_acknowledge",
                   [this](const PendingCall& call, const nlohmann::json& request) {
                     acknowledge(call, request);
                   });
  if (!config_.file.empty()) {
    Content content;
    auto file = IncidentFile::open(config_.file, content);
    if (file) {
      file_ = std::move(*file);
      torn_count_ = content.torn_count;
      for (Incident& incident : content.incidents)
        book_.restore(std::move(incident));
    } else {
      problem_ = file.error().text();
    }
  }
  return thread_.start("console-keep", kKeepInterval, [this] {
    look_at_disks();
    keep();
  });
}

void IncidentDesk::observe(const Json& state, MonotonicTime now) {
  incidents::Moment moment{.time = now, .utc_ns = rt::utc_ns(now)};
  const auto recording = state.find("recording");
  if (recording != state.end()) moment.recording = fields::text(*recording, "file");
  const CauseFinder::Found found = finder_.find(state, disks_, moment);
  book_.observe(found.lasting, moment);
  for (const incidents::Cause& cause : found.events)
    book_.happen(cause, moment);
  std::vector<Incident> changed = book_.take_changed();
  if (changed.empty() || config_.file.empty()) return;
  const std::lock_guard lock(mutex_);
  for (Incident& incident : changed)
    to_write_[incident.id] = std::move(incident);
}

void IncidentDesk::look_at_disks() {
  std::vector<DiskSpace> disks;
  for (const std::filesystem::path& folder :
       {config_.recordings, std::filesystem::path(config_.file).parent_path()}) {
    if (folder.empty()) continue;
    std::error_code code;
    const auto space = std::filesystem::space(folder, code);
    if (!code) disks.push_back({folder.string(), space.available});
  }
  post_([this, disks = std::move(disks)] { disks_ = disks; });
}

void IncidentDesk::keep() {
  if (!file_) return;
  std::map<std::uint64_t, Incident> taken;
  {
    const std::lock_guard lock(mutex_);
    taken.swap(to_write_);
  }
  std::vector<Incident> list;
  for (const auto& [id, incident] : taken)
    list.push_back(incident);
  std::string problem;
  if (auto appended = file_->append(list); !appended) {
    problem = appended.error().text();
    const std::lock_guard lock(mutex_);
    // Those that have changed meanwhile are newer.
    to_write_.merge(taken);
  }
  std::vector<IncidentFile::Acknowledgement> others = file_->read_others();
  if (problem.empty() && file_->is_long()) {
    const auto content = incidents::read_file(file_->path());
    const auto rewritten = content ? file_->rewrite(content->incidents)
                                   : expected<void, SetupError>(unexpected{content.error()});
    if (!rewritten) problem = rewritten.error().text();
  }
  post_([this, problem = std::move(problem), others = std::move(others)] {
    problem_ = problem;
    for (const IncidentFile::Acknowledgement& each : others)
      static_cast<void>(book_.acknowledge(each.id, each.person, each.utc_ns));
  });
}

std::string IncidentDesk::list_json(const std::vector<const Incident*>& list) const {
  std::string text = R"({"incidents":[)";
  for (const Incident* const incident : list) {
    if (incident != list.front()) text += ",";
    text += incidents::to_json(*incident);
  }
  Json rest{{"count", book_.all().size()}, {"dropped_count", book_.dropped_count()}};
  return text + "]," + foxglove::dumped(rest).substr(1);
}

Json IncidentDesk::state_json() const {
  return {{"open_count", book_.open_count()},
          {"unseen_count", book_.unseen_count()},
          {"unseen_alarm", book_.newest_unseen_alarm()},
          {"torn_count", torn_count_},
          {"is_kept", !config_.file.empty()},
          {"problem", problem_}};
}

void IncidentDesk::publish(MonotonicTime now) {
  const std::uint32_t channel = channels_.find(kTopic);
  if (!channels_.has_subscriber(channel)) return;
  std::vector<const Incident*> list;
  for (const auto& [id, incident] : book_.all())
    list.push_back(&incident);
  sort_by_need(list);
  list.resize(std::min(list.size(), kShownCount));
  channels_.publish(channel, rt::utc_ns(now), list_json(list));
}

void IncidentDesk::list(const PendingCall& call, const nlohmann::json& request) {
  const bool wants_open = fields::flag(request, "open");
  const bool wants_unseen = fields::flag(request, "unseen");
  const std::string wanted = lower_case(fields::text(request, "search"));
  std::vector<const Incident*> list;
  for (const auto& [id, incident] : book_.all()) {
    if (wants_open && !incident.is_open()) continue;
    if (wants_unseen && incident.is_acknowledged()) continue;
    const std::string text = incident.who + " " + incident.what + " " + incident.why + " " +
                             incident.acknowledged_by + " " + incident.recording;
    if (lower_case(text).find(wanted) != std::string::npos) list.push_back(&incident);
  }
  sort_by_need(list);
  list.resize(std::min<std::size_t>(list.size(), fields::count(request, "limit", kIdCountMax)));
  router_.succeed(call, std::string_view(list_json(list)));
}

void IncidentDesk::acknowledge(const PendingCall& call, const nlohmann::json& request) {
  const std::string person = name_of_(call.connection_id);
  if (person.empty()) {
    return router_.fail(call, "an acknowledgement has a name; state yours by console/operator");
  }
  std::vector<std::uint64_t> ids;
  const auto given = request.find("ids");
  if (const std::uint64_t id = fields::count(request, "id", 0); id != 0) ids.push_back(id);
  if (given != request.end() && given->is_array()) {
    for (const nlohmann::json& one : *given) {
      if (one.is_number_unsigned() && ids.size() < kIdCountMax) {
        ids.push_back(one.get<std::uint64_t>());
      }
    }
  }
  if (fields::flag(request, "all")) {
    for (const auto& [id, incident] : book_.all())
      ids.push_back(id);
  }
  if (ids.empty()) return router_.fail(call, "name an `id`, `ids`, or `all`");
  const std::uint64_t now_ns = rt::utc_ns(rt::now());
  std::size_t count = 0;
  for (const std::uint64_t id : ids) {
    if (book_.acknowledge(id, person, now_ns)) ++count;
  }
  router_.succeed(call, Json{{"acknowledged", count}});
}

void IncidentDesk::stop() {
  thread_.stop();
  for (Incident& incident : book_.take_changed())
    to_write_[incident.id] = std::move(incident);
  if (!file_) return;
  std::vector<Incident> list;
  for (auto& [id, incident] : to_write_)
    list.push_back(std::move(incident));
  // The page told each failure before.
  static_cast<void>(file_->append(list));
  file_.reset();
}

}  // namespace rtpm::console
