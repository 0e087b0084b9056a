#include "client/service_watch.hpp"

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <utility>

#include "client/no_answer.hpp"
#include "model/idl.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/names/registry_list.hpp"
#include "rtpm/rpc/tables.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/thread.hpp"

namespace rtpm::names {
namespace {

using namespace std::chrono_literals;

// How long one poll of the stream waits, which bounds how soon the watch ends or applies new names.
constexpr Duration kPollMax = 50ms;
// Pause between attempts to reach the registry; a restarted one is usually up within a second.
constexpr Duration kRetryFirst = 20ms;
constexpr Duration kRetryMax = 1s;

using Stream = rpc::TableStream<WatchItem>;

/// A watch at one name service.
class ServiceWatch final : public NameWatch::Impl {
 public:
  ServiceWatch(rpc::Node& node, std::string registry_url, WatchConfig config,
               WatchHandlers handlers)
      : node_(node),
        registries_(registries_of(registry_url)),
        handlers_(std::move(handlers)),
        config_(std::move(config)) {}
  ~ServiceWatch() override {
    {
      const std::lock_guard lock(mutex_);
      is_stopping_ = true;
    }
    ending_.notify_all();
    if (thread_.is_running()) thread_.join();
  }

  [[nodiscard]] expected<void, DirectoryError> begin() override {
    // All attempts together take no longer than the caller waits.
    config_.deadline /= static_cast<Duration::rep>(registries_.size());
    auto opened = open();
    for (std::size_t i = 1; !opened && i < registries_.size(); ++i) {
      next_registry();
      opened = open();
    }
    if (!opened) return unexpected{std::move(opened.error())};
    stream_.emplace(std::move(*opened));
    auto thread = rt::Thread::start({.name = "rtpm-watch", .realtime = rt::RealtimeMode::kOff},
                                    [this] { run(); });
    if (!thread) return unexpected{DirectoryError{std::move(thread.error())}};
    thread_ = std::move(*thread);
    return {};
  }

  void set_names(std::vector<std::string> names) override {
    const std::lock_guard lock(mutex_);
    config_.names = std::move(names);
    has_new_names_ = true;
  }

  [[nodiscard]] std::uint64_t revision() const noexcept override { return revision_; }
  [[nodiscard]] std::uint64_t state_count() const noexcept override { return state_count_; }
  [[nodiscard]] bool is_connected() const noexcept override { return is_connected_; }

 private:
  [[nodiscard]] const std::string& registry_url() const { return registries_[which_]; }
  void next_registry() { which_ = (which_ + 1) % registries_.size(); }

  /// Opens a stream and receives its first item.
  [[nodiscard]] expected<Stream, DirectoryError> open() {
    WatchConfig config;
    {
      const std::lock_guard lock(mutex_);
      config = config_;
      has_new_names_ = false;
    }
    auto client = NamesClient::bind(node_, registry_url(), {.deadline = config.deadline});
    if (!client) return unexpected{no_answer(registry_url(), client.error())};
    WatchRequestT request;
    request.directory = config.directory;
    request.names = config.names;
    request.interface = config.interface;
    request.predicate = config.predicate;
    request.history = history_;
    request.after = revision_;
    auto stream = client->watch(request);
    const auto first = stream
                           ? stream->next(rt::now() + config.deadline)
                           : expected<const WatchItem*, rpc::CallError>(unexpected{stream.error()});
    if (!first || *first == nullptr) {
      const auto why = first ? "it ended the watch" : std::string(rpc::to_string(first.error()));
      return unexpected{
          DirectoryError{{"the registry at " + registry_url() + " does not serve watches", why}}};
    }
    if (outcome_of(*(*first)->answer()) != Outcome::kDone) return refused(**first, config);
    client_.emplace(std::move(*client));
    first_ = *first;
    return std::move(*stream);
  }

  [[nodiscard]] static unexpected<DirectoryError> refused(const WatchItem& item,
                                                          const WatchConfig& config) {
    const Answer& answer = *item.answer();
    DirectoryError error{{outcome_text(outcome_of(answer), config.directory, answer.component())},
                         outcome_of(answer)};
    if (error.outcome == Outcome::kBadPredicate) {
      error.text_error = {item.error_offset(), printable(text_of(item.error_text()))};
      error.why = error.text_error->what;
    }
    return unexpected{std::move(error)};
  }

  void run() {
    for (;;) {
      const std::string why = read();
      is_connected_ = false;
      if (is_over()) return;
      if (!why.empty()) notify(why);
      if (!reopen()) return;
      if (!why.empty()) notify("the registry at " + registry_url() + " is watched again");
    }
  }

  // Receives items until the stream ends. Returns why; empty to change names, or when ending.
  [[nodiscard]] std::string read() {
    is_connected_ = true;
    bool goes_on = take(*first_);
    while (goes_on && !is_over() && !wants_other_names()) {
      const auto item = stream_->next(rt::now() + kPollMax);
      if (item && *item == nullptr) return "the registry at " + registry_url() + " ended the watch";
      if (item) {
        goes_on = take(**item);
      } else if (!stream_->is_open()) {
        return "the registry at " + registry_url() +
               " is not watched: " + std::string(rpc::to_string(item.error()));
      }
    }
    return goes_on ? std::string()
                   : "the registry at " + registry_url() +
                         " cut this watch off as too slow; it resumes behind revision " +
                         std::to_string(revision_);
  }

  [[nodiscard]] bool reopen() {
    stream_.reset();
    is_fresh_ = false;
    fresh_.clear();
    for (Duration pause = kRetryFirst;; pause = std::min(2 * pause, kRetryMax)) {
      if (auto opened = open()) {
        stream_.emplace(std::move(*opened));
        return true;
      }
      next_registry();
      std::unique_lock lock(mutex_);
      if (ending_.wait_for(lock, pause, [this] { return is_stopping_; })) return false;
    }
  }

  // Handles an item; returns whether the watch continues.
  [[nodiscard]] bool take(const WatchItem& item) {
    if (item.phase() == WatchPhase::CutOff) return false;
    const bool is_state = item.phase() == WatchPhase::State || item.phase() == WatchPhase::StateEnd;
    if (is_state && !is_fresh_) {
      is_fresh_ = true;
      history_ = 0;  // Until the state is complete, resumes with the state.
    }
    if (item.changes() != nullptr) {
      for (const Change* change : *item.changes())
        take(*change, is_state);
    }
    if (item.phase() == WatchPhase::StateEnd) end_state();
    note_staleness(duration_of(item.stale_ns()));
    if (!is_state || item.phase() == WatchPhase::StateEnd) {
      history_ = item.history();
      revision_ = item.revision();
    }
    return true;
  }

  void take(const Change& change, bool is_state) {
    NameChange told{NameChange::Kind::kBound, entry_of(*change.entry())};
    const auto known = known_.find(told.entry.name);
    const bool is_known = known != known_.end();
    if (is_state) fresh_.insert(told.entry.name);
    if (change.kind() == ChangeKind::Gone) {
      if (!is_known || known->second.revision >= change.revision()) return;
      told.kind = NameChange::Kind::kGone;
      known_.erase(known);
    } else {
      // A change contained in the state is not reported again; revisions of another history can't
      // be compared.
      const bool is_same = is_known && known->second.history == now_history(is_state) &&
                           known->second.revision >= change.revision();
      if (is_same || (is_known && is_state && known->second.is_as(told.entry))) {
        known->second.history = now_history(is_state);
        if (!is_same) known->second.revision = change.revision();
        return;
      }
      if (is_known) told.kind = NameChange::Kind::kChanged;
      known_.insert_or_assign(told.entry.name,
                              Known{told.entry, change.revision(), now_history(is_state)});
    }
    if (handlers_.on_change) handlers_.on_change(told);
  }

  // Counts states: revisions are only comparable between changes after the same state.
  [[nodiscard]] std::uint64_t now_history(bool is_state) const noexcept {
    return state_count_ + (is_state ? 1 : 0);
  }

  // Names missing from the state are gone.
  void end_state() {
    for (auto known = known_.begin(); known != known_.end();) {
      if (fresh_.contains(known->first)) {
        ++known;
        continue;
      }
      const NameChange gone{NameChange::Kind::kGone, known->second.entry};
      known = known_.erase(known);
      if (handlers_.on_change) handlers_.on_change(gone);
    }
    fresh_.clear();
    is_fresh_ = false;
    ++state_count_;
    if (handlers_.on_state) handlers_.on_state();
  }

  void note_staleness(Duration stale_for) {
    const bool is_stale = stale_for > Duration{0};
    if (std::exchange(is_stale_, is_stale) != is_stale && handlers_.on_stale) {
      handlers_.on_stale(stale_for);
    }
  }
  void notify(const std::string& sentence) {
    if (handlers_.on_notice) handlers_.on_notice(sentence);
  }
  [[nodiscard]] bool is_over() {
    const std::lock_guard lock(mutex_);
    return is_stopping_;
  }
  [[nodiscard]] bool wants_other_names() {
    const std::lock_guard lock(mutex_);
    if (has_new_names_) history_ = 0;  // Requests the state for the new names.
    return has_new_names_;
  }

  /// A name as last reported to the handlers.
  struct Known {
    NameEntry entry{};
    std::uint64_t revision = 0;  ///< Revision of its last change.
    std::uint64_t history = 0;   ///< The number of the state that it belongs to.
    [[nodiscard]] bool is_as(const NameEntry& other) const {
      return entry.url == other.url && entry.interface == other.interface &&
             entry.revision == other.revision && entry.properties == other.properties;
    }
  };

  std::atomic<std::uint64_t> revision_{0};
  std::atomic<std::uint64_t> state_count_{0};
  std::atomic<bool> is_connected_{false};
  rpc::Node& node_;
  const std::vector<std::string> registries_;
  std::size_t which_ = 0;  ///< The watched registry.
  const WatchHandlers handlers_;
  // Used by the starting thread, then by the watch's thread.
  std::optional<NamesClient> client_{};
  std::optional<Stream> stream_{};
  const WatchItem* first_ = nullptr;  ///< The stream's first item, until the next one is read.
  std::uint64_t history_ = 0;
  std::map<std::string, Known, std::less<>> known_{};
  std::set<std::string, std::less<>> fresh_{};  ///< Names of the state so far.
  bool is_fresh_ = false;                       ///< A state is being read.
  bool is_stale_ = false;                       ///< Value in the last item.
  // This mutex is not for real-time threads. Guards the members below.
  std::mutex mutex_;
  std::condition_variable ending_;
  WatchConfig config_;
  bool has_new_names_ = false;
  bool is_stopping_ = false;
  rt::Thread thread_;
};

}  // namespace

std::unique_ptr<NameWatch::Impl> make_service_watch(rpc::Node& node, std::string url,
                                                    WatchConfig config, WatchHandlers handlers) {
  return std::make_unique<ServiceWatch>(node, std::move(url), std::move(config),
                                        std::move(handlers));
}

}  // namespace rtpm::names
