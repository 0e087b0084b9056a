#include <algorithm>
#include <array>
#include <utility>

#include "hub/hub_impl.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/memory.hpp"

// The hub's side of its links.
namespace rtpm::events {

expected<void, SetupError> HubImpl::link(rpc::Node& node, const std::string& target,
                                         const LinkConfig& config) {
  const std::lock_guard links_lock(links_mutex_);
  if (links_.size() >= kLinkCountMax) {
    return setup_error("the hub has " + std::to_string(kLinkCountMax) +
                           " links and can't be linked to '" + target + "'",
                       "", "link hubs in a tree");
  }
  auto guard = links_.empty() ? std::make_unique<RepetitionGuard>() : nullptr;
  if (guard) {
    const std::lock_guard lock(mutex_);
    guard_ = std::move(guard);
  }
  auto link =
      std::make_unique<Link>(static_cast<LinkHost&>(*this), links_.size(), node, target, config);
  if (auto started = link->start(); !started) return unexpected{std::move(started.error())};
  links_.push_back(std::move(link));
  return {};
}

std::vector<LinkStatus> HubImpl::links() const {
  const std::lock_guard links_lock(links_mutex_);
  std::vector<LinkStatus> all;
  for (const auto& each : links_)
    all.push_back(each->status());
  const std::lock_guard lock(mutex_);
  for (std::size_t i = 0; i < all.size(); ++i) {
    all[i].taken_count = link_intakes_[i].taken_count;
    all[i].repeated_count = link_intakes_[i].repeated_count;
    all[i].refused_count = link_intakes_[i].refused_count;
  }
  return all;
}

void HubImpl::take_linked(std::size_t link, const EventView& event) noexcept {
  EventView taken = event;
  EventHeader& header = taken.header;
  const WakeAfter wake_after(*this);
  const std::lock_guard lock(mutex_);
  const MonotonicTime now = rt::now();
  LinkIntake& intake = link_intakes_[link];
  // ev-5.1-2: a hub's own events stay there. ev-5.4-2: the other hub has a quota.
  if (header.hops_left == 0 || header.type > kEventTypeMax ||
      !intake.meter.take(event_span(event.payload.size()), now)) {
    ++intake.refused_count;
    return;
  }
  // ev-5.3-1 and ev-5.3-2: drops events that were pushed here, and duplicates from other paths.
  if (intake_.has_tag(header.supplier_tag) || !guard_->admit(header)) {
    ++intake.repeated_count;
    return;
  }
  // ev-5.3-3: an event whose duplicates can't be detected is not forwarded.
  const bool is_known = header.supplier_tag != 0 && header.sequence != 0;
  header.hops_left = is_known ? static_cast<std::uint8_t>(header.hops_left - 1) : std::uint8_t{0};
  header.hub_received = now;
  header.hub_sent = {};
  header.is_replayed = false;
  header.is_continued = false;
  ++(exchange_.offer(taken, now) ? intake.taken_count : intake.refused_count);
  pump_ready(now);
  ring_if_needed(now);
}

// ev-5.5-1
void HubImpl::publish_link_report(std::size_t link, const LinkReport& report) noexcept {
  alignas(16) std::array<std::byte, kLinkReportSize> payload{};
  write_link_report(report, payload);
  const WakeAfter wake_after(*this);
  const std::lock_guard lock(mutex_);
  const MonotonicTime now = rt::now();
  LinkIntake& intake = link_intakes_[link];
  const EventHeader header{.type = kLinkType,
                           .source = static_cast<SourceId>(link),
                           .sequence = ++intake.report_count,
                           .origin = now,
                           .hub_received = now};
  if (!exchange_.publish({header, payload}, now)) ++intake_counters_.no_memory_count;
  pump_ready(now);
  ring_if_needed(now);
}

// ev-5.2-1 and ev-5.2-3
std::vector<Match> HubImpl::interest_set_without(std::uint64_t peer) const {
  std::vector<Match> all;
  {
    const std::lock_guard lock(interest_mutex_);
    for (const auto& [id, interest] : interest_sets_) {
      if (interest.linking_hub != 0 && interest.linking_hub == peer) continue;
      all.insert(all.end(), interest.matches.begin(), interest.matches.end());
    }
  }
  return unite_interest(std::move(all));
}

void HubImpl::add_interest_set(std::uint64_t id, std::vector<Match> matches, std::uint64_t hub) {
  {
    const std::lock_guard lock(interest_mutex_);
    interest_sets_.insert_or_assign(id, InterestSet{std::move(matches), hub});
  }
  notify_links();
}

void HubImpl::change_interest_set(std::uint64_t id, std::vector<Match> matches) {
  {
    const std::lock_guard lock(interest_mutex_);
    const auto found = interest_sets_.find(id);
    if (found == interest_sets_.end()) return;  // The subscription has just ended.
    std::swap(found->second.matches, matches);
  }
  notify_links();
}

// The links notice at their next check: until then, excess interest is harmless.
void HubImpl::remove_interest_set(std::uint64_t id) {
  const std::lock_guard lock(interest_mutex_);
  interest_sets_.erase(id);
}

void HubImpl::notify_links() {
  const std::lock_guard lock(links_mutex_);
  for (const auto& each : links_)
    each->on_interest_changed();
}

std::vector<std::uint64_t> HubImpl::linking_subscriptions() const {
  std::vector<std::uint64_t> ids;
  const std::lock_guard lock(interest_mutex_);
  for (const auto& [id, interest] : interest_sets_) {
    if (interest.linking_hub != 0) ids.push_back(id);
  }
  return ids;
}

}  // namespace rtpm::events
