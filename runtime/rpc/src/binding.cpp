#include "rtpm/rpc/binding.hpp"

#include <algorithm>
#include <array>
#include <mutex>
#include <string>

#include "call_channel.hpp"
#include "node_impl.hpp"
#include "rtpm/base/latest.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/priority.hpp"
#include "rtpm/transport/shared_memory.hpp"
#include "rtpm/transport/socket.hpp"
#include "rtpm/wire/control.hpp"
#include "rtpm/wire/url.hpp"

namespace rtpm::rpc {
namespace {

// When a caller's patience ends, which may be longer than all time that is left.
MonotonicTime deadline_after(Duration patience) noexcept {
  const MonotonicTime now = rt::now();
  return patience > kNever - now ? kNever : now + patience;
}

CallError error_of(wire::Status status) noexcept {
  switch (status) {
    case wire::Status::kOverload:
      return CallError::kOverload;
    case wire::Status::kExpired:
      return CallError::kExpired;
    case wire::Status::kNoSuchMethod:
      return CallError::kNoSuchMethod;
    case wire::Status::kNoSuchObject:
    case wire::Status::kGone:
      return CallError::kNoSuchObject;
    case wire::Status::kBadRequest:
      return CallError::kBadRequest;
    case wire::Status::kNotLeaseHolder:
      return CallError::kNotLeaseHolder;
    case wire::Status::kServantFailed:
      return CallError::kServantFailed;
    case wire::Status::kTooLarge:
      return CallError::kTooLarge;
    case wire::Status::kPriorityNotAllowed:
      return CallError::kPriorityNotAllowed;
    default:
      break;
  }
  // hp-5.1-7: a status of a later version may mean anything, so it promises nothing.
  return static_cast<std::uint16_t>(status) < wire::kStatusCount ? CallError::kRefused
                                                                 : CallError::kBadReply;
}

// What a bind learned; true as long as the server's epoch is the same.
struct Bound {
  std::uint64_t server_epoch = 0;
  std::uint32_t service = 0;
  Priority priority{};
  bool is_server_declared = false;
};

// The first method of ours that the server has not, or has otherwise; null if all agree. What a
// list that is not complete leaves out is not held against the server: a call will tell.
const MethodDescriptor* first_difference(const InterfaceDescriptor& ours,
                                         const wire::BindReply& reply,
                                         ConstBytes payload) noexcept {
  for (const MethodDescriptor& method : ours.methods) {
    bool is_same = !reply.is_method_list_complete;
    for (std::uint16_t i = 0; i < reply.method_count; ++i) {
      const wire::MethodEntry entry = wire::method_entry(payload, i);
      if (entry.id != method.id) continue;
      is_same = entry.fingerprint == method.fingerprint;
      break;
    }
    if (!is_same) return &method;
  }
  return nullptr;
}

// What came of asking a server for an object. `what` is for a person.
struct BindOutcome {
  CallOutcome::Kind kind = CallOutcome::Kind::kFailed;
  CallError error = CallError::kTimeout;
  Bound bound{};
  wire::Status status = wire::Status::kOk;
  const MethodDescriptor* differing_method = nullptr;
  std::array<char, 96> other_interface{};
};

}  // namespace

class Binding::Impl {
 public:
  Impl(Endpoint& endpoint_in, std::string path_in, std::string url_in,
       const InterfaceDescriptor& interface_in, Duration default_deadline_in)
      : endpoint(endpoint_in),
        path(std::move(path_in)),
        url(std::move(url_in)),
        interface(interface_in),
        default_deadline(default_deadline_in) {}

  [[nodiscard]] BindOutcome ask(CallChannel& channel, Priority priority,
                                MonotonicTime deadline) noexcept;
  /// Whom a call goes to.
  enum class Target : std::uint8_t { kObject, kSession };
  [[nodiscard]] expected<ReplyLease, CallError> call(const MethodDescriptor& method,
                                                     ConstBytes request, const CallOptions& options,
                                                     MonotonicTime deadline,
                                                     Target target = Target::kObject) noexcept;
  [[nodiscard]] expected<void, CallError> warm_up(std::span<const Priority> priorities,
                                                  MonotonicTime deadline) noexcept;
  void remember(const Bound& value) noexcept {
    const std::lock_guard lock(writing);
    bound.write(value);
  }
  [[nodiscard]] Bound remembered() noexcept {
    if (const auto value = bound.read()) return *value;
    // We keep a less urgent thread from ending its write; waiting for it lends it our priority.
    const std::lock_guard lock(writing);
    const auto value = bound.read();
    RTPM_ASSERT(value.has_value(), "a binding was bound before its first call");
    return *value;
  }

  Endpoint& endpoint;
  std::string path;
  std::string url;
  const InterfaceDescriptor& interface;
  Duration default_deadline;
  Latest<Bound> bound;
  rt::PiMutex writing;
};

namespace {

// Gives the channel back unless a reply lease takes that over.
class TakenChannel {
 public:
  explicit TakenChannel(CallChannel* channel) noexcept : channel_(channel) {}
  TakenChannel(const TakenChannel&) = delete;
  TakenChannel& operator=(const TakenChannel&) = delete;
  ~TakenChannel() {
    if (channel_ != nullptr) channel_->release();
  }
  [[nodiscard]] CallChannel& operator*() const noexcept { return *channel_; }
  [[nodiscard]] CallChannel* operator->() const noexcept { return channel_; }
  [[nodiscard]] CallChannel* keep() noexcept { return std::exchange(channel_, nullptr); }

 private:
  CallChannel* channel_;
};

}  // namespace

ReplyLease::~ReplyLease() {
  if (channel_ != nullptr) channel_->release();
}

BindOutcome Binding::Impl::ask(CallChannel& channel, Priority priority,
                               MonotonicTime deadline) noexcept {
  std::array<std::byte, 512> request{};
  const std::size_t size =
      encode(wire::BindRequest{path, interface.name, interface.fingerprint}, request);
  RTPM_ASSERT(size > 0, "path and interface name fit a bind");
  const CallOutcome outcome =
      channel.call({wire::kSessionService, wire::kMethodBind, priority, 0, deadline},
                   ConstBytes(request).first(size));
  BindOutcome result{outcome.kind, outcome.error, {}, outcome.status, nullptr, {}};
  if (outcome.kind != CallOutcome::Kind::kReply) return result;
  if (outcome.status != wire::Status::kOk) {
    result.error = error_of(outcome.status);
    const std::string_view other = ByteReader(outcome.payload).take_text();
    std::ranges::copy(other.substr(0, result.other_interface.size() - 1),
                      result.other_interface.begin());
    return result;
  }
  const auto reply = wire::decode_bind_reply(outcome.payload);
  if (!reply) {
    result.kind = CallOutcome::Kind::kFailed;
    result.error = CallError::kBadReply;
    return result;
  }
  if (reply->fingerprint != interface.fingerprint) {
    // hp-6.1-2: a server may have more methods than we know; those that we know must be the same.
    result.differing_method = first_difference(interface, *reply, outcome.payload);
    if (result.differing_method != nullptr) {
      result.status = wire::Status::kWrongInterface;
      result.error = CallError::kNoSuchMethod;
      return result;
    }
  }
  result.bound = {channel.server_epoch(), reply->service, reply->priority,
                  reply->is_server_declared};
  return result;
}

expected<ReplyLease, CallError> Binding::Impl::call(const MethodDescriptor& method,
                                                    ConstBytes request, const CallOptions& options,
                                                    MonotonicTime deadline,
                                                    Target target) noexcept {
  const std::optional<Priority> wanted =
      options.priority ? options.priority : rt::current_priority();
  // Each round follows a lost session or connection, of which a server that keeps restarting could
  // make many.
  constexpr int kRoundCountMax = 4;
  for (int round = 0; round < kRoundCountMax; ++round) {
    Bound now_bound = remembered();
    // hp-6.1-3
    const Priority priority =
        now_bound.is_server_declared || !wanted ? now_bound.priority : *wanted;
    auto taken = endpoint.take(priority);
    if (!taken) return unexpected{taken.error()};
    TakenChannel channel(*taken);
    if (auto ready = channel->make_ready(priority, deadline); !ready) {
      return unexpected{ready.error()};
    }
    if (channel->server_epoch() != now_bound.server_epoch) {
      // Another life of the server: the object's number may be another's now (hp-6.1-4).
      const BindOutcome again = ask(*channel, priority, deadline);
      if (again.kind == CallOutcome::Kind::kLost) continue;
      if (again.kind == CallOutcome::Kind::kFailed || again.status != wire::Status::kOk) {
        return unexpected{again.error};
      }
      remember(again.bound);
      now_bound = again.bound;
    }
    const std::uint32_t service =
        target == Target::kSession ? wire::kSessionService : now_bound.service;
    const CallOutcome outcome =
        channel->call({service, method.id, priority, options.trace_id, deadline}, request);
    if (outcome.kind == CallOutcome::Kind::kReply) {
      if (outcome.status != wire::Status::kOk) return unexpected{error_of(outcome.status)};
      return ReplyLease(outcome.payload, channel.keep());
    }
    if (outcome.kind == CallOutcome::Kind::kFailed) {
      if (outcome.error == CallError::kDisconnected && method.is_idempotent) continue;
      return unexpected{outcome.error};
    }
    // hp-5.5-2: the session is gone. The same server forgets only sessions that were silent for
    // long, so it has not seen this call; a restarted one may have run it in its former life.
    const MonotonicTime begun = channel->call_begun();
    if (method.is_idempotent) continue;
    if (auto ready = channel->make_ready(priority, deadline); !ready) {
      return unexpected{ready.error() == CallError::kTimeout ? CallError::kTimeout
                                                             : CallError::kDisconnected};
    }
    const bool is_same_server = channel->server_epoch() == now_bound.server_epoch;
    if (!is_same_server || rt::now() - begun >= wire::kSessionIdleMin) {
      return unexpected{CallError::kPeerRestarted};
    }
  }
  return unexpected{CallError::kPeerRestarted};
}

expected<void, CallError> Binding::Impl::warm_up(std::span<const Priority> priorities,
                                                 MonotonicTime deadline) noexcept {
  for (const Priority priority : priorities) {
    auto taken = endpoint.take(priority);
    if (!taken) return unexpected{taken.error()};
    TakenChannel channel(*taken);
    if (auto ready = channel->make_ready(priority, deadline); !ready) return ready;
  }
  return {};
}

namespace {

std::string explain(const BindOutcome& outcome, const InterfaceDescriptor& interface,
                    const std::string& path, const std::string& url) {
  const std::string server = url.substr(0, url.size() - path.size() - 1);
  const std::string interface_name(interface.name);
  if (outcome.kind == CallOutcome::Kind::kReply) {
    if (outcome.differing_method != nullptr) {
      return "'" + path + "' at " + server + " has another " + interface_name +
             " than this program: method '" + std::string(outcome.differing_method->name) +
             "' (id " + std::to_string(outcome.differing_method->id) +
             ") is missing or differs there. Remedy: generate both from the same schema.";
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
  const MonotonicTime deadline = deadline_after(options.deadline);
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
  Endpoint& endpoint =
      node.impl().endpoint(address_of(node, options, *host, parts->port, deadline));
  auto impl = std::make_unique<Impl>(endpoint, parts->path, *url, interface,
                                     node.config().default_deadline);
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
  Binding binding(std::move(impl));
  std::vector<Priority> priorities = options.warm_up;
  // Calls without a priority of their own go at the object's.
  if (outcome.bound.is_server_declared || priorities.empty()) {
    priorities.push_back(outcome.bound.is_server_declared ? outcome.bound.priority : priority);
  }
  if (auto warm = binding.impl_->warm_up(priorities, deadline); !warm) {
    return setup_error(explain({.error = warm.error()}, interface, parts->path, *url));
  }
  return binding;
}

Binding::Binding(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
Binding::Binding(Binding&&) noexcept = default;
Binding& Binding::operator=(Binding&&) noexcept = default;
Binding::~Binding() = default;

expected<ReplyLease, CallError> Binding::call(const MethodDescriptor& method, ConstBytes request,
                                              const CallOptions& options) noexcept {
  const Duration patience = options.deadline.value_or(
      method.default_deadline > Duration{0} ? method.default_deadline : impl_->default_deadline);
  return impl_->call(method, request, options, deadline_after(patience));
}

expected<wire::PeerClock, CallError> Binding::ping(const CallOptions& options) noexcept {
  static constexpr MethodDescriptor kPing{wire::kMethodPing, "ping", 0, /*is_idempotent=*/true, {}};
  const Duration patience = options.deadline.value_or(impl_->default_deadline);
  const auto reply =
      impl_->call(kPing, {}, options, deadline_after(patience), Impl::Target::kSession);
  if (!reply) return unexpected{reply.error()};
  // A ping that had to be repeated tells no time, and may be the first call of its channel.
  constexpr wire::PeerClock kNotKnown{.uncertainty = Duration::max()};
  return reply->channel_->peer_clock(rt::now()).value_or(kNotKnown);
}

expected<void, SetupError> Binding::warm_up(std::span<const Priority> priorities) {
  const auto warm = impl_->warm_up(priorities, deadline_after(impl_->default_deadline));
  if (warm) return {};
  return setup_error(explain({.error = warm.error()}, impl_->interface, impl_->path, impl_->url));
}

std::string_view Binding::url() const noexcept {
  return impl_->url;
}

Transport Binding::transport() const noexcept {
  return impl_->endpoint.address().transport;
}

}  // namespace rtpm::rpc
