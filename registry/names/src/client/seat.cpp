#include "client/seat.hpp"

#include <algorithm>

#include "rtpm/rt/clock.hpp"

namespace rtpm::names {
namespace {

constexpr Duration kUnbindDeadline = std::chrono::milliseconds{200};

}  // namespace

Seat::Seat(rpc::Node& node, const std::string& service_url)
    : node_(node), service_(node, service_url, kDeadline) {}

expected<void, DirectoryError> Seat::bind(const Offer& offer, bool allows_takeover) {
  Claim claim{offer.name, offer.url, offer.interface, offer.owner, offer.lease};
  claim.properties = offer.properties;
  claim.allows_takeover = allows_takeover;
  const auto granted = service_.bind(claim, /*replaces=*/allows_takeover);
  if (!granted) return unexpected{granted.error()};
  const std::lock_guard lock(mutex_);
  first_lease_ = granted->lease > Duration{0} ? std::min(granted->lease, offer.lease) : offer.lease;
  // Taken after the registry's own time, so this estimate is never early.
  if (granted->revision != revision_ || bound_ == MonotonicTime{}) bound_ = rt::now();
  revision_ = granted->revision;
  return {};
}

expected<void, DirectoryError> Seat::renew(const Offer& offer) {
  // Two attempts may fail before the name is lost.
  const Duration deadline = std::min(lease(rt::now(), offer.lease) / 3, kDeadline);
  auto kept = service_.renew(offer.name, offer.owner, offer.lease, deadline);
  // The registry restarted, the lease expired, or another owner took the name: bind() shows which.
  return !kept && kept.error().outcome ? bind(offer) : kept;
}

void Seat::unbind(const Offer& offer) {
  static_cast<void>(
      Service(node_, service_.url(), kUnbindDeadline).unbind(offer.name, offer.owner, 0));
}

Duration Seat::lease(MonotonicTime now, Duration wanted) {
  const std::lock_guard lock(mutex_);
  return now - bound_ < first_lease_ ? first_lease_ : wanted;
}

}  // namespace rtpm::names
