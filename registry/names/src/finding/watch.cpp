#include <algorithm>
#include <condition_variable>
#include <map>
#include <mutex>
#include <set>
#include <utility>

#include "client/service_watch.hpp"
#include "finding/name_views.hpp"
#include "model/query.hpp"
#include "rtpm/discovery/finder.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/thread.hpp"

namespace rtpm::names {
namespace {

using namespace std::chrono_literals;

/// Interval between searches for name services.
constexpr Duration kHostInterval = 250ms;
constexpr Duration kLanInterval = 5s;
/// The delay before a failed service is retried.
constexpr Duration kRetryInterval = 2s;
/// How long a registry's names stay after it ended or stopped answering.
constexpr Duration kGrace = 2s;

/// A watch at the name services of a scope.
class FoundWatch final : public NameWatch::Impl {
 public:
  FoundWatch(rpc::Node& node, discovery::Scope scope, WatchConfig config, WatchHandlers handlers)
      : node_(node),
        scope_(std::move(scope)),
        handlers_(std::move(handlers)),
        config_(std::move(config)) {}
  ~FoundWatch() override {
    {
      const std::lock_guard lock(mutex_);
      is_stopping_ = true;
    }
    ending_.notify_all();
    if (thread_.is_running()) thread_.join();
    // Waits for their running handlers.
    services_.clear();
  }

  [[nodiscard]] expected<void, DirectoryError> begin() override {
    if (const auto parsed = parse_predicate({}, config_.interface, config_.predicate); !parsed) {
      DirectoryError error{{"the predicate is no predicate", parsed.error().error.what},
                           parsed.error().outcome};
      error.text_error = parsed.error().error;
      return unexpected{std::move(error)};
    }
    if (auto looked = look(); !looked) return looked;
    if (services_.empty()) notify("no name service is found yet");
    auto thread = rt::Thread::start({.name = "rtpm-find", .realtime = rt::RealtimeMode::kOff},
                                    [this] { run(); });
    if (!thread) return unexpected{DirectoryError{std::move(thread.error())}};
    thread_ = std::move(*thread);
    return {};
  }

  void set_names(std::vector<std::string> names) override {
    const std::lock_guard changing(changing_);
    {
      const std::lock_guard lock(mutex_);
      config_.names = names;
    }
    for (const auto& [url, service] : services_) {
      if (service.watch) service.watch->set_names(names);
    }
  }

  [[nodiscard]] std::uint64_t revision() const noexcept override {
    return sum([](const NameWatch& watch) { return watch.revision(); });
  }
  [[nodiscard]] std::uint64_t state_count() const noexcept override {
    return sum([](const NameWatch& watch) { return watch.state_count(); });
  }
  [[nodiscard]] bool is_connected() const noexcept override {
    return sum([](const NameWatch& watch) { return std::uint64_t{watch.is_connected()}; }) > 0;
  }

 private:
  struct Watched {
    std::unique_ptr<NameWatch> watch{};  ///< Null if it could not be started.
    bool is_registry = false;
    MonotonicTime tried{};
    MonotonicTime seen{};  ///< When it was last found.
  };

  template <class Value>
  [[nodiscard]] std::uint64_t sum(Value value) const noexcept {
    const std::lock_guard changing(changing_);
    std::uint64_t total = 0;
    for (const auto& [url, service] : services_)
      total += service.watch ? value(*service.watch) : 0;
    return total;
  }

  void run() {
    std::string trouble;
    const Duration interval = scope_.is_of_lan() ? kLanInterval : kHostInterval;
    for (;;) {
      {
        std::unique_lock lock(mutex_);
        if (ending_.wait_for(lock, interval, [this] { return is_stopping_; })) return;
      }
      const auto looked = look();
      const std::string now = looked ? std::string() : looked.error().reason();
      if (std::exchange(trouble, now) != now && !now.empty()) notify(now);
    }
  }

  /// Starts watches of new services, and ends those of services that are gone.
  [[nodiscard]] expected<void, DirectoryError> look() {
    const auto found = discovery::find_services(scope_);
    if (!found) return unexpected{DirectoryError{found.error()}};
    for (const std::string& sentence : found->notes)
      notify_once(sentence);
    const MonotonicTime now = rt::now();
    for (const discovery::FoundService& each : found->services) {
      if (auto seen = see(each, now); !seen) return seen;
    }
    std::vector<std::string> ended;
    for (const auto& [url, service] : services_) {
      const bool is_away = service.seen < now;
      if (is_away && (!service.is_registry || now - service.seen > kGrace)) ended.push_back(url);
    }
    for (const std::string& url : ended)
      end(url);
    return {};
  }

  /// @errors   of the watched services; a service that does not answer is not an error
  [[nodiscard]] expected<void, DirectoryError> see(const discovery::FoundService& found,
                                                   MonotonicTime now) {
    const auto known = services_.find(found.url);
    if (known != services_.end() && known->second.watch) {
      // A service that no longer answers counts as ended; its watch keeps trying meanwhile.
      if (known->second.watch->is_connected() || now - known->second.seen > kGrace) {
        const bool is_lost = !known->second.watch->is_connected();
        known->second.seen = now;
        if (is_lost) end(found.url);
      }
      return {};
    }
    if (known != services_.end() && now - known->second.tried < kRetryInterval) {
      known->second.seen = now;
      return {};
    }
    Watched watched{.is_registry = found.is_registry, .tried = now, .seen = now};
    auto started = start(found.url);
    if (started) {
      watched.watch = std::move(*started);
    } else if (started.error().outcome && started.error().outcome != Outcome::kTooManyWatches) {
      return unexpected{std::move(started.error())};
    } else if (!found.is_guess) {
      notify_once(started.error().reason());
    }
    const std::lock_guard changing(changing_);
    services_.insert_or_assign(found.url, std::move(watched));
    return {};
  }

  [[nodiscard]] expected<std::unique_ptr<NameWatch>, DirectoryError> start(const std::string& url) {
    WatchConfig config;
    {
      const std::lock_guard lock(mutex_);
      config = config_;
    }
    config.deadline = std::min<Duration>(config.deadline, 500ms);
    return NameWatch::start(
        node_, url, std::move(config),
        {.on_change = [this, url](const NameChange& change) { take(url, change); },
         .on_state =
             [this] {
               const std::lock_guard telling(telling_);
               if (handlers_.on_state) handlers_.on_state();
             },
         .on_notice = [this](std::string_view sentence) { notify(std::string(sentence)); }});
  }

  void end(const std::string& url) {
    std::unique_ptr<NameWatch> watch;
    {
      const std::lock_guard changing(changing_);
      const auto place = services_.find(url);
      watch = std::move(place->second.watch);
      services_.erase(place);
    }
    watch.reset();
    std::vector<NameEntry> names;
    {
      const std::lock_guard lock(mutex_);
      names = views_.names_of(url);
    }
    for (NameEntry& entry : names)
      take(url, {NameChange::Kind::kGone, std::move(entry)});
  }

  void take(const std::string& url, const NameChange& change) {
    const std::lock_guard telling(telling_);
    NameViews::Told told;
    {
      const std::lock_guard lock(mutex_);
      told = views_.take(url, change);
    }
    if (!told.duplicate.empty() && handlers_.on_notice) handlers_.on_notice(told.duplicate);
    if (told.change && handlers_.on_change) handlers_.on_change(*told.change);
  }

  void notify(const std::string& sentence) {
    const std::lock_guard telling(telling_);
    if (handlers_.on_notice) handlers_.on_notice(sentence);
  }
  void notify_once(const std::string& sentence) {
    constexpr std::size_t kSaidCountMax = 256;
    if (said_.size() < kSaidCountMax && said_.insert(sentence).second) notify(sentence);
  }

  rpc::Node& node_;
  const discovery::Scope scope_;
  const WatchHandlers handlers_;
  // Used by the starting thread, then by the watch's thread.
  std::set<std::string> said_{};
  // All are plain mutexes: no real-time thread locks them.
  /// Guards changes of services_, which only the watch's thread makes.
  mutable std::mutex changing_;
  std::map<std::string, Watched> services_{};
  std::mutex telling_;  ///< Handlers run one at a time.
  std::mutex mutex_;    ///< Guards the members below.
  std::condition_variable ending_;
  WatchConfig config_;
  NameViews views_{};
  bool is_stopping_ = false;
  rt::Thread thread_;
};

}  // namespace

NameWatch::NameWatch(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
NameWatch::~NameWatch() = default;

expected<std::unique_ptr<NameWatch>, DirectoryError> NameWatch::start(rpc::Node& node,
                                                                      std::string where,
                                                                      WatchConfig config,
                                                                      WatchHandlers handlers) {
  auto scope = discovery::parse_scope(where);
  if (!scope) return unexpected{DirectoryError{std::move(scope.error())}};
  std::unique_ptr<Impl> impl;
  if (scope->is_url()) {
    impl = make_service_watch(node, std::move(where), std::move(config), std::move(handlers));
  } else {
    impl = std::make_unique<FoundWatch>(node, std::move(*scope), std::move(config),
                                        std::move(handlers));
  }
  if (auto begun = impl->begin(); !begun) return unexpected{std::move(begun.error())};
  return std::unique_ptr<NameWatch>(new NameWatch(std::move(impl)));
}

void NameWatch::set_names(std::vector<std::string> names) {
  impl_->set_names(std::move(names));
}
std::uint64_t NameWatch::revision() const noexcept {
  return impl_->revision();
}
std::uint64_t NameWatch::state_count() const noexcept {
  return impl_->state_count();
}
bool NameWatch::is_connected() const noexcept {
  return impl_->is_connected();
}

}  // namespace rtpm::names
