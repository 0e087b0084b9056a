#include "consumer/multicast_session.hpp"

#include <algorithm>
#include <array>
#include <utility>

#include "broadcast/broadcast_group.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::events {
namespace {

using namespace std::chrono_literals;

// Datagrams and records handled per turn, before the handler runs.
constexpr int kDatagramsPerTurn = 256;
constexpr int kRecordsPerTurn = 4096;
// ev-7.3-1: allows for reordering.
constexpr Duration kRepairDelay = 1ms;
constexpr Duration kRepairDeadline = 100ms;
constexpr Duration kRepairPause = 50ms;

}  // namespace

std::optional<MulticastSession::Facts> MulticastSession::ask(HubClient& client,
                                                             const std::string& interface,
                                                             Duration deadline) {
  const auto facts = client.multicast({}, {.priority = 0, .deadline = deadline});
  if (!facts || (*facts)->id() == 0 || (*facts)->group() == nullptr) return std::nullopt;
  return Facts{
      .id = (*facts)->id(),
      .group = {
          .group = (*facts)->group()->str(), .port = (*facts)->port(), .interface = interface}};
}

std::unique_ptr<MulticastSession> MulticastSession::open(const Facts& facts) {
  auto receiver = transport::MulticastReceiver::open(facts.group);
  if (!receiver) return nullptr;
  return std::unique_ptr<MulticastSession>(new MulticastSession(facts.id, std::move(*receiver)));
}

void MulticastSession::begin(std::shared_ptr<HubClient> client, std::uint64_t subscription,
                             std::uint64_t first, const DeliveryPolicy& policy, Priority priority) {
  client_ = std::move(client);
  subscription_ = subscription;
  priority_ = priority;
  reader_.emplace(id_, static_cast<std::uint32_t>(subscription), first);
  group_.reserve(kGroupSizeMax);
  queue_.set_policy(policy);
}

MulticastSession::Outcome MulticastSession::take(const Taker& taker, Asking asking) {
  bool is_all = false;
  while (!is_all && queue_.empty()) {
    is_all = receive();
    if (const auto failed = fill_queue(asking)) return *failed;
  }
  if (queue_.take(taker)) return Outcome::kDelivered;
  return is_gone_ ? Outcome::kGone : Outcome::kNothing;
}

// Receives waiting datagrams, ignoring those of other hubs. False if there may be more.
bool MulticastSession::receive() noexcept {
  if (feed_) {
    position_ = feed_->read(position_, kDatagramsPerTurn, [this](ConstBytes datagram) {
      static_cast<void>(reader_->take(datagram));
    });
    return position_ == feed_->end();
  }
  std::array<std::byte, kMulticastDatagramMax> buffer;
  for (int i = 0; i < kDatagramsPerTurn; ++i) {
    const ConstBytes datagram = receiver_->receive(buffer);
    if (datagram.empty()) return true;
    static_cast<void>(reader_->take(datagram));
  }
  return false;
}

std::optional<MulticastSession::Outcome> MulticastSession::fill_queue(Asking asking) {
  for (bool is_again = true; is_again;) {
    for (int i = 0; i < kRecordsPerTurn && reader_->read(); ++i) {
      const bool is_sound = decode_group(reader_->events(), group_);
      reader_->count_read(group_.size());
      if (!is_sound) return Outcome::kBroken;
      if (!queue_.push(group_)) return Outcome::kFallenBehind;
    }
    const bool was_due = asking == Asking::kNow && rt::now() >= repair_due_;
    repair_if_due(asking);
    is_again = was_due && !is_gone_ && repair_due_ == kNever;
  }
  return std::nullopt;
}

void MulticastSession::repair_if_due(Asking asking) {
  const auto gap = reader_->gap();
  if (!gap) {
    repair_due_ = kNever;
    return;
  }
  const MonotonicTime now = rt::now();
  if (repair_due_ == kNever) repair_due_ = now + kRepairDelay;
  if (now < repair_due_ || asking == Asking::kLater) return;
  repair(*gap);
}

void MulticastSession::repair(const MulticastReader::Gap& gap) {
  const auto reply = client_->repair({subscription_, gap.first, gap.later},
                                     {.priority = priority_, .deadline = kRepairDeadline});
  if (!reply) {
    // The stream reports that the subscription ended, and why.
    repair_due_ = rt::now() + kRepairPause;
    return;
  }
  if (const auto* datagrams = (*reply)->datagrams()) {
    ByteReader reader(std::as_bytes(std::span(datagrams->data(), datagrams->size())));
    while (reader.left() > 0 && reader.ok()) {
      const auto size = reader.take<std::uint32_t>();
      static_cast<void>(reader_->take(reader.take_bytes(size)));
    }
  }
  const RepairFacts& facts = *(*reply)->facts();
  reader_->note(facts.oldest(), facts.next(), facts.written());
  // Requests further missing datagrams at once.
  repair_due_ = reader_->gap() ? rt::now() : kNever;
}

void MulticastSession::wait(rt::WaitStrategy strategy, MonotonicTime until) noexcept {
  until = std::min(until, repair_due_);
  if (strategy == rt::WaitStrategy::kSpin) {
    while (!(has_more_ = wait_for_more(rt::now())) && rt::now() < until) {
    }
    return;
  }
  has_more_ = wait_for_more(until) || repair_due_ <= until;
}

bool MulticastSession::wait_for_more(MonotonicTime until) noexcept {
  if (!feed_) return receiver_->wait(until);
  const std::uint32_t seen = feed_->value();
  if (feed_->end() == position_) feed_->sleep(seen, wake_bits(), until);
  return feed_->end() != position_;
}

Losses MulticastSession::losses() const noexcept {
  Losses losses = queue_.losses();
  losses.unrepaired_count = reader_->missed_count();
  return losses;
}

}  // namespace rtpm::events
