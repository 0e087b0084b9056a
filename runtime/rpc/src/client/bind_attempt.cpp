#include "client/bind_attempt.hpp"

#include <algorithm>
#include <utility>

#include "client/node_impl.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/priority.hpp"
#include "rtpm/transport/address.hpp"
#include "rtpm/transport/shared_memory.hpp"
#include "rtpm/wire/url.hpp"

namespace rtpm::rpc {
namespace {

// Texts from a server or registry are untrusted.
constexpr std::size_t kDifferenceSizeMax = 1024;

// "; most like it there: lab/arm0, lab/arm1", or empty. The list ends at a malformed path.
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

// A server on this host answers within microseconds, unless it is stopped.
constexpr Duration kMemoryPatience = std::chrono::milliseconds{100};

// The part of a bind's time for finding out whether a server that does not answer over UDP answers
// over TCP.
constexpr Duration kTcpPatience = std::chrono::milliseconds{250};

// The addresses that a URL may lead to.
struct Candidates {
  std::vector<ServerCandidate> addresses{};
  SetupError error{};      ///< The error of the last candidate that failed.
  std::string failures{};  ///< All failures, with their reasons.

  /// True if `error` alone describes the failure.
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

// Resolves host names here, where waiting for a name server does not delay a call.
Candidates candidates_of(const wire::Url& url, MonotonicTime deadline) {
  Candidates candidates;
  std::size_t left = url.hosts.size();
  for (const std::string& host : url.hosts) {
    // If there are several hosts, half of the time is kept for the hosts after this one.
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

bool is_refusal(std::error_code cause) noexcept {
  return cause == CallError::kWrongInterface || cause == CallError::kNoSuchMethod ||
         cause == CallError::kNoSuchObject || cause == CallError::kVersionUnsupported ||
         cause == CallError::kNotAllowed;
}

SetupError explain_bind(const BindOutcome& outcome, const InterfaceDescriptor& interface,
                        const std::string& path, const std::string& url,
                        const SetupError& transport_error) {
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

BindAttempt::BindAttempt(Node& node, const InterfaceDescriptor& interface,
                         const BindOptions& options, std::optional<std::uint64_t> known,
                         std::string url)
    : node_(node), interface_(interface), options_(options), known_(known), url_(std::move(url)) {}

// The transport to the server, and the folder of its socket for shared memory.
ServerAddress BindAttempt::address_of(const std::string& host, std::uint16_t port,
                                      MonotonicTime deadline) const {
  const Transport asked =
      options_.transport != Transport::kAuto ? options_.transport : node_.config().transport;
  if (asked == Transport::kUdp || asked == Transport::kTcp) return {host, port, asked, {}};
  deadline = std::min(deadline, rt::now() + kMemoryPatience);
  for (const std::string& folder : {node_.config().shared_memory_folder, std::string()}) {
    const transport::SharedMemoryAddress served{host, port, folder,
                                                node_.impl().keys.trusted_users()};
    if (transport::is_shared_memory_served(served, deadline)) {
      return {host, port, Transport::kSharedMemory, folder};
    }
  }
  return {host, port, asked == Transport::kAuto ? Transport::kUdp : asked, {}};
}

expected<Bound, SetupError> BindAttempt::open_session(Destination& at, MonotonicTime deadline) {
  const auto failed = [&](const BindOutcome& outcome, const SetupError& transport_error = {}) {
    return unexpected{explain_bind(outcome, interface_, path_, url_, transport_error)};
  };
  const Priority priority = !options_.warm_up.empty()
                                ? options_.warm_up.front()
                                : rt::current_priority().value_or(Priority{0});
  auto taken = at.endpoint.take(priority);
  if (!taken) return failed({.error = taken.error()});
  TakenChannel channel(*taken);
  BindOutcome outcome;
  // A session lost since its last use is reopened once.
  for (int attempt = 0; attempt < 2; ++attempt) {
    if (auto ready = channel->make_ready(priority, deadline); !ready) {
      return failed({.error = ready.error()}, channel->transport_error());
    }
    outcome = ask_for_object(at, interface_, known_, *channel, priority, deadline);
    if (outcome.kind == CallOutcome::Kind::kReply) break;
  }
  if (outcome.kind == CallOutcome::Kind::kReply && outcome.status == wire::Status::kOk) {
    return outcome.bound;
  }
  return failed(outcome);
}

expected<BindAttempt::Opened, SetupError> BindAttempt::open(MonotonicTime deadline) {
  const auto url = wire::parse_url(url_);
  if (!url) {
    return setup_error("'" + printable(url_) + "' is no RTPM URL", "",
                       "write rtpm://host:port/path, such as rtpm://127.0.0.1:4711/lab/arm0");
  }
  path_ = url->path;
  Candidates candidates = candidates_of(*url, deadline);
  if (candidates.addresses.empty()) {
    return setup_error("'" + printable(url_) + "' can't be bound", candidates.error);
  }
  // hp-10-2
  std::size_t left = candidates.addresses.size();
  std::optional<SetupError> refused;
  for (const ServerCandidate& candidate : candidates.addresses) {
    auto opened = open_at(candidate, part_of_time(deadline, left--));
    if (opened || candidates.is_single()) return opened;
    const SetupError& error = opened.error();
    candidates.note(candidate.address.text(), error.why.empty() ? error.what : error.why, error);
    // An answer is more informative than silence.
    if (!refused && is_refusal(error.cause)) refused = error;
  }
  if (refused) return unexpected{std::move(*refused)};
  return unexpected{SetupError{"'" + url->path + "' can't be bound at " + url->text(),
                               candidates.failures, candidates.error.remedy,
                               candidates.error.cause}};
}

// Opens a known server over UDP or TCP with sealed sessions, trying each of its keys.
expected<BindAttempt::Opened, SetupError> BindAttempt::open_at(const ServerCandidate& server,
                                                               MonotonicTime deadline) {
  ServerAddress address = address_of(server.address.host(), server.address.port(), deadline);
  if (!is_over_network(address.transport)) return open_by(address, deadline);
  const auto known = node_.impl().keys.keys_of(server.host, server.address);
  if (!known) return setup_error("'" + printable(url_) + "' is not bound", known.error());
  if (known->empty()) return open_over(address, deadline);
  // A server that changes its key has two for a while.
  std::optional<SetupError> first_error;
  std::size_t left = known->size();
  for (const access::KnownServer& entry : *known) {
    address.key = entry.key;
    auto opened = open_over(address, part_of_time(deadline, left--));
    if (opened) return opened;
    if (!first_error || is_refusal(opened.error().cause)) first_error = std::move(opened.error());
  }
  return unexpected{std::move(*first_error)};
}

// If the first bind gets no answer over UDP, it uses part of its time to find out whether the
// server answers over TCP. This only improves the error: firewalls often block UDP alone.
expected<BindAttempt::Opened, SetupError> BindAttempt::open_over(const ServerAddress& address,
                                                                 MonotonicTime deadline) {
  const auto numeric = transport::SocketAddress::parse(address.host, address.port);
  const bool is_first = !known_ && (!numeric || !numeric->is_loopback());
  if (address.transport != Transport::kUdp || !is_first) {
    return open_by(address, deadline);
  }
  const Duration reserve =
      std::min(kTcpPatience, std::max((deadline - rt::now()) / 4, Duration{0}));
  auto opened = open_by(address, deadline - reserve);
  if (opened || is_refusal(opened.error().cause)) return opened;
  ServerAddress by_tcp = address;
  by_tcp.transport = Transport::kTcp;
  const auto answer = open_by(by_tcp, deadline);
  if (!answer && !is_refusal(answer.error().cause)) return opened;
  opened.error().why = "the server answers over TCP, but not over UDP";
  opened.error().remedy =
      "let datagrams to and from UDP port " + std::to_string(address.port) +
      " pass the firewalls on the way, or call over TCP (NodeConfig::transport)";
  return opened;
}

expected<BindAttempt::Opened, SetupError> BindAttempt::open_by(const ServerAddress& address,
                                                               MonotonicTime deadline) {
  Opened opened{std::make_unique<Destination>(
      node_, node_.impl().endpoint(address, options_.is_private), path_, url_)};
  Destination& at = *opened.destination;
  const auto answer = open_session(at, deadline);
  if (!answer) return unexpected{answer.error()};
  opened.bound = *answer;
  if (options_.transport == Transport::kAuto && node_.config().transport == Transport::kAuto &&
      node_.config().collocates) {
    at.door = LocalDoor::find(answer->server_epoch);
  }
  std::vector<Priority> priorities = options_.warm_up;
  // Calls without a priority use the object's priority.
  if (answer->is_server_declared) priorities = {answer->priority};
  if (at.door) at.door->open_places(priorities);
  SetupError transport_error;
  const auto warm = priorities.empty() ? at.endpoint.warm_up_all(deadline, transport_error)
                                       : at.endpoint.warm_up(priorities, deadline, transport_error);
  if (warm) return opened;
  return unexpected{
      explain_bind({.error = warm.error()}, interface_, path_, url_, transport_error)};
}

}  // namespace rtpm::rpc
