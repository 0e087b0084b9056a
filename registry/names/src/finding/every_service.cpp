#include "rtpm/names/every_service.hpp"

#include <algorithm>
#include <iterator>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <utility>

#include "client/service.hpp"
#include "rtpm/discovery/finder.hpp"
#include "rtpm/discovery/scope.hpp"
#include "rtpm/names/lapsed.hpp"
#include "rtpm/names/registry_list.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/parallel_jobs.hpp"
#include "rtpm/transport/socket_folder.hpp"

namespace rtpm::names {
namespace {

constexpr std::size_t kAskingThreadCountMax = 128;

/// The URL of other users' registry on this host.
discovery::FoundService usual_registry() {
  return {.url = "rtpm://127.0.0.1:" + std::to_string(discovery::kRegistryPort) + "/" +
                 std::string(discovery::kNamesPath),
          .is_registry = true,
          .is_of_this_host = true,
          .is_guess = true};
}

/// Finds the services of a scope and asks each one.
class Inquiry {
 public:
  /// Asks a service; called concurrently from several threads.
  /// @param is_given  the scope is its URL
  using Question =
      std::function<void(Service&, const discovery::FoundService& found, bool is_given)>;

  Inquiry(rpc::Node& node, MonotonicTime deadline, const Question& question)
      : node_(node), deadline_(deadline), question_(question) {}

  void begin(const discovery::Scope& scope, const std::string& where);

  /// Asks the services in `scope`, each as soon as it is found.
  void find(const discovery::Scope& scope) {
    jobs_.add([this, scope] {
      auto found = discovery::find_services(scope, deadline_);
      if (found) {
        for (const discovery::FoundService& service : found->services)
          ask(service, /*is_given=*/false);
      }
      // After the services that are known to exist.
      if (!transport::has_own_runtime_folder()) ask(usual_registry(), /*is_given=*/false);
      const std::lock_guard lock(mutex_);
      if (!found && !error_) error_ = std::move(found.error());
      if (found) std::ranges::move(found->notes, std::back_inserter(notes_));
    });
  }

  void ask(const discovery::FoundService& service, bool is_given) {
    {
      const std::lock_guard lock(mutex_);
      if (!asked_.insert(service.url).second) return;
    }
    jobs_.add([this, service, is_given] {
      Service client(node_, service.url, std::max(deadline_ - rt::now(), Duration{0}));
      question_(client, service, is_given);
    });
  }

  [[nodiscard]] expected<void, SetupError> finish() {
    jobs_.finish();
    if (error_) return unexpected{std::move(*error_)};
    return {};
  }
  /// The services left out, after finish().
  [[nodiscard]] const std::vector<std::string>& notes() const noexcept { return notes_; }

 private:
  rpc::Node& node_;
  const MonotonicTime deadline_;
  const Question& question_;
  std::mutex mutex_;  ///< Guards the members below; not for real-time threads.
  std::set<std::string> asked_{};
  std::optional<SetupError> error_{};
  std::vector<std::string> notes_{};
  rt::ParallelJobs jobs_{"rtpm-ask", kAskingThreadCountMax};
};

void Inquiry::begin(const discovery::Scope& scope, const std::string& where) {
  if (scope.is_url()) {
    for (const std::string& url : registries_of(where))
      ask({.url = url, .is_registry = true}, /*is_given=*/true);
    return;
  }
  // A LAN query takes time; this host's services do not wait for it.
  find(discovery::Scope{});
  if (scope.is_of_lan()) find(scope);
}

}  // namespace

expected<void, SetupError> ask_every_service(rpc::Node& node, const std::string& where,
                                             MonotonicTime deadline,
                                             const std::function<void(ServiceAnswer)>& take) {
  const auto scope = discovery::parse_scope(where);
  if (!scope) return unexpected{scope.error()};
  const Inquiry::Question question = [&](Service& service, const discovery::FoundService& from,
                                         bool is_given) {
    FoundNames found;
    const auto read = service.read({}, deadline, found);
    if (!read && from.is_guess) return;
    // A server on another host that serves its names itself returns addresses as its host sees
    // them.
    if (!is_given && !from.is_registry && !from.is_of_this_host) {
      for (NameEntry& entry : found.entries)
        entry.is_of_other_host = true;
    }
    ServiceAnswer answer{from.url, std::move(found.entries), {}, std::nullopt};
    if (read) static_cast<void>(service.read_lapsed(deadline, answer.lapsed));
    if (!read) answer.error = read.error();
    take(std::move(answer));
  };
  Inquiry inquiry(node, deadline, question);
  inquiry.begin(*scope, where);
  const auto finished = inquiry.finish();
  for (const std::string& note : inquiry.notes())
    take({{}, {}, {}, DirectoryError{{note}}});
  return finished;
}

LapsedAnswer ask_for_lapsed(rpc::Node& node, const std::string& where, MonotonicTime deadline) {
  LapsedAnswer answer;
  std::mutex mutex;
  const auto scope = discovery::parse_scope(where);
  if (!scope) return answer;
  const Inquiry::Question question = [&](Service& service, const discovery::FoundService& from,
                                         bool) {
    std::vector<LapsedName> lapsed;
    const bool is_read = service.read_lapsed(deadline, lapsed).has_value();
    const std::lock_guard lock(mutex);
    if (is_read) answer.services.push_back(from.url);
    for (LapsedName& each : lapsed)
      answer.names.push_back(std::move(each));
  };
  Inquiry inquiry(node, deadline, question);
  inquiry.begin(*scope, where);
  // Every service that could be asked was asked.
  static_cast<void>(inquiry.finish());
  const bool is_list = scope->is_url() && registries_of(where).size() > 1;
  if (is_list && !answer.services.empty()) answer.services.push_back(where);
  return answer;
}

expected<void, DirectoryError> dismiss(rpc::Node& node, const LapsedName& lapsed) {
  // The revision identifies the holder; the caller's identity does not matter.
  const Owner anybody{.id = 1};
  return Directory(node, lapsed.service_url).unbind(lapsed.name, anybody, lapsed.revision);
}

}  // namespace rtpm::names
