#include "link/link.hpp"

#include <algorithm>
#include <utility>

#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/host.hpp"
#include "rtpm/wire/clock_sync.hpp"

namespace rtpm::events {
namespace {

constexpr std::uint8_t kFlagRestarted = 1;

std::uint32_t sum_of(std::uint32_t a, std::uint32_t b) noexcept {
  return a > kUncertaintyUnknown - b ? kUncertaintyUnknown : a + b;
}

}  // namespace

std::string_view to_string(LinkState state) noexcept {
  switch (state) {
    case LinkState::kConnecting:
      return "connecting";
    case LinkState::kLinked:
      return "linked";
    case LinkState::kInterrupted:
      return "interrupted";
    case LinkState::kRefused:
      break;
  }
  return "refused";
}

// ev-5.5-2
std::optional<LinkReport> read_link_report(ConstBytes payload) noexcept {
  ByteReader reader(payload);
  LinkReport report;
  const auto state = reader.take<std::uint8_t>();
  const auto flags = reader.take<std::uint8_t>();
  const bool has_zeros = reader.take_zeros(6);
  report.gap = Duration{static_cast<std::int64_t>(reader.take<std::uint64_t>())};
  report.lost_count = reader.take<std::uint64_t>();
  report.state = static_cast<LinkState>(state);
  report.has_peer_restarted = (flags & kFlagRestarted) != 0;
  const bool is_sound = reader.ok() && has_zeros && payload.size() == kLinkReportSize &&
                        state <= static_cast<std::uint8_t>(LinkState::kRefused) &&
                        (flags & ~kFlagRestarted) == 0;
  if (!is_sound) return std::nullopt;
  return report;
}

void write_link_report(const LinkReport& report, MutableBytes to) noexcept {
  ByteWriter writer(to);
  writer.put(static_cast<std::uint8_t>(report.state));
  writer.put(static_cast<std::uint8_t>(report.has_peer_restarted ? kFlagRestarted : 0));
  writer.put_zeros(6);
  writer.put(static_cast<std::uint64_t>(report.gap.count()));
  writer.put(report.lost_count);
}

Link::Link(LinkHost& host, std::size_t number, rpc::Node& node, std::string target,
           LinkConfig config)
    : host_(host),
      number_(number),
      node_(node),
      target_(std::move(target)),
      config_(std::move(config)) {
  status_.target = target_;
  status_.reason = "It is being made.";
}

expected<void, SetupError> Link::start() {
  auto thread = rt::Thread::start({.name = "rtpm-link", .realtime = rt::RealtimeMode::kOff},
                                  [this] { run(); });
  if (!thread) return unexpected{std::move(thread.error())};
  thread_ = std::move(*thread);
  return {};
}

Link::~Link() {
  if (!thread_.is_running()) return;
  {
    const std::lock_guard lock(mutex_);
    is_stopping_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

void Link::on_interest_changed() {
  {
    const std::lock_guard lock(mutex_);
    has_changed_ = true;
  }
  changed_.notify_all();
}

LinkStatus Link::status() const {
  const std::lock_guard lock(mutex_);
  return status_;
}

void Link::run() {
  std::uint64_t reported_lost_count = 0;
  std::unique_lock lock(mutex_);
  while (!is_stopping_) {
    has_changed_ = false;
    lock.unlock();
    attend();
    lock.lock();
    const std::uint64_t lost_count = status_.losses.total();
    if (lost_count != reported_lost_count) {
      reported_lost_count = lost_count;
      const LinkReport report{.state = status_.state, .lost_count = lost_count};
      lock.unlock();
      host_.publish_link_report(number_, report);
      lock.lock();
    }
    changed_.wait_for(lock, config_.attend_interval,
                      [this] { return has_changed_ || is_stopping_; });
  }
  lock.unlock();
  consumer_.reset();
}

void Link::attend() {
  bool has_ended = false;
  {
    const std::lock_guard lock(mutex_);
    has_ended = std::exchange(has_ended_, false);
    if (has_ended) earlier_losses_ = status_.losses;
  }
  if (has_ended) {
    consumer_.reset();
    return;  // Retries after the interval.
  }
  if (!reach_peer()) return;
  if (consumer_ == nullptr) {
    subscribe();
  } else {
    update_interest_set();
  }
}

// Reads the other hub's epoch and clock; false if it does not answer.
bool Link::reach_peer() {
  const auto fail = [this](std::string why) {
    client_.reset();
    if (consumer_ == nullptr) set_state(LinkState::kConnecting, std::move(why));
    return false;
  };
  if (!client_) {
    auto client = HubClient::bind(
        node_, target_,
        {.transport = config_.transport, .deadline = config_.deadline, .warm_up = {0}});
    if (!client) return fail(std::move(client.error().text()));
    client_.emplace(std::move(*client));
  }
  const auto facts = client_->about({}, {.priority = 0, .deadline = config_.deadline});
  if (!facts) return fail(std::string(rpc::to_string(facts.error())));
  if (facts->epoch() == host_.host_epoch()) {
    client_.reset();
    set_state(LinkState::kRefused, "A hub is not linked to itself.");
    return false;
  }
  read_clock(*facts);
  const std::lock_guard lock(mutex_);
  status_.peer_epoch = facts->epoch();
  return true;
}

void Link::read_clock(const HubFacts& facts) {
  PeerTime time;
  if (facts.clock_domain() != rt::clock_domain() || facts.clock_domain() == 0) {
    const auto peer = client_->binding().ping({.priority = 0});
    if (!peer) return;
    const bool is_known = peer->uncertainty != Duration::max();
    time.offset = is_known ? peer->offset : Duration{0};
    time.uncertainty_ns = static_cast<std::uint32_t>(
        std::clamp<std::int64_t>(peer->uncertainty.count(), 0, kUncertaintyUnknown));
  }
  peer_time_.write(time);
}

void Link::subscribe() {
  ConsumerConfig wanted;
  wanted.name = config_.name;
  asked_ = host_.interest_set_without(status().peer_epoch);
  wanted.filter = listed(asked_);
  // ev-5.4-1: events that this hub can't accept wait at the other hub, in a bounded queue.
  wanted.delivery = {.queue_capacity = config_.queue_capacity};
  wanted.priority = config_.priority;
  wanted.cpus = config_.cpus;
  wanted.realtime = config_.realtime;
  wanted.transport = config_.transport;
  wanted.shared_ring = config_.shared_ring;
  wanted.miss_count_max = config_.miss_count_max;
  wanted.linking_hub = host_.host_epoch();
  wanted.deadline = config_.deadline;
  auto consumer = Consumer::create(node_, target_, std::move(wanted), *this);
  if (!consumer) return set_state(LinkState::kRefused, std::move(consumer.error().text()));
  consumer_ = std::move(*consumer);
  const std::lock_guard lock(mutex_);
  status_.interest_count = asked_.size();
}

// ev-5.2-1: requests exactly the current interest.
void Link::update_interest_set() {
  std::vector<Match> wanted = host_.interest_set_without(status().peer_epoch);
  if (wanted == asked_ || !consumer_->is_subscribed()) return;
  const auto changed =
      consumer_->change(listed(wanted), {.queue_capacity = config_.queue_capacity});
  const std::lock_guard lock(mutex_);
  if (!changed) {
    status_.reason = changed.error().text();
    return;
  }
  asked_ = std::move(wanted);
  status_.interest_count = asked_.size();
  if (status_.state == LinkState::kLinked) status_.reason.clear();
}

void Link::set_state(LinkState state, std::string reason) {
  const std::lock_guard lock(mutex_);
  status_.state = state;
  status_.reason = std::move(reason);
}

void Link::on_events(std::span<const EventView> events) {
  const PeerTime peer = peer_time_.read().value_or(PeerTime{});
  for (EventView event : events) {
    event.header.origin -= peer.offset;
    event.header.origin_uncertainty_ns =
        sum_of(event.header.origin_uncertainty_ns, peer.uncertainty_ns);
    host_.take_linked(number_, event);
  }
}

void Link::on_notice(const Notice& notice) {
  LinkReport report;
  {
    const std::lock_guard lock(mutex_);
    status_.losses = earlier_losses_;
    status_.losses.add(notice.losses);
    switch (notice.kind) {
      case NoticeKind::kSubscribed:
      case NoticeKind::kResubscribed:
        status_.state = LinkState::kLinked;
        status_.reason.clear();
        status_.peer_epoch = notice.hub_epoch;
        if (notice.kind == NoticeKind::kResubscribed) status_.last_gap = notice.gap;
        break;
      case NoticeKind::kInterrupted:
        status_.state = LinkState::kInterrupted;
        status_.reason = notice.text;
        ++status_.interruption_count;
        break;
      case NoticeKind::kEnded:
        if (is_stopping_) return;
        status_.state = LinkState::kRefused;
        status_.reason = notice.text;
        has_ended_ = true;
        break;
      default:
        // The thread reports losses, at most once per interval.
        return;
    }
    report = {status_.state, notice.has_hub_restarted, notice.gap, status_.losses.total()};
    has_changed_ = true;
  }
  changed_.notify_all();
  host_.publish_link_report(number_, report);
}

}  // namespace rtpm::events
