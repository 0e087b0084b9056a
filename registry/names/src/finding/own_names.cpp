#include "finding/own_names.hpp"

#include <map>
#include <mutex>
#include <utility>

#include "rtpm/discovery/announcement.hpp"
#include "rtpm/names/defaults.hpp"
#include "rtpm/names/directory.hpp"
#include "rtpm/names/servant.hpp"
#include "rtpm/wire/url.hpp"

namespace rtpm::names {
namespace {

constexpr std::uint32_t kWatchCountMax = 64;

/// Allows only this program to change names: its owners have the epoch of its start.
class OwnPolicy final : public Policy {
 public:
  [[nodiscard]] bool allows(const Caller& caller, Operation operation,
                            std::string_view name) const override {
    const bool changes = operation == Operation::kBind || operation == Operation::kRenew ||
                         operation == Operation::kUnbind;
    if (!changes) return GrantPolicy().allows(caller, operation, name);
    return caller.host.is_this_host() && caller.owner.epoch == own_.epoch;
  }

 private:
  const Owner own_ = owner_of({});
};

rpc::ServerConfig server_config(std::string host, const rpc::ServerSecurity& security) {
  rpc::ServerConfig config{.name = "names", .host = std::move(host), .security = security};
  config.lanes = {{.name = "rtpm-names",
                   .wait = {.strategy = rt::WaitStrategy::kBlock},
                   .schedule = rt::Schedule::kTimeShared}};
  config.realtime = rt::RealtimeMode::kOff;
  config.session_count_max = 128;
  config.message_size_max = 1024 * 1024;
  config.large_message_count_max = 4;
  config.deferred_call_count_max = kWatchCountMax + 8;
  config.stream_count_max = kWatchCountMax;
  config.stream_byte_max = 64 * 1024;
  return config;
}

}  // namespace

expected<std::shared_ptr<OwnNames>, SetupError> OwnNames::at_host_of(
    const discovery::Scope& scope, const std::string& url, const rpc::ServerSecurity& security) {
  static std::mutex mutex;
  static std::map<std::string, std::weak_ptr<OwnNames>> all;
  const auto parts = wire::parse_url(url);
  std::string host;
  for (const std::string& each : parts ? parts->hosts : std::vector<std::string>{"127.0.0.1"})
    host += (host.empty() ? "" : ",") + each;
  const std::lock_guard lock(mutex);
  if (auto running = all[host].lock()) return running;
  std::shared_ptr<OwnNames> made(new OwnNames);
  if (auto begun = made->begin(scope, host, security); !begun)
    return unexpected{std::move(begun.error())};
  all[host] = made;
  return made;
}

expected<void, SetupError> OwnNames::begin(const discovery::Scope& scope, std::string host,
                                           const rpc::ServerSecurity& security) {
  Limits limits;
  limits.watch_count_max = kWatchCountMax;
  limits.name_count_per_owner_max = limits.name_count_own_host_max;
  auto names = make_registry({.limits = limits, .policy = std::make_unique<const OwnPolicy>()});
  if (!names) return unexpected{std::move(names.error())};
  names_ = std::move(*names);
  auto server = rpc::Server::create(server_config(std::move(host), security));
  // The object is on another host: only its name belongs to this program.
  if (!server) server = rpc::Server::create(server_config("127.0.0.1", security));
  if (!server) return unexpected{std::move(server.error())};
  server_ = std::move(*server);
  if (auto added =
          server_->add(kRegistryPath, *names_,
                       {.model = rpc::PriorityModel::kServerDeclared, .checks_callers = true});
      !added) {
    return added;
  }
  if (auto started = server_->start(); !started) return started;
  const auto at = wire::parse_url(url());
  auto announced =
      discovery::Announcement::create(scope, {.hosts = at->hosts, .port = server_->port()});
  if (!announced) return unexpected{std::move(announced.error())};
  announcement_ = std::move(*announced);
  return {};
}

OwnNames::~OwnNames() {
  announcement_.reset();
  if (server_) server_->stop();
}

std::string OwnNames::url() const {
  return server_->url(kRegistryPath);
}

void OwnNames::keep() {
  const std::lock_guard lock(keeping_);
  announcement_->keep();
}

}  // namespace rtpm::names
