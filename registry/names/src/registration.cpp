#include "rtpm/names/registration.hpp"

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <mutex>
#include <utility>

#include "rtpm/names/directory.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/log.hpp"
#include "rtpm/rt/thread.hpp"

namespace rtpm::names {
namespace {

using namespace std::chrono_literals;

/// How long a registration waits for the lease of a dead holder to end.
constexpr Duration kHolderWaitMax = 5s;
/// How long the registry may take to unbind at the end of a registration.
constexpr Duration kUnbindDeadline = 200ms;
/// How long the first bind may take.
constexpr Duration kBindDeadline = 1s;

/// Shared by the registrations of a program.
void report_to_standard_error(std::string_view sentence) {
  static auto* const log = new rt::Log("");
  log->write(sentence);
}

bool is_held_by_another(const DirectoryError& error) {
  return error.outcome == Outcome::kAlreadyBound || error.outcome == Outcome::kStaleEpoch;
}

}  // namespace

class Registration::Impl {
 public:
  Impl(rpc::Node& node, std::string registry_url, std::string name, std::string url,
       std::string interface, Duration lease, Report report, Takeover takeover,
       std::vector<Property> properties)
      : node_(node),
        registry_url_(std::move(registry_url)),
        name_(std::move(name)),
        url_(std::move(url)),
        interface_(std::move(interface)),
        owner_(owner_of(url_)),
        lease_(lease),
        report_(report ? std::move(report) : report_to_standard_error),
        takeover_(takeover),
        properties_(std::move(properties)) {}

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
    if (!is_bound_) return;
    // Without an answer the lease expires by itself.
    static_cast<void>(Directory(node_, registry_url_, kUnbindDeadline).unbind(name_, owner_));
  }

  /// Binds for the first time, waiting for the lease of a possibly dead holder.
  [[nodiscard]] expected<void, SetupError> begin() {
    Directory directory(node_, registry_url_, kBindDeadline);
    auto bound = bind(directory);
    if (!bound && is_held_by_another(bound.error()) && takeover_ == Takeover::kAllowed) {
      bound = bind(directory, Takeover::kAllowed);
    }
    if (!bound && is_held_by_another(bound.error()) &&
        bound.error().holder_lease_left <= kHolderWaitMax) {
      rt::sleep_until(rt::now() + bound.error().holder_lease_left + 1ms);
      bound = bind(directory);
    }
    if (!bound) return unexpected{std::move(bound.error())};
    is_bound_ = true;
    auto thread = rt::Thread::start({.name = "rtpm-lease", .realtime = rt::RealtimeMode::kOff},
                                    [this] { keep(); });
    if (!thread) return unexpected{std::move(thread.error())};
    thread_ = std::move(*thread);
    return {};
  }

  [[nodiscard]] bool is_bound() const noexcept { return is_bound_; }

  [[nodiscard]] expected<void, SetupError> set_properties(std::vector<Property> properties) {
    {
      const std::lock_guard lock(mutex_);
      properties_ = std::move(properties);
    }
    Directory directory(node_, registry_url_, kBindDeadline);
    auto bound = bind(directory);
    if (!bound) return unexpected{std::move(bound.error())};
    return {};
  }

 private:
  [[nodiscard]] expected<void, DirectoryError> bind(Directory& directory,
                                                    Takeover takeover = Takeover::kRefused) {
    std::vector<Property> properties;
    {
      const std::lock_guard lock(mutex_);
      properties = properties_;
    }
    Claim claim{name_, url_, interface_, owner_, lease_};
    claim.properties = properties;
    claim.allows_takeover = takeover == Takeover::kAllowed;
    const auto granted = claim.allows_takeover ? directory.rebind(claim) : directory.bind(claim);
    if (!granted) return unexpected{granted.error()};
    const std::lock_guard lock(mutex_);
    first_lease_ = granted->lease > Duration{0} ? std::min(granted->lease, lease_) : lease_;
    // After the registry did, so that this estimate is never early.
    if (granted->revision != revision_ || bound_ == MonotonicTime{}) bound_ = rt::now();
    revision_ = granted->revision;
    return {};
  }

  /// The lease that the registry grants for a renewal at `now`.
  [[nodiscard]] Duration lease_at(MonotonicTime now) const {
    return now - bound_ < first_lease_ ? first_lease_ : lease_;
  }

  /// Renews every third of the lease, with that as the deadline: two attempts may fail before the
  /// name is lost.
  void keep() {
    std::unique_lock lock(mutex_);
    Directory directory(node_, registry_url_, std::min(first_lease_ / 3, kBindDeadline));
    MonotonicTime next = rt::now();
    for (;;) {
      next = std::max(next + lease_at(next) / 3, rt::now());
      if (ending_.wait_for(lock, next - rt::now(), [this] { return is_ending_; })) return;
      lock.unlock();
      keep_once(directory);
      lock.lock();
    }
  }

  void keep_once(Directory& directory) {
    auto kept = directory.renew(name_, owner_, lease_);
    // The registry restarted, the lease expired, or another owner took the name: bind() tells
    // which.
    if (!kept && kept.error().outcome) kept = bind(directory);
    const bool was_bound = is_bound_.exchange(kept.has_value());
    if (was_bound && !kept) {
      report_("the name '" + name_ + "' is lost, retrying: " + kept.error().text());
    } else if (!was_bound && kept) {
      report_("the name '" + name_ + "' is bound again at " + registry_url_);
    }
  }

  rpc::Node& node_;
  const std::string registry_url_;
  const std::string name_;
  const std::string url_;
  const std::string interface_;
  const Owner owner_;
  const Duration lease_;
  const Report report_;
  const Takeover takeover_;
  std::atomic<bool> is_bound_ = false;
  // Plain: no real-time thread takes it. Guards what follows.
  std::mutex mutex_;
  std::vector<Property> properties_;
  Duration first_lease_{};
  MonotonicTime bound_{};
  std::uint64_t revision_ = 0;  ///< Of the bind at `bound_`.
  std::condition_variable ending_;
  bool is_ending_ = false;
  rt::Thread thread_;
};

expected<std::unique_ptr<Registration>, SetupError> Registration::create(
    rpc::Node& node, std::string registry_url, std::string name, std::string url,
    std::string interface, Duration lease, Report report, Takeover takeover,
    std::vector<Property> properties) {
  auto impl = std::make_unique<Impl>(node, std::move(registry_url), std::move(name), std::move(url),
                                     std::move(interface), lease, std::move(report), takeover,
                                     std::move(properties));
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
