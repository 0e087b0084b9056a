#include "rtpm/incidents/book.hpp"

#include <algorithm>

#include "rtpm/base/printable.hpp"

namespace rtpm::incidents {

std::string_view to_string(Severity severity) noexcept {
  switch (severity) {
    case Severity::kInfo:
      return "info";
    case Severity::kWarning:
      return "warning";
    case Severity::kAlarm:
      break;
  }
  return "alarm";
}

void IncidentBook::restore(Incident incident) {
  last_id_ = std::max(last_id_, incident.id);
  if (incident.is_open()) {
    current_[{incident.who, incident.what}] = {.id = incident.id, .is_restored = true};
  }
  incidents_[incident.id] = std::move(incident);
  while (incidents_.size() > kCountMax)
    drop_oldest();
}

void IncidentBook::observe(std::span<const Cause> causes, const Moment& moment) {
  if (!begin_) begin_ = moment.time;
  std::set<Key> seen;
  for (const Cause& cause : causes) {
    const Key key{printable(cause.who, kTextSizeMax), cause.what};
    if (!seen.insert(key).second) continue;
    const auto found = current_.find(key);
    const bool is_known = found != current_.end() &&
                          (!found->second.ended || moment.time - *found->second.ended < kMergeTime);
    if (!is_known) {
      open(cause, moment);
      continue;
    }
    Current& current = found->second;
    Incident& incident = incidents_.at(current.id);
    current.is_restored = false;
    if (current.ended) {
      current.ended.reset();
      incident.until_ns = 0;
      ++incident.count;
      changed_.insert(incident.id);
    }
    if (cause.severity > incident.severity) {
      incident.severity = cause.severity;
      incident.why = printable(cause.why, kTextSizeMax);
      changed_.insert(incident.id);
    }
  }
  const bool is_settled = moment.time - *begin_ >= kRestoredTime;
  for (auto each = current_.begin(); each != current_.end();) {
    auto& [key, current] = *each;
    const bool has_ended = !seen.contains(key) && (is_settled || !current.is_restored);
    if (has_ended && !current.ended) {
      current.ended = moment.time;
      Incident& incident = incidents_.at(current.id);
      // The wall clock may have been set back.
      incident.until_ns = std::max(moment.utc_ns, incident.since_ns + 1);
      changed_.insert(current.id);
    }
    const bool is_over = current.ended && moment.time - *current.ended >= kMergeTime;
    each = is_over ? current_.erase(each) : std::next(each);
  }
}

void IncidentBook::happen(const Cause& cause, const Moment& moment) {
  const auto found = current_.find({printable(cause.who, kTextSizeMax), cause.what});
  const std::string why = printable(cause.why, kTextSizeMax);
  const bool is_same = found != current_.end() && found->second.ended &&
                       moment.time - *found->second.ended < kMergeTime &&
                       (cause.is_sum || incidents_.at(found->second.id).why == why);
  Incident& incident = is_same ? incidents_.at(found->second.id) : open(cause, moment);
  if (is_same) {
    ++incident.count;
    incident.why = why;
  }
  incident.until_ns = std::max(moment.utc_ns, incident.since_ns + 1);
  current_[{incident.who, incident.what}] = {.id = incident.id, .ended = moment.time};
  changed_.insert(incident.id);
}

Incident& IncidentBook::open(const Cause& cause, const Moment& moment) {
  const std::uint64_t id = ++last_id_;
  Incident incident{.id = id,
                    .who = printable(cause.who, kTextSizeMax),
                    .what = cause.what,
                    .why = printable(cause.why, kTextSizeMax),
                    .severity = cause.severity,
                    .since_ns = cause.since_ns == 0 ? moment.utc_ns : cause.since_ns,
                    .recording = moment.recording};
  current_[{incident.who, incident.what}] = {.id = id};
  changed_.insert(id);
  incidents_.emplace(id, std::move(incident));
  while (incidents_.size() > kCountMax)
    drop_oldest();
  return incidents_.at(id);
}

void IncidentBook::drop_oldest() {
  const auto last = std::prev(incidents_.end());
  auto oldest = std::find_if(incidents_.begin(), last, [](const auto& each) {
    const Incident& incident = each.second;
    const bool is_done = incident.is_acknowledged() || incident.severity == Severity::kInfo;
    return is_done && !incident.is_open();
  });
  if (oldest == last) {
    oldest = std::find_if(incidents_.begin(), last,
                          [](const auto& each) { return !each.second.is_open(); });
  }
  if (oldest == last) oldest = incidents_.begin();
  std::erase_if(current_, [&](const auto& each) { return each.second.id == oldest->first; });
  changed_.erase(oldest->first);
  incidents_.erase(oldest);
  ++dropped_count_;
}

bool IncidentBook::acknowledge(std::uint64_t id, std::string_view person, std::uint64_t utc_ns) {
  const auto found = incidents_.find(id);
  if (found == incidents_.end() || found->second.is_acknowledged()) return false;
  found->second.acknowledged_by = printable(person, kPersonSizeMax);
  found->second.acknowledged_ns = utc_ns;
  changed_.insert(id);
  return true;
}

std::vector<Incident> IncidentBook::take_changed() {
  std::vector<Incident> changed;
  for (const std::uint64_t id : changed_)
    changed.push_back(incidents_.at(id));
  changed_.clear();
  return changed;
}

std::size_t IncidentBook::open_count() const noexcept {
  return static_cast<std::size_t>(
      std::ranges::count_if(incidents_, [](const auto& each) { return each.second.is_open(); }));
}

std::size_t IncidentBook::unseen_count() const noexcept {
  return static_cast<std::size_t>(std::ranges::count_if(incidents_, [](const auto& each) {
    return !each.second.is_acknowledged() && each.second.severity != Severity::kInfo;
  }));
}

std::uint64_t IncidentBook::newest_unseen_alarm() const noexcept {
  for (auto each = incidents_.rbegin(); each != incidents_.rend(); ++each) {
    if (!each->second.is_acknowledged() && each->second.severity == Severity::kAlarm) {
      return each->first;
    }
  }
  return 0;
}

}  // namespace rtpm::incidents
