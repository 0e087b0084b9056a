#include "rtpm/names/registration.hpp"

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <utility>

#include "client/seat.hpp"
#include "finding/own_names.hpp"
#include "finding/service_trust.hpp"
#include "model/properties.hpp"
#include "rtpm/discovery/finder.hpp"
#include "rtpm/discovery/scope.hpp"
#include "rtpm/names/directory.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/log.hpp"
#include "rtpm/rt/thread.hpp"

namespace rtpm::names {
namespace {

using namespace std::chrono_literals;

/// How long a registration waits for the lease of a dead holder to end.
constexpr Duration kHolderWaitMax = 5s;
/// How long a program keeps serving a name after binding it at a registry: watches look for
/// registries every quarter of a second.
constexpr Duration kOwnGrace = 1s;
/// The shortest lease of a name at its own program.
constexpr Duration kOwnLease = 10s;

/// Shared by the registrations of a program.
void report_to_standard_error(std::string_view sentence) {
  static auto* const log = new rt::Log("");
  log->write(sentence);
}

bool is_held_by_another(const DirectoryError& error) {
  return error.outcome == Outcome::kAlreadyBound || error.outcome == Outcome::kStaleEpoch;
}

/// Whether the registry refused because of its own state, not because of the request: names may
/// expire, and space may be freed.
bool is_passing(const DirectoryError& error) {
  switch (error.outcome.value_or(Outcome::kDone)) {
    case Outcome::kFull:
    case Outcome::kOwnerFull:
    case Outcome::kHostFull:
    case Outcome::kHostOwnersFull:
    case Outcome::kOwnerPropertiesFull:
    case Outcome::kPropertiesFull:
    case Outcome::kReadOnly:
    case Outcome::kStorageFull:
    case Outcome::kNotStored:
    case Outcome::kStoreUnreachable:
      return true;
    default:
      return false;
  }
}

}  // namespace

class Registration::Impl {
 public:
  Impl(rpc::Node& node, std::string where, Offer offer, Report report, Takeover takeover)
      : node_(node),
        where_(std::move(where)),
        report_(report ? std::move(report) : report_to_standard_error),
        takeover_(takeover),
        offer_(std::move(offer)) {}

  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;
  ~Impl() {
    if (!thread_.is_running()) return;
    {
      const std::lock_guard lock(mutex_);
      is_ending_ = true;
    }
    ending_.notify_all();
    thread_.join();
    const Offer offer = offer_now();
    if (registry_ && registry_->is_bound) registry_->seat.unbind(offer);
    if (own_ && own_->is_bound) own_->seat.unbind(offer);
  }

  /// Binds for the first time; waits for the lease of a possibly dead holder.
  [[nodiscard]] expected<void, SetupError> begin() {
    auto scope = discovery::parse_scope(where_);
    if (!scope) return unexpected{std::move(scope.error())};
    scope_ = std::move(*scope);
    if (auto bound = begin_at_registry(); !bound) {
      const DirectoryError& error = bound.error();
      // A registry that refuses a request is running.
      const bool is_lasting = scope_.is_url() || error.outcome;
      if (is_lasting && !is_passing(error)) return unexpected{std::move(bound.error())};
      if (is_passing(error)) {
        report_("the name '" + offer_.name + "' is not bound yet, retrying: " + error.text());
      }
    }
    if (needs_own_names()) {
      if (auto bound = begin_at_own_names(); !bound) return bound;
    }
    is_bound_ = !place_in_words().empty();
    auto thread = rt::Thread::start({.name = "rtpm-lease", .realtime = rt::RealtimeMode::kOff},
                                    [this] { keep(); });
    if (!thread) return unexpected{std::move(thread.error())};
    thread_ = std::move(*thread);
    return {};
  }

  [[nodiscard]] bool is_bound() const noexcept { return is_bound_; }

  [[nodiscard]] expected<void, SetupError> set_properties(std::vector<Property> properties) {
    const std::lock_guard setting(setting_);
    Offer offer;
    std::vector<std::shared_ptr<Place>> places;
    {
      const std::lock_guard lock(mutex_);
      offer = offer_;
      for (const auto& place : {registry_, own_}) {
        if (place && place->is_bound) places.push_back(place);
      }
    }
    offer.properties = std::move(properties);
    expected<void, SetupError> result;
    if (places.empty()) result = setup_error("the name '" + offer.name + "' is not bound");
    // A later bind that offers refused properties would lose the name.
    bool is_refused = first_bad_property(offer.properties).has_value();
    for (const auto& place : places) {
      auto bound = place->seat.bind(place->names ? own_offer(offer) : offer);
      if (bound) continue;
      is_refused |= bound.error().outcome.has_value();
      result = unexpected{std::move(bound.error())};
    }
    const std::lock_guard lock(mutex_);
    if (!is_refused) offer_.properties = std::move(offer.properties);
    return result;
  }

 private:
  /// A name service where the name is bound, or was.
  struct Place {
    Place(rpc::Node& node, const std::string& url) : seat(node, url) {}
    std::shared_ptr<OwnNames> names{};  ///< Null for a registry. Outlives its client.
    Seat seat;
    std::atomic<bool> is_bound = false;
  };

  /// Uses a lease that outlasts attempts at a hanging registry: the service ends with the program
  /// anyway.
  [[nodiscard]] static Offer own_offer(Offer offer) {
    offer.lease = std::max(offer.lease, kOwnLease);
    return offer;
  }

  [[nodiscard]] Offer own_offer_now() { return own_offer(offer_now()); }

  [[nodiscard]] Offer offer_now() {
    const std::lock_guard lock(mutex_);
    return offer_;
  }

  /// The registry to bind at, which may not be running. Another user's registry gets no names.
  [[nodiscard]] std::string registry_url() {
    if (scope_.is_url()) return where_;
    const auto found = discovery::find_services(discovery::Scope{});
    if (!found || found->services.empty() || !found->services.front().is_registry) return {};
    const std::string& url = found->services.front().url;
    if (const auto trusted = check_service(node_, url); !trusted) {
      report_once("the name '" + offer_.name + "' does not move to the registry at " + url + ": " +
                  trusted.error().text());
      return {};
    }
    return url;
  }

  [[nodiscard]] std::shared_ptr<Place> place_at(const std::string& url) {
    return std::make_shared<Place>(node_, url);
  }

  void set(std::shared_ptr<Place>& place, std::shared_ptr<Place> to) {
    const std::lock_guard lock(mutex_);
    place.swap(to);
  }

  [[nodiscard]] expected<void, DirectoryError> begin_at_registry() {
    const std::string url = registry_url();
    if (url.empty()) return unexpected{DirectoryError{{"no registry runs on this host"}}};
    const auto place = place_at(url);
    const Offer offer = offer_now();
    auto bound = place->seat.bind(offer);
    if (!bound && is_held_by_another(bound.error()) && takeover_ == Takeover::kAllowed) {
      bound = place->seat.bind(offer, /*allows_takeover=*/true);
    }
    if (!bound && is_held_by_another(bound.error()) &&
        bound.error().holder_lease_left <= kHolderWaitMax) {
      rt::sleep_until(rt::now() + bound.error().holder_lease_left + 1ms);
      bound = place->seat.bind(offer);
    }
    if (!bound) return bound;
    place->is_bound = true;
    set(registry_, place);
    return {};
  }

  /// On the LAN a server is found by its own names, whether or not its host has a registry.
  [[nodiscard]] bool needs_own_names() const {
    return scope_.is_of_lan() || (!scope_.is_url() && !(registry_ && registry_->is_bound));
  }

  [[nodiscard]] expected<void, SetupError> begin_at_own_names() {
    if (auto free = check_that_no_other_has_it(); !free && takeover_ == Takeover::kRefused) {
      return free;
    }
    if (auto bound = bind_at_own_names(); !bound) return bound;
    warn_of_duplicates();
    return {};
  }

  [[nodiscard]] expected<void, SetupError> bind_at_own_names() {
    const Offer offer = own_offer_now();
    auto names = OwnNames::at_host_of(scope_, offer.url, node_.config().served);
    if (!names) return unexpected{std::move(names.error())};
    const auto place = place_at((*names)->url());
    if (auto bound = place->seat.bind(offer); !bound) return unexpected{std::move(bound.error())};
    place->names = std::move(*names);
    place->is_bound = true;
    set(own_, place);
    is_to_look_for_duplicates_ = true;
    return {};
  }

  /// Refuses a name that another server on this host holds, like a registry.
  [[nodiscard]] expected<void, SetupError> check_that_no_other_has_it() {
    const auto entry = Directory(node_, std::string(kThisHost)).resolve(offer_.name);
    if (!entry && entry.error().is_ambiguous) return unexpected{entry.error()};
    if (!entry || entry->url == offer_.url) return {};
    if (!check_service(node_, entry->service_url)) return {};
    return setup_error("the name '" + offer_.name + "' is held by another server of this host",
                       "it leads to " + entry->url, "end that server, or give another name");
  }

  /// Reports once that the name also leads to another server.
  void warn_of_duplicates() {
    const auto entry = Directory(node_, where_).resolve(offer_.name);
    std::string text;
    if (!entry && entry.error().is_ambiguous) text = entry.error().reason();
    if (entry && entry->url != offer_.url) {
      text = "the name '" + offer_.name + "' leads to another server: " + entry->url;
    }
    if (!text.empty()) report_once(text);
  }

  void report_once(const std::string& text) {
    if (std::exchange(said_, text) != text) report_(text);
  }

  /// Renews after each third of the lease.
  void keep() {
    std::unique_lock lock(mutex_);
    MonotonicTime next = rt::now();
    for (;;) {
      // Bounds how late a new or lost registry is noticed, regardless of the lease.
      Duration lease =
          scope_.is_url() ? offer_.lease : std::min(offer_.lease, Registration::kDefaultLease);
      for (const auto& place : {registry_, own_}) {
        if (place) lease = std::min(lease, place->seat.lease(next, offer_.lease));
      }
      next = std::max(next + lease / 3, rt::now());
      if (ending_.wait_for(lock, next - rt::now(), [this] { return is_ending_; })) return;
      lock.unlock();
      keep_once();
      lock.lock();
    }
  }

  void keep_once() {
    const std::string before = place_in_words();
    const bool was_bound = is_bound_;
    auto kept = keep_at_registry();
    if (!scope_.is_url()) keep_own_names(kept);
    const std::string now = place_in_words();
    is_bound_ = !now.empty();
    was_ever_bound_ |= was_bound;
    if (was_bound && !is_bound_) {
      report_("the name '" + offer_.name + "' is lost, retrying: " + kept.error().text());
    } else if (!was_bound && is_bound_) {
      report_("the name '" + offer_.name + "' is bound " + (was_ever_bound_ ? "again at " : "at ") +
              now);
    } else if (before != now) {
      report_("the name '" + offer_.name + "' is now bound at " + now + ", no more at " + before);
    }
  }

  [[nodiscard]] expected<void, DirectoryError> keep_at_registry() {
    const std::string url = registry_url();
    if (registry_ && registry_->seat.url() != url) {
      // The registry is gone; another one may replace it.
      registry_->seat.unbind(offer_now());
      set(registry_, nullptr);
    }
    if (url.empty()) return unexpected{DirectoryError{{"no registry runs on this host"}}};
    auto place = registry_ ? registry_ : place_at(url);
    auto kept = place->is_bound || scope_.is_url() ? place->seat.renew(offer_now())
                                                   : place->seat.bind(offer_now());
    place->is_bound = kept.has_value();
    if (kept || scope_.is_url()) {
      set(registry_, place);
    } else {
      if (kept.error().outcome) warn_of_refusal(kept.error());
      set(registry_, nullptr);
    }
    return kept;
  }

  /// Warns that the registry refuses the name. If another server has the name there, it leads to
  /// both.
  void warn_of_refusal(const DirectoryError& error) {
    report_once("the registry does not take the name '" + offer_.name +
                "' from this server: " + error.reason());
  }

  void keep_own_names(const expected<void, DirectoryError>& at_registry) {
    if (!needs_own_names()) {
      // Clients that have not found the registry yet still find the name here.
      if (!own_) return;
      own_end_ = std::min(own_end_, rt::now() + kOwnGrace);
      if (rt::now() < own_end_) {
        static_cast<void>(own_->seat.renew(own_offer_now()));
        return;
      }
      own_->seat.unbind(offer_now());
      set(own_, nullptr);
      return;
    }
    own_end_ = kNever;
    if (!own_) {
      if (auto bound = bind_at_own_names(); !bound && at_registry) {
        report_once(bound.error().text());
      }
      return;
    }
    own_->names->keep();
    own_->is_bound = own_->seat.renew(own_offer_now()).has_value();
    if (std::exchange(is_to_look_for_duplicates_, false)) warn_of_duplicates();
  }

  /// Where the name is bound; empty if nowhere.
  [[nodiscard]] std::string place_in_words() const {
    if (registry_ && registry_->is_bound) return registry_->seat.url();
    if (own_ && own_->is_bound) return own_->seat.url() + ", which this program serves itself";
    return {};
  }

  rpc::Node& node_;
  const std::string where_;
  discovery::Scope scope_{};
  const Report report_;
  const Takeover takeover_;
  std::atomic<bool> is_bound_ = false;
  bool was_ever_bound_ = false;
  // Used by the starting thread, then by the lease thread.
  bool is_to_look_for_duplicates_ = false;
  MonotonicTime own_end_ = kNever;  ///< When its own service of the name ends.
  std::string said_{};
  // The mutexes are not for real-time threads.
  std::mutex setting_;  ///< Lets one set_properties() run at a time.
  std::mutex mutex_;    ///< Guards the members below.
  Offer offer_;
  std::shared_ptr<Place> registry_{};  ///< Null if there is none. The lease thread replaces it.
  /// Null if this program serves no names itself. The lease thread replaces it.
  std::shared_ptr<Place> own_{};
  std::condition_variable ending_;
  bool is_ending_ = false;
  rt::Thread thread_;
};

expected<std::unique_ptr<Registration>, SetupError> Registration::create(
    rpc::Node& node, std::string where, std::string name, std::string url, std::string interface,
    Duration lease, Report report, Takeover takeover, std::vector<Property> properties) {
  const Owner owner = owner_of(url);
  auto impl = std::make_unique<Impl>(node, std::move(where),
                                     Offer{std::move(name), std::move(url), std::move(interface),
                                           owner, lease, std::move(properties)},
                                     std::move(report), takeover);
  if (auto begun = impl->begin(); !begun) return unexpected{std::move(begun.error())};
  return std::unique_ptr<Registration>(new Registration(std::move(impl)));
}

Registration::Registration(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
Registration::~Registration() = default;

expected<void, SetupError> Registration::set_properties(std::vector<Property> properties) {
  return impl_->set_properties(std::move(properties));
}

bool Registration::is_bound() const noexcept {
  return impl_->is_bound();
}

}  // namespace rtpm::names
