#include "rtpm/rpc/binding.hpp"

#include <algorithm>
#include <string>

#include "binding_impl.hpp"
#include "node_impl.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/priority.hpp"
#include "rtpm/transport/shared_memory.hpp"
#include "rtpm/transport/socket.hpp"
#include "rtpm/wire/url.hpp"

namespace rtpm::rpc {
namespace {

std::string explain(const BindOutcome& outcome, const InterfaceDescriptor& interface,
                    const std::string& path, const std::string& url) {
  const std::string server = url.substr(0, url.size() - path.size() - 1);
  const std::string interface_name(interface.name);
  if (outcome.kind == CallOutcome::Kind::kReply) {
    if (!outcome.difference.empty()) {
      return "'" + path + "' at " + server + " has another " + interface_name +
             " than this program: " + outcome.difference +
             ". Remedy: generate both from the same schema, or from versions that "
             "`rtpmc check --conform` calls compatible.";
    }
    if (outcome.status == wire::Status::kWrongInterface) {
      return "'" + path + "' at " + server + " is a " + outcome.other_interface.data() +
             ", not a " + interface_name + ". Remedy: check the name.";
    }
    if (outcome.status == wire::Status::kNoSuchObject) {
      return "no object '" + path + "' is served at " + server +
             ". Remedy: check the path, and that the server added it.";
    }
  }
  return "'" + path + "' can't be bound at " + server + ": " +
         std::string(to_string(outcome.error)) + ".";
}

expected<std::string, SetupError> resolve(Node& node, std::string_view target) {
  if (wire::is_url(target)) return std::string(target);
  Resolver* resolver = node.impl().resolver;
  if (resolver == nullptr) {
    return setup_error("name '" + std::string(target) +
                       "' can't be resolved: this program uses no registry. Remedy: give a URL "
                       "such as rtpm://127.0.0.1:4711/lab/arm0, or a resolver (Node::use).");
  }
  return resolver->resolve(target);
}

// A server on this host answers such a question within microseconds, unless it is stopped.
constexpr Duration kMemoryPatience = std::chrono::milliseconds{100};

// Over what the server is reached, and where it has its socket for shared memory.
ServerAddress address_of(const Node& node, const BindOptions& options, const std::string& host,
                         std::uint16_t port, MonotonicTime deadline) {
  const Transport wish =
      options.transport != Transport::kAuto ? options.transport : node.config().transport;
  if (wish == Transport::kUdp || wish == Transport::kTcp) return {host, port, wish, {}};
  deadline = std::min(deadline, rt::now() + kMemoryPatience);
  for (const std::string& folder : {node.config().shared_memory_folder, std::string()}) {
    if (transport::is_shared_memory_served({host, port, folder}, deadline)) {
      return {host, port, Transport::kSharedMemory, folder};
    }
  }
  return {host, port, wish == Transport::kAuto ? Transport::kUdp : wish, {}};
}

}  // namespace

expected<Binding, SetupError> Binding::bind(Node& node, std::string_view target,
                                            const InterfaceDescriptor& interface,
                                            const BindOptions& options) {
  const MonotonicTime deadline = deadline_after(options.deadline, rt::now());
  const auto url = resolve(node, target);
  if (!url) return unexpected{url.error()};
  const auto parts = wire::parse_url(*url);
  if (!parts) {
    return setup_error("'" + *url +
                       "' is no RTPM URL. Remedy: write rtpm://host:port/path, such as "
                       "rtpm://127.0.0.1:4711/lab/arm0.");
  }
  // A name is looked up once, here, where waiting for a name server does no harm to a call.
  const auto host = transport::numeric_address_of(parts->host);
  if (!host) return setup_error("'" + *url + "' can't be bound: " + host.error().text);
  const bool may_be_local = node.config().collocates && options.transport == Transport::kAuto &&
                            node.config().transport == Transport::kAuto;
  const ServerAddress address = address_of(node, options, *host, parts->port, deadline);
  Endpoint& endpoint =
      options.is_private ? node.impl().private_endpoint(address) : node.impl().endpoint(address);
  auto impl = std::make_unique<Impl>(node, endpoint, parts->path, *url, interface,
                                     node.config().default_deadline);
  impl->is_private = options.is_private;
  const Priority priority = !options.warm_up.empty() ? options.warm_up.front()
                                                     : rt::current_priority().value_or(Priority{0});
  auto taken = endpoint.take(priority);
  if (!taken) return setup_error(explain({.error = taken.error()}, interface, parts->path, *url));
  BindOutcome outcome;
  {
    TakenChannel channel(*taken);
    // A session that was lost since its last use is opened anew once.
    for (int attempt = 0; attempt < 2; ++attempt) {
      if (auto ready = channel->make_ready(priority, deadline); !ready) {
        return setup_error(explain({.error = ready.error()}, interface, parts->path, *url));
      }
      outcome = impl->ask(*channel, priority, deadline);
      if (outcome.kind == CallOutcome::Kind::kReply) break;
    }
  }
  if (outcome.kind != CallOutcome::Kind::kReply || outcome.status != wire::Status::kOk) {
    return setup_error(explain(outcome, interface, parts->path, *url));
  }
  impl->remember(outcome.bound);
  if (may_be_local) impl->door = LocalDoor::find(outcome.bound.server_epoch);
  Binding binding(std::move(impl));
  std::vector<Priority> priorities = options.warm_up;
  // Calls without a priority of their own go at the object's.
  if (outcome.bound.is_server_declared) priorities = {outcome.bound.priority};
  if (binding.impl_->door) binding.impl_->door->open_places(priorities);
  const auto warm = priorities.empty() ? binding.impl_->warm_up_all(deadline)
                                       : binding.impl_->warm_up(priorities, deadline);
  if (!warm) {
    return setup_error(explain({.error = warm.error()}, interface, parts->path, *url));
  }
  return binding;
}

Binding::Impl::~Impl() {
  if (is_private) node.impl().give_back(endpoint);
}

Binding::Binding(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
Binding::Binding(Binding&&) noexcept = default;
Binding& Binding::operator=(Binding&&) noexcept = default;
Binding::~Binding() = default;

expected<void, SetupError> Binding::warm_up(std::span<const Priority> priorities) {
  if (impl_->door && !priorities.empty()) impl_->door->open_places(priorities);
  const auto warm = impl_->warm_up(priorities, deadline_after(impl_->default_deadline, rt::now()));
  if (warm) return {};
  return setup_error(explain({.error = warm.error()}, impl_->interface, impl_->path, impl_->url));
}

std::string_view Binding::url() const noexcept {
  return impl_->url;
}

Transport Binding::transport() const noexcept {
  return impl_->door ? Transport::kLocal : impl_->endpoint.address().transport;
}

}  // namespace rtpm::rpc
