#include "rtpm/rpc/binding.hpp"

#include <algorithm>
#include <string>

#include "client/binding_impl.hpp"
#include "client/node_impl.hpp"
#include "client/rebinder.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/priority.hpp"
#include "rtpm/transport/address.hpp"
#include "rtpm/transport/shared_memory.hpp"
#include "rtpm/wire/url.hpp"

namespace rtpm::rpc {
namespace {

// Texts of a server, and of a registry, are foreign.
constexpr std::size_t kDifferenceSizeMax = 1024;

// "; most like it there: lab/arm0, lab/arm1", or nothing. The list ends at a malformed path.
std::string similar_paths_of(const BindOutcome& outcome) {
  std::string list;
  ByteReader reader(ConstBytes(outcome.similar_paths).first(outcome.similar_paths_size));
  for (std::size_t i = 0; i < wire::kSimilarPathCountMax && reader.left() > 0; ++i) {
    const std::string_view path = reader.take_text();
    if (!reader.ok() || !wire::is_valid_path(path)) break;
    list.append(list.empty() ? "; most like it there: " : ", ").append(path);
  }
  return list;
}

// `transport_error`: why the server was not asked; empty if it was, or if the outcome says why.
SetupError explain(const BindOutcome& outcome, const InterfaceDescriptor& interface,
                   const std::string& path, const std::string& url,
                   const SetupError& transport_error = {}) {
  const std::string server = url.substr(0, url.size() - path.size() - 1);
  const std::string interface_name(interface.name);
  if (outcome.kind == CallOutcome::Kind::kReply) {
    if (!outcome.difference.empty()) {
      return {
          "'" + path + "' at " + server + " has another " + interface_name + " than this program",
          printable(outcome.difference, kDifferenceSizeMax),
          "generate both from the same schema, or from versions that `rtpmc check --conform` "
          "calls compatible",
          outcome.error};
    }
    if (outcome.status == wire::Status::kWrongInterface) {
      return {"'" + path + "' at " + server + " is a " + printable(outcome.other_interface.data()) +
                  ", not a " + interface_name,
              {},
              "check the name",
              outcome.error};
    }
    if (outcome.status == wire::Status::kNoSuchObject) {
      return {"no object '" + path + "' is served at " + server + similar_paths_of(outcome),
              {},
              "check the path, and that the server added it",
              outcome.error};
    }
  }
  const bool was_asked = transport_error.what.empty();
  return {"'" + path + "' can't be bound at " + server,
          was_asked ? std::string(to_string(outcome.error)) : transport_error.reason(),
          transport_error.remedy, outcome.error};
}

expected<std::string, SetupError> url_of(Node& node, std::string_view target,
                                         MonotonicTime deadline) {
  if (wire::is_url(target)) return std::string(target);
  if (node.impl().resolver() == nullptr) {
    return setup_error("name '" + std::string(target) + "' can't be resolved",
                       "this program uses no registry",
                       "give a URL such as rtpm://127.0.0.1:4711/lab/arm0, or a resolver "
                       "(Node::use)");
  }
  return node.impl().resolver()->resolve(target, deadline);
}

// A server on this host answers such a question within microseconds, unless it is stopped.
constexpr Duration kMemoryPatience = std::chrono::milliseconds{100};

// The part of a bind's time that may show whether a server silent over UDP answers over TCP.
constexpr Duration kTcpPatience = std::chrono::milliseconds{250};

// The transport to the server, and the folder of its socket for shared memory.
ServerAddress address_of(Node& node, const BindOptions& options, const std::string& host,
                         std::uint16_t port, MonotonicTime deadline) {
  const Transport asked =
      options.transport != Transport::kAuto ? options.transport : node.config().transport;
  if (asked == Transport::kUdp || asked == Transport::kTcp) return {host, port, asked, {}};
  deadline = std::min(deadline, rt::now() + kMemoryPatience);
  for (const std::string& folder : {node.config().shared_memory_folder, std::string()}) {
    const transport::SharedMemoryAddress served{host, port, folder,
                                                node.impl().keys.trusted_users()};
    if (transport::is_shared_memory_served(served, deadline)) {
      return {host, port, Transport::kSharedMemory, folder};
    }
  }
  return {host, port, asked == Transport::kAuto ? Transport::kUdp : asked, {}};
}

// Where a URL may lead.
struct Candidates {
  std::vector<ServerCandidate> addresses{};
  SetupError error{};      ///< The error of the last one that failed.
  std::string failures{};  ///< Each with its reason.

  /// Then its own error says it all.
  [[nodiscard]] bool is_single() const { return addresses.size() == 1 && failures.empty(); }
  void note(const std::string& what, const std::string& why, const SetupError& by) {
    failures.append(failures.empty() ? "" : "; ").append(what).append(": ").append(why);
    error = by;
  }
};

// The time for one of `left` attempts.
MonotonicTime part_of_time(MonotonicTime deadline, std::size_t left) noexcept {
  const MonotonicTime now = rt::now();
  return deadline <= now ? deadline : now + (deadline - now) / static_cast<int>(left);
}

// A host's name is looked up here, where waiting for a name server does no harm to a call.
Candidates candidates_of(const wire::Url& url, MonotonicTime deadline) {
  Candidates candidates;
  std::size_t left = url.hosts.size();
  for (const std::string& host : url.hosts) {
    // If there are several hosts, the hosts after this one keep half of the time.
    const std::size_t parts = url.hosts.size() == 1 ? 1 : 2 * left;
    const auto addresses = transport::addresses_of(host, url.port, part_of_time(deadline, parts));
    --left;
    if (!addresses) {
      candidates.note(host, addresses.error().reason(), addresses.error());
      continue;
    }
    for (const transport::SocketAddress& address : *addresses) {
      const auto& all = candidates.addresses;
      if (std::ranges::find(all, address, &ServerCandidate::address) == all.end()) {
        candidates.addresses.push_back({host, address});
      }
    }
  }
  return candidates;
}

}  // namespace

expected<Bound, SetupError> Binding::Impl::open_session(Destination& at,
                                                        const InterfaceDescriptor& wanted,
                                                        MonotonicTime deadline) {
  const auto failed = [&](const BindOutcome& outcome, const SetupError& transport_error = {}) {
    return unexpected{explain(outcome, wanted, at.path, at.url, transport_error)};
  };
  const Priority priority = !bind_options.warm_up.empty()
                                ? bind_options.warm_up.front()
                                : rt::current_priority().value_or(Priority{0});
  auto taken = at.endpoint.take(priority);
  if (!taken) return failed({.error = taken.error()});
  TakenChannel channel(*taken);
  BindOutcome outcome;
  // A session that was lost since its last use is opened anew once.
  for (int attempt = 0; attempt < 2; ++attempt) {
    if (auto ready = channel->make_ready(priority, deadline); !ready) {
      return failed({.error = ready.error()}, channel->transport_error());
    }
    outcome = ask(at, *channel, priority, deadline);
    if (outcome.kind == CallOutcome::Kind::kReply) break;
  }
  if (outcome.kind == CallOutcome::Kind::kReply && outcome.status == wire::Status::kOk) {
    return outcome.bound;
  }
  return failed(outcome);
}

expected<Binding::Impl::Opened, SetupError> Binding::Impl::open(const std::string& at_url,
                                                                MonotonicTime deadline) {
  const auto url = wire::parse_url(at_url);
  if (!url) {
    return setup_error("'" + printable(at_url) + "' is no RTPM URL", "",
                       "write rtpm://host:port/path, such as rtpm://127.0.0.1:4711/lab/arm0");
  }
  Candidates candidates = candidates_of(*url, deadline);
  if (candidates.addresses.empty()) {
    return setup_error("'" + printable(at_url) + "' can't be bound", candidates.error);
  }
  // hp-10-2
  std::size_t left = candidates.addresses.size();
  std::optional<SetupError> refused;
  for (const ServerCandidate& candidate : candidates.addresses) {
    auto opened = open_at(candidate, url->path, at_url, part_of_time(deadline, left--));
    if (opened || candidates.is_single()) return opened;
    const SetupError& error = opened.error();
    candidates.note(candidate.address.text(), error.why.empty() ? error.what : error.why, error);
    // An answer says more than silence.
    if (!refused && is_refusal(error.cause)) refused = error;
  }
  if (refused) return unexpected{std::move(*refused)};
  return unexpected{SetupError{"'" + url->path + "' can't be bound at " + url->text(),
                               candidates.failures, candidates.error.remedy,
                               candidates.error.cause}};
}

expected<Binding::Impl::Opened, SetupError> Binding::Impl::open_at(const ServerCandidate& server,
                                                                   const std::string& path,
                                                                   const std::string& at_url,
                                                                   MonotonicTime deadline) {
  ServerAddress address =
      address_of(node, bind_options, server.address.host(), server.address.port(), deadline);
  if (!is_over_network(address.transport)) return open_by(address, path, at_url, deadline);
  const auto known = node.impl().keys.keys_of(server.host, server.address);
  if (!known) return setup_error("'" + printable(at_url) + "' is not bound", known.error());
  if (known->empty()) return open_over(address, path, at_url, deadline);
  // A server that changes its key has two for a time.
  std::optional<SetupError> first_error;
  std::size_t left = known->size();
  for (const access::KnownServer& entry : *known) {
    address.key = entry.key;
    auto opened = open_over(address, path, at_url, part_of_time(deadline, left--));
    if (opened) return opened;
    if (!first_error || is_refusal(opened.error().cause)) first_error = std::move(opened.error());
  }
  return unexpected{std::move(*first_error)};
}

// Where the first bind gets no answer over UDP, a part of its time shows whether only UDP is
// stopped on its way: a firewall often lets TCP pass.
expected<Binding::Impl::Opened, SetupError> Binding::Impl::open_over(const ServerAddress& address,
                                                                     const std::string& path,
                                                                     const std::string& at_url,
                                                                     MonotonicTime deadline) {
  const auto numeric = transport::SocketAddress::parse(address.host, address.port);
  const bool is_first = settled == nullptr && (!numeric || !numeric->is_loopback());
  if (address.transport != Transport::kUdp || !is_first) {
    return open_by(address, path, at_url, deadline);
  }
  const Duration reserve =
      std::min(kTcpPatience, std::max((deadline - rt::now()) / 4, Duration{0}));
  auto opened = open_by(address, path, at_url, deadline - reserve);
  if (opened || is_refusal(opened.error().cause)) return opened;
  ServerAddress by_tcp = address;
  by_tcp.transport = Transport::kTcp;
  const auto answer = open_by(by_tcp, path, at_url, deadline);
  if (!answer && !is_refusal(answer.error().cause)) return opened;
  opened.error().why = "the server answers over TCP, but not over UDP";
  opened.error().remedy =
      "let datagrams to and from UDP port " + std::to_string(address.port) +
      " pass the firewalls on the way, or call over TCP (NodeConfig::transport)";
  return opened;
}

expected<Binding::Impl::Opened, SetupError> Binding::Impl::open_by(const ServerAddress& address,
                                                                   const std::string& path,
                                                                   const std::string& at_url,
                                                                   MonotonicTime deadline) {
  Opened opened{std::make_unique<Destination>(
      node, node.impl().endpoint(address, bind_options.is_private), path, at_url)};
  Destination& at = *opened.destination;
  const auto answer = open_session(at, interface, deadline);
  if (!answer) return unexpected{answer.error()};
  opened.bound = *answer;
  if (bind_options.transport == Transport::kAuto && node.config().transport == Transport::kAuto &&
      node.config().collocates) {
    at.door = LocalDoor::find(answer->server_epoch);
  }
  std::vector<Priority> priorities = bind_options.warm_up;
  // Calls without a priority of their own use the object's priority.
  if (answer->is_server_declared) priorities = {answer->priority};
  if (at.door) at.door->open_places(priorities);
  SetupError transport_error;
  const auto warm = priorities.empty()
                        ? warm_up_all(at.endpoint, deadline, transport_error)
                        : warm_up(at.endpoint, priorities, deadline, transport_error);
  if (warm) return opened;
  return unexpected{explain({.error = warm.error()}, interface, at.path, at.url, transport_error)};
}

void Binding::Impl::settle(Opened opened) {
  has_door.store(opened.destination->door != nullptr, std::memory_order_relaxed);
  former.reserve(former.size() + 1);  // Not while a more urgent thread may wait for the lock.
  const std::lock_guard lock(writing);
  if (settled) {
    opened.destination->lost_before = settled->lost_oneway_count();
    opened.destination->lost_elsewhere = opened.destination->endpoint.lost_oneway_count();
    former.push_back(std::move(settled));
  } else {
    lost_oneways_told = opened.destination->lost_oneway_count();
  }
  settled = std::move(opened.destination);
  current = settled.get();
  bound.write(opened.bound);
}

expected<Binding, SetupError> Binding::bind(Node& node, std::string_view target,
                                            const InterfaceDescriptor& interface,
                                            const BindOptions& options) {
  const MonotonicTime deadline = deadline_after(options.deadline, rt::now());
  const auto url = url_of(node, target, deadline);
  if (!url) return unexpected{url.error()};
  auto impl = std::make_unique<Impl>(node, interface, options);
  auto opened = impl->open(*url, deadline);
  if (!opened) return unexpected{std::move(opened.error())};
  impl->settle(std::move(*opened));
  if (!wire::is_url(target)) {
    impl->name = target;
    if (auto added = node.impl().rebinder().add(*impl); !added) {
      impl->name.clear();
      return unexpected{std::move(added.error())};
    }
  }
  return Binding(std::move(impl));
}

Destination::~Destination() {
  node.impl().give_back(endpoint);
}

Binding::Impl::~Impl() {
  if (follows()) node.impl().rebinder().remove(*this);
}

Binding::Binding(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
Binding::Binding(Binding&&) noexcept = default;
Binding& Binding::operator=(Binding&&) noexcept = default;
Binding::~Binding() = default;

expected<void, SetupError> Binding::warm_up(std::span<const Priority> priorities) {
  const Impl::Pin pin(*impl_);
  const Destination& at = *impl_->remembered().destination;
  if (at.door && !priorities.empty()) at.door->open_places(priorities);
  SetupError transport_error;
  const auto warm = Impl::warm_up(
      at.endpoint, priorities, deadline_after(impl_->default_deadline, rt::now()), transport_error);
  if (warm) return {};
  return unexpected{
      explain({.error = warm.error()}, impl_->interface, at.path, at.url, transport_error)};
}

std::string Binding::url() const {
  const Impl::Pin pin(*impl_);
  return impl_->remembered().destination->url;
}

std::uint64_t Binding::server_epoch() const noexcept {
  return impl_->remembered().server_epoch;
}

Transport Binding::transport() const noexcept {
  const Impl::Pin pin(*impl_);
  const Destination& at = *impl_->remembered().destination;
  return at.door ? Transport::kLocal : at.endpoint.address().transport;
}

FollowStatus Binding::follow_status() const {
  const std::lock_guard lock(impl_->telling);
  return impl_->followed;
}

}  // namespace rtpm::rpc
