#include "rtpm/rpc/server.hpp"

#include <algorithm>
#include <map>

#include "lane/lane.hpp"
#include "model/lane_table_owner.hpp"
#include "model/object_table.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/rt/budget.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/cpu_keeper.hpp"
#include "rtpm/rt/host.hpp"
#include "rtpm/rt/memory.hpp"
#include "rtpm/transport/address.hpp"
#include "rtpm/transport/shared_memory.hpp"
#include "rtpm/transport/tcp.hpp"
#include "rtpm/transport/udp.hpp"
#include "rtpm/transport/wait_set.hpp"
#include "rtpm/wire/limits.hpp"
#include "rtpm/wire/url.hpp"
#include "security/access_control.hpp"
#include "security/audit_log.hpp"
#include "security/exposure.hpp"
#include "security/gatekeeper.hpp"
#include "server/acceptor.hpp"
#include "server/policy.hpp"
#include "tap/server_tap.hpp"

namespace rtpm::rpc {
namespace {

// The CPUs that no lane is pinned to. On the CPU of a thread that spins at SCHED_FIFO, another
// thread could wait for seconds until the system moves it. Empty for any CPU.
std::vector<int> cpus_left_by(const std::vector<LaneConfig>& lanes) {
  std::vector<int> cpus = rt::usable_cpus();
  for (const LaneConfig& lane : lanes) {
    if (lane.wait.strategy != rt::WaitStrategy::kSpin) continue;
    std::erase_if(cpus, [&](int cpu) { return std::ranges::count(lane.cpus, cpu) > 0; });
  }
  return cpus;
}

class ServerImpl final : public Server {
 public:
  explicit ServerImpl(ServerConfig config) : config_(std::move(config)) {}
  ~ServerImpl() override { stop(); }

  expected<void, SetupError> open();
  expected<void, SetupError> add(std::string_view path, Servant& servant,
                                 ObjectOptions options) override;
  expected<void, SetupError> start() override;
  void stop() noexcept override;
  std::uint16_t port() const noexcept override { return url_.port; }
  std::string url(std::string_view path) const override {
    wire::Url url = url_;
    url.path = path;
    return url.text();
  }
  std::vector<ServedAddress> served_addresses() const override;
  ServedCallers served_callers() const override;
  ServerCounters counters() const noexcept override;
  std::shared_ptr<CallTap> tap() noexcept override { return tap_; }
  std::optional<crypto::PublicKey> public_key() const noexcept override {
    return identity_ ? std::optional((*identity_)->key.public_key) : std::nullopt;
  }

 private:
  /// A lane's ports, one per host, in order.
  using Ports = std::vector<transport::UdpPort>;
  struct Sockets {
    std::vector<transport::TcpListener> listeners{};
    std::vector<Ports> ports_of_lanes{};
  };
  [[nodiscard]] std::vector<std::string> hosts_to_open() const;
  expected<void, SetupError> find_hosts();
  expected<void, SetupError> open_access();
  expected<Sockets, SetupError> open_sockets() const;
  expected<std::vector<transport::SharedMemoryListener>, SetupError> open_memory_listeners() const;
  expected<void, SetupError> make_lanes(std::vector<Ports> ports_of_lanes);
  [[nodiscard]] rt::CpuKeeper* keeper_of(const LaneConfig& lane);
  void open_door();

  ServerConfig config_;
  transport::HostsToServe hosts_;
  wire::Url url_{};  ///< The server's URL, without a path.
  ObjectTable objects_;
  std::shared_ptr<ServerTap> tap_ = std::make_shared<ServerTap>(objects_);
  std::shared_ptr<AccessControl> access_;  ///< Null if the server does not authenticate callers.
  // audit_, identity_ and gatekeeper_ are set only with access_.
  std::unique_ptr<AuditLog> audit_;
  std::optional<Secret<sealed::ServerIdentity>> identity_;
  std::unique_ptr<Gatekeeper> gatekeeper_;
  std::unique_ptr<Acceptor> acceptor_;
  rt::PublicMemory lane_table_;
  /// Keyed by CPU; they must outlive the lanes.
  std::map<int, std::unique_ptr<rt::CpuKeeper>> keepers_;
  std::vector<std::unique_ptr<Lane>> lanes_;
  std::uint64_t epoch_ = rt::random_u64();
  std::shared_ptr<LocalDoor> door_;
  bool is_started_ = false;
  bool is_stopped_ = false;
};

std::string subject_of(const ServerConfig& config) {
  return "server '" + config.name + "'";
}

// The hosts for URLs: loopback and link-local ones only if there are no others.
std::vector<std::string> hosts_for_callers(const transport::HostsToServe& hosts) {
  const auto is_for_any_caller = [](const transport::SocketAddress& address) {
    return !address.is_loopback() && !address.is_link_local();
  };
  std::vector<std::string> told;
  std::vector<std::string> others;
  for (const transport::InterfaceAddress& each : hosts.addresses) {
    const transport::SocketAddress& address = each.address;
    // With "any" there is one link-local address per interface.
    if (hosts.is_any && address.is_link_local()) continue;
    (is_for_any_caller(address) ? told : others).push_back(address.host());
  }
  if (told.empty()) told = std::move(others);
  if (told.size() > wire::kUrlHostCountMax) told.resize(wire::kUrlHostCountMax);
  return told;
}

// Resolves the served and the advertised addresses, once.
expected<void, SetupError> ServerImpl::find_hosts() {
  auto hosts = transport::hosts_to_serve(config_.host, rt::now() + transport::kResolvePatience);
  if (!hosts) return unexpected{hosts.error()};
  hosts_ = std::move(*hosts);
  url_.hosts = hosts_for_callers(hosts_);
  if (config_.advertise.empty()) return {};
  std::string list;
  for (std::size_t begin = 0; begin <= config_.advertise.size();) {
    const std::size_t end = std::min(config_.advertise.find(',', begin), config_.advertise.size());
    list.append(list.empty() ? "" : ",");
    const std::string host = config_.advertise.substr(begin, end - begin);
    list += host.starts_with('[') ? host : wire::host_in_url(host);
    begin = end + 1;
  }
  auto told = wire::parse_url("rtpm://" + list + ":1/any");
  if (!told) {
    return setup_error("'" + printable(config_.advertise) + "' is no list of hosts to advertise",
                       "",
                       "write at most " + std::to_string(wire::kUrlHostCountMax) +
                           " addresses or host names with ',' between");
  }
  url_.hosts = std::move(told->hosts);
  return {};
}

std::vector<std::string> ServerImpl::hosts_to_open() const {
  if (hosts_.is_any) return {"any"};
  std::vector<std::string> hosts;
  for (const transport::InterfaceAddress& each : hosts_.addresses)
    hosts.push_back(each.address.host());
  return hosts;
}

std::vector<ServedAddress> ServerImpl::served_addresses() const {
  std::vector<ServedAddress> served;
  for (const transport::InterfaceAddress& each : hosts_.addresses)
    served.push_back({wire::host_in_url(each.address.host()), each.interface});
  return served;
}

ServedCallers ServerImpl::served_callers() const {
  if (!access_) return {.is_open_to_network = is_for_other_hosts(hosts_)};
  return {.authorized_file = access_->file(), .key = (*identity_)->key.public_key};
}

expected<ServerImpl::Sockets, SetupError> ServerImpl::open_sockets() const {
  Sockets sockets{.ports_of_lanes = std::vector<Ports>(config_.lanes.size())};
  std::uint16_t port = config_.port;
  std::uint16_t index = 0;
  for (const std::string& host : hosts_to_open()) {
    auto listener = transport::TcpListener::open(host, port);
    if (!listener) return unexpected{listener.error()};
    port = listener->port();
    sockets.listeners.push_back(std::move(*listener));
    std::vector<transport::LanePortConfig> lanes;
    for (const LaneConfig& lane : config_.lanes)
      lanes.push_back({lane.priority, lane.low});
    auto opened = transport::open_lane_ports({.host = host, .port = port, .index = index}, lanes,
                                             config_.realtime);
    if (!opened) return unexpected{opened.error()};
    for (std::size_t i = 0; i < opened->size(); ++i)
      sockets.ports_of_lanes[i].push_back(std::move((*opened)[i]));
    ++index;
  }
  return sockets;
}

expected<void, SetupError> ServerImpl::open() {
  if (auto checked = check_limits(config_); !checked) {
    return setup_error(subject_of(config_), checked.error());
  }
  if (auto found = find_hosts(); !found) return setup_error(subject_of(config_), found.error());
  if (auto opened = open_access(); !opened) return setup_error(subject_of(config_), opened.error());
  auto lanes = checked_lanes(config_.lanes);
  if (!lanes) return setup_error(subject_of(config_), lanes.error());
  config_.lanes = std::move(*lanes);
  // All sockets share the port number. A number that the system chose for one may be taken for
  // another.
  constexpr int kAttemptCount = 16;
  for (int attempt = 1;; ++attempt) {
    auto sockets = open_sockets();
    if (!sockets && config_.port == 0 && attempt < kAttemptCount) continue;
    if (!sockets) return setup_error(subject_of(config_), sockets.error());
    url_.port = sockets->listeners.front().port();
    auto memory_listeners = open_memory_listeners();
    if (!memory_listeners) return setup_error(subject_of(config_), memory_listeners.error());
    auto wait_set = transport::WaitSet::open(
        Acceptor::wait_source_count(sockets->listeners.size() + memory_listeners->size()));
    if (!wait_set) return setup_error(subject_of(config_), wait_set.error());
    acceptor_ = std::make_unique<Acceptor>(
        std::move(sockets->listeners), std::move(*memory_listeners), std::move(*wait_set),
        std::min(config_.message_size_max, static_cast<std::uint32_t>(wire::kStreamPayloadSizeMax)),
        access_.get());
    if (served_callers().is_open_to_network)
      acceptor_->warn_each_minute(OpenWarning(subject_of(config_), url_.authority()));
    return make_lanes(std::move(sockets->ports_of_lanes));
  }
}

// Opens the grants, the audit log, the key and the gatekeeper of a server that authenticates its
// callers.
expected<void, SetupError> ServerImpl::open_access() {
  const ServerSecurity& security = config_.security;
  auto grants_file = grants_file_of(security, hosts_);
  if (!grants_file) return unexpected{grants_file.error()};
  if (grants_file->empty()) return {};
  auto access = AccessControl::open(std::move(*grants_file));
  if (!access) return unexpected{access.error()};
  access_ = std::move(*access);
  auto audit = AuditLog::open(security.audit_file, *access_);
  if (!audit) return unexpected{audit.error()};
  audit_ = std::move(*audit);
  auto identity = open_identity(security.key_file);
  if (!identity) return unexpected{identity.error()};
  identity_.emplace(std::move(*identity));
  auto gatekeeper = Gatekeeper::open(security.key_log_file, *access_, *audit_);
  if (!gatekeeper) return unexpected{gatekeeper.error()};
  gatekeeper_ = std::move(*gatekeeper);
  return {};
}

// hp-16.1-1: one for each address, as callers on this host may use any.
expected<std::vector<transport::SharedMemoryListener>, SetupError>
ServerImpl::open_memory_listeners() const {
  std::vector<transport::SharedMemoryListener> listeners;
  if (!transport::offers_shared_memory()) {
    if (config_.shared_memory_folder.empty()) return listeners;
    return setup_error("this system offers no shared memory to serve in the folder '" +
                           config_.shared_memory_folder + "'",
                       "", "leave the folder out; callers use UDP or TCP");
  }
  if (!config_.shared_memory) return listeners;
  for (const transport::InterfaceAddress& each : hosts_.addresses) {
    if (hosts_.is_any && each.address.is_link_local()) continue;
    // Containers that share a folder all have the loopback addresses.
    const bool is_ambiguous = hosts_.is_any && !config_.shared_memory_folder.empty() &&
                              each.address.is_loopback() && hosts_.addresses.size() > 2;
    if (is_ambiguous || listeners.size() == transport::kServedAddressCountMax) continue;
    auto listener = transport::SharedMemoryListener::open(
        {each.address.host(), url_.port, config_.shared_memory_folder});
    if (!listener) return unexpected{listener.error()};
    listeners.push_back(std::move(*listener));
  }
  return listeners;
}

expected<void, SetupError> ServerImpl::make_lanes(std::vector<Ports> ports_of_lanes) {
  LaneSetup setup{.server = &config_,
                  .epoch = epoch_,
                  .clock_domain = rt::clock_domain(),
                  .key = {rt::random_u64(), rt::random_u64()},
                  .objects = &objects_,
                  .acceptor_bell = &acceptor_->bell(),
                  .refusals = &acceptor_->refusals(),
                  .access = access_.get()};
  if (access_) {
    setup.audit = audit_.get();
    setup.identity = &**identity_;
    setup.handshake_rate = &gatekeeper_->rate();
    setup.gatekeeper_bell = &gatekeeper_->bell();
  }
  std::string hosts = hosts_.is_any ? "any" : "";
  for (const ServedAddress& each : served_addresses()) {
    if (!hosts_.is_any) hosts.append(hosts.empty() ? "" : ",").append(each.host);
  }
  auto table = make_lane_table(config_, hosts, url_.port, served_callers().is_open_to_network);
  if (!table) return setup_error(subject_of(config_), table.error());
  lane_table_ = std::move(*table);
  for (std::size_t i = 0; i < config_.lanes.size(); ++i) {
    auto wait_set = transport::WaitSet::open_for_lane(
        wait_source_count(config_.session_count_max, ports_of_lanes[i].size()));
    if (!wait_set) return setup_error(subject_of(config_), wait_set.error());
    setup.number = static_cast<std::uint32_t>(i);
    setup.slot = &slot_of(lane_table_, i);
    lanes_.push_back(
        std::make_unique<Lane>(setup, std::move(ports_of_lanes[i]), std::move(*wait_set)));
    if (!lanes_.back()->has_memory()) {
      return setup_error(
          subject_of(config_) + ": the system gives no memory for lane '" + setup.config().name +
              "'",
          system_error(ENOMEM),
          "raise the limit of the process (ulimit -v; LimitAS= of a systemd unit) or of the host "
          "(vm.overcommit_memory), or lower message_size_max, large_message_count_max, "
          "deferred_call_count_max or stream_count_max");
    }
    tap_->add(lanes_.back()->tap());
    if (!config_.borrows) continue;
    setup.lower = lanes_.back()->thread_pool();
    setup.lendable_thread_count += setup.config().static_threads + setup.config().dynamic_threads;
  }
  // SYNC POINT lane-table: published only when all lanes are in it.
  open_to_readers(lane_table_);
  return {};
}

expected<void, SetupError> ServerImpl::add(std::string_view path, Servant& servant,
                                           ObjectOptions options) {
  RTPM_ASSERT(!is_started_, "objects are added before the server starts");
  if (auto legal = check_policy(path, options, config_.lanes, config_.borrows); !legal) {
    return setup_error(subject_of(config_), legal.error());
  }
  auto added = objects_.add(path, servant, std::move(options), config_.ceiling);
  if (!added) return setup_error(subject_of(config_), added.error());
  return {};
}

expected<void, SetupError> ServerImpl::start() {
  RTPM_ASSERT(!is_started_ && !is_stopped_, "a server starts once, and not after its stop");
  is_started_ = true;
  if (auto locked = rt::lock_memory(config_.realtime); !locked) {
    return setup_error(subject_of(config_), locked.error());
  }
  for (std::size_t i = 0; i < lanes_.size(); ++i) {
    rt::CpuKeeper* const keeper = keeper_of(config_.lanes[i]);
    if (auto started = lanes_[i]->start(config_.realtime, keeper); !started) {
      stop();
      return setup_error(subject_of(config_), started.error());
    }
  }
  if (auto accepting = acceptor_->start(lanes_, cpus_left_by(config_.lanes)); !accepting) {
    stop();
    return setup_error(subject_of(config_), accepting.error());
  }
  if (gatekeeper_) {
    std::vector<GatekeeperLink*> links;
    for (const auto& lane : lanes_)
      links.push_back(&lane->gatekeeper_link());
    auto kept = gatekeeper_->start(std::move(links), cpus_left_by(config_.lanes));
    if (!kept) {
      stop();
      return setup_error(subject_of(config_), kept.error());
    }
  }
  open_door();
  return {};
}

// The keeper of a lane's CPU, if its threads may have to pause to avoid throttling, and the lane
// has only one CPU.
rt::CpuKeeper* ServerImpl::keeper_of(const LaneConfig& lane) {
  const bool may_rest = config_.realtime != rt::RealtimeMode::kOff &&
                        lane.schedule == rt::Schedule::kFifo && rt::realtime_limit().is_limited();
  if (!may_rest || lane.cpus.size() != 1) return nullptr;
  const int cpu = lane.cpus.front();
  auto& keeper = keepers_[cpu];
  if (!keeper) {
    // Without a keeper the lanes still serve.
    if (auto made = rt::CpuKeeper::start("rtpm-awake-" + std::to_string(cpu), cpu)) {
      keeper = std::move(*made);
    }
  }
  return keeper.get();
}

// Lets callers in the same program call without a transport.
void ServerImpl::open_door() {
  std::vector<LocalDoor::Entry> entries;
  for (const auto& lane : lanes_)
    entries.push_back({lane->band(), lane->gate()});
  door_ = std::make_shared<LocalDoor>(epoch_, config_.ceiling, config_.message_size_max,
                                      std::move(entries));
  LocalDoor::open(door_);
}

void ServerImpl::stop() noexcept {
  is_stopped_ = true;
  if (door_) LocalDoor::close(*door_);
  if (acceptor_) acceptor_->stop();
  if (gatekeeper_) gatekeeper_->stop();
  for (const auto& lane : lanes_)
    lane->stop();
  for (const auto& lane : lanes_)
    lane->join();
  keepers_.clear();
  for (const auto& lane : lanes_)
    lane->close();
  if (acceptor_) acceptor_->refusals().write();
  tap_->close();
}

ServerCounters ServerImpl::counters() const noexcept {
  ServerCounters sum;
  for (const auto& lane : lanes_) {
    const ServerCounters one = lane->counters();
    sum.call_count += one.call_count;
    sum.servant_failure_count += one.servant_failure_count;
    sum.bad_request_count += one.bad_request_count;
    sum.connection_count += one.connection_count;
    sum.connection_lost_count += one.connection_lost_count;
    sum.connection_refused_count += one.connection_refused_count;
    sum.deferred_count += one.deferred_count;
    sum.overload_count += one.overload_count;
    sum.late_count += one.late_count;
    sum.borrowed_count += one.borrowed_count;
    sum.queued_count_max = std::max(sum.queued_count_max, one.queued_count_max);
    sum.broken_memory_count += one.broken_memory_count;
    sum.send_failure_count += one.send_failure_count;
    sum.frames.add(one.frames);
  }
  return sum;
}

}  // namespace

expected<std::unique_ptr<Server>, SetupError> Server::create(ServerConfig config) {
  auto server = std::make_unique<ServerImpl>(std::move(config));
  if (auto opened = server->open(); !opened) return unexpected{opened.error()};
  return std::unique_ptr<Server>(std::move(server));
}

}  // namespace rtpm::rpc
