#include "rtpm/names/every_service.hpp"

#include <algorithm>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <utility>

#include "registry_list.hpp"
#include "rtpm/discovery/finder.hpp"
#include "rtpm/discovery/scope.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/parallel_jobs.hpp"
#include "rtpm/transport/socket_folder.hpp"
#include "service.hpp"

namespace rtpm::names {
namespace {

constexpr std::size_t kThreadCountMax = 128;

/// Finds the services of a scope and asks each.
class Inquiry {
 public:
  Inquiry(rpc::Node& node, MonotonicTime deadline, const std::function<void(ServiceAnswer)>& take)
      : node_(node), deadline_(deadline), take_(take) {}

  /// Asks what is found in `scope`, as soon as it is found.
  void find(const discovery::Scope& scope) {
    jobs_.add([this, scope] {
      auto found = discovery::find_services(scope, deadline_);
      if (!found) {
        const std::lock_guard lock(mutex_);
        if (!error_) error_ = std::move(found.error());
        return;
      }
      for (const discovery::FoundService& service : found->services)
        ask(service, scope.is_url());
    });
  }

  void ask(const discovery::FoundService& service, bool is_given) {
    {
      const std::lock_guard lock(mutex_);
      if (!asked_.insert(service.url).second) return;
    }
    jobs_.add([this, service, is_given] {
      Service client(node_, service.url, std::max(deadline_ - rt::now(), Duration{0}));
      FoundNames found;
      const auto read = client.read({}, deadline_, found);
      if (!read && service.is_guess) return;
      // A server of another host that serves its names itself has that host's view of addresses.
      if (!is_given && !service.is_registry && !service.is_of_this_host) {
        for (NameEntry& entry : found.entries)
          entry.is_of_other_host = true;
      }
      ServiceAnswer answer{service.url, std::move(found.entries), std::nullopt};
      if (!read) answer.error = read.error();
      take_(std::move(answer));
    });
  }

  [[nodiscard]] expected<void, SetupError> finish() {
    jobs_.finish();
    if (error_) return unexpected{std::move(*error_)};
    return {};
  }

 private:
  rpc::Node& node_;
  const MonotonicTime deadline_;
  const std::function<void(ServiceAnswer)>& take_;
  std::mutex mutex_;  ///< Of what follows; not for real-time threads.
  std::set<std::string> asked_{};
  std::optional<SetupError> error_{};
  rt::ParallelJobs jobs_{"rtpm-ask", kThreadCountMax};
};

/// At which other users of this host have their registry.
discovery::FoundService usual_registry() {
  return {.url = "rtpm://127.0.0.1:" + std::to_string(discovery::kRegistryPort) + "/" +
                 std::string(discovery::kNamesPath),
          .is_registry = true,
          .is_of_this_host = true,
          .is_guess = true};
}

}  // namespace

expected<void, SetupError> ask_every_service(rpc::Node& node, const std::string& where,
                                             MonotonicTime deadline,
                                             const std::function<void(ServiceAnswer)>& take) {
  const auto scope = discovery::parse_scope(where);
  if (!scope) return unexpected{scope.error()};
  Inquiry inquiry(node, deadline, take);
  if (scope->is_url()) {
    for (const std::string& url : registries_of(where))
      inquiry.ask({.url = url, .is_registry = true}, /*is_given=*/true);
    return inquiry.finish();
  }
  // The LAN takes its time, which the services of this host do not wait for.
  inquiry.find(discovery::Scope{});
  if (!transport::has_own_runtime_folder()) inquiry.ask(usual_registry(), /*is_given=*/false);
  if (scope->is_of_lan()) inquiry.find(*scope);
  return inquiry.finish();
}

}  // namespace rtpm::names
