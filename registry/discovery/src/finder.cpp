#include "rtpm/discovery/finder.hpp"

#include <algorithm>
#include <array>
#include <set>
#include <utility>

#include "folder_name.hpp"
#include "lan.hpp"
#include "rtpm/discovery/datagram.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/host.hpp"
#include "rtpm/transport/address.hpp"
#include "rtpm/transport/lan_socket.hpp"
#include "rtpm/transport/socket_folder.hpp"

namespace rtpm::discovery {
namespace {

using transport::LanPeer;
using transport::LanSocket;

/// The times of the first query and its repetitions.
constexpr std::array<Duration, 3> kQueryTimes{Duration{0}, std::chrono::milliseconds{60},
                                              std::chrono::milliseconds{150}};

std::string url_at(const std::string& host, std::uint16_t port) {
  return "rtpm://" + host + ":" + std::to_string(port) + "/" + std::string(kNamesPath);
}

/// The services found, without duplicates.
class Finds {
 public:
  explicit Finds(FoundServices& found) : found_(found) {}
  void add(FoundService service) {
    if (urls_.insert(service.url).second) found_.services.push_back(std::move(service));
  }
  void note(std::string sentence) { found_.notes.push_back(std::move(sentence)); }

 private:
  FoundServices& found_;
  std::set<std::string> urls_{};
};

expected<void, SetupError> find_on_this_host(Finds& finds) {
  const std::string folder = transport::runtime_folder();
  const auto content = transport::read_socket_folder(folder);
  if (!content) return unexpected{content.error()};
  const std::uint64_t network = transport::network_namespace();
  std::vector<FoundService> servers;
  bool has_registry = false;
  for (const std::string& text : content->names) {
    const auto name = parse_folder_name(text);
    // An address from another network namespace leads elsewhere here.
    if (!name || name->network != network) continue;
    FoundService service{name->url(), name->is_registry, name->process_id, true};
    has_registry |= service.is_registry;
    if (service.is_registry) {
      finds.add(std::move(service));
    } else {
      servers.push_back(std::move(service));
    }
  }
  // Another user's registry. A user with their own folder does not want other users' services.
  if (!has_registry && !transport::has_own_runtime_folder())
    finds.add({url_at("127.0.0.1", kRegistryPort), true, 0, true, true});
  const std::size_t count = std::min(servers.size(), kLocalServiceCountMax);
  for (std::size_t i = 0; i < count; ++i)
    finds.add(std::move(servers[i]));
  if (count < servers.size()) {
    finds.note("only " + std::to_string(count) + " of this host's " +
               std::to_string(servers.size()) +
               " servers are asked for their names; start rtpm-registryd for more");
  }
  if (content->is_cut_off) finds.note("the folder " + folder + " has more files than are read");
  return {};
}

/// Sends a query from `sockets`, each to its peers, and receives the answers.
class Inquiry {
 public:
  explicit Inquiry(std::uint8_t domain) : number_(rt::random_u64()) {
    query_ = encode({.is_answer = false, .domain = domain, .number = number_});
  }

  void add(LanSocket socket, std::vector<LanPeer> peers) {
    sockets_.push_back(std::move(socket));
    peers_.push_back(std::move(peers));
  }

  /// Calls `take` with each answer's sender and content, until the deadline or `is_done`.
  template <class Take, class IsDone>
  void run(MonotonicTime deadline, Take take, IsDone is_done) {
    const MonotonicTime begin = rt::now();
    for (std::size_t i = 0; i <= kQueryTimes.size(); ++i) {
      const bool is_last = i == kQueryTimes.size();
      const MonotonicTime until =
          std::min(deadline, begin + (is_last ? kLanPatience : kQueryTimes[i]));
      while (rt::now() < until && !is_done()) {
        transport::wait_for_any(sockets_, until);
        receive(take);
      }
      if (!is_last && !is_done()) send();
    }
  }

 private:
  void send() {
    for (std::size_t i = 0; i < sockets_.size(); ++i) {
      for (const LanPeer& peer : peers_[i])
        sockets_[i].send(query_, peer);
    }
  }

  template <class Take>
  void receive(Take& take) {
    std::array<std::byte, kDatagramSize> buffer;
    for (LanSocket& socket : sockets_) {
      // Checks the time after at most 64 datagrams, so that a flood does not delay the deadline.
      for (int i = 0; i < 64; ++i) {
        LanPeer from;
        const ConstBytes bytes = socket.receive(buffer, from);
        if (from.port == 0) break;
        // hp-10.1-5: only answers to this query count.
        const auto answer = decode(bytes);
        if (answer && answer->is_answer && answer->number == number_) take(from, *answer);
      }
    }
  }

  std::uint64_t number_;
  DatagramBytes query_{};
  std::vector<LanSocket> sockets_{};
  std::vector<std::vector<LanPeer>> peers_{};
};

/// Adds the services from answers, up to their limit.
class Answers {
 public:
  explicit Answers(Finds& finds) : finds_(finds) {}
  ~Answers() {
    std::ranges::stable_sort(services_, std::ranges::greater{}, &FoundService::is_registry);
    for (FoundService& service : services_)
      finds_.add(std::move(service));
    if (is_cut_off_) {
      finds_.note("more than " + std::to_string(kLanServiceCountMax) +
                  " name services answer on the LAN; the others are not asked");
    }
  }
  Answers(const Answers&) = delete;
  Answers& operator=(const Answers&) = delete;

  // hp-10.1-4: the services are at the address that sent the answer.
  void take(const LanPeer& from, const Datagram& answer) {
    hosts_.insert(from.ipv4);
    const std::string host = transport::address_text(from.ipv4);
    for (const AnsweredService& service : answer.services) {
      std::string url = url_at(host, service.port);
      if (std::ranges::find(services_, url, &FoundService::url) != services_.end()) continue;
      if (services_.size() == kLanServiceCountMax) {
        is_cut_off_ = true;
        return;
      }
      services_.push_back({std::move(url), service.is_registry, service.process_id});
    }
  }
  [[nodiscard]] const std::set<std::uint32_t>& hosts() const noexcept { return hosts_; }

 private:
  Finds& finds_;
  std::vector<FoundService> services_{};
  std::set<std::uint32_t> hosts_{};
  bool is_cut_off_ = false;
};

expected<void, SetupError> find_on_lan(const Scope& scope, MonotonicTime deadline, Finds& finds) {
  const auto interfaces = interfaces_of(scope);
  if (!interfaces) return unexpected{interfaces.error()};
  const LanPeer group{transport::parse_address(group_of(scope.domain)), kPort};
  Inquiry inquiry(scope.domain);
  for (const transport::NetworkInterface& interface : *interfaces) {
    auto socket = LanSocket::open(interface.address);
    if (!socket) return unexpected{socket.error()};
    inquiry.add(std::move(*socket), {group});
  }
  Answers answers(finds);
  inquiry.run(
      deadline,
      [&](const LanPeer& from, const Datagram& answer) {
        if (answer.domain == scope.domain) answers.take(from, answer);
      },
      [] { return false; });
  return {};
}

expected<void, SetupError> find_on_hosts(const Scope& scope, MonotonicTime deadline, Finds& finds) {
  std::vector<LanPeer> asked;
  const MonotonicTime end = std::min<MonotonicTime>(deadline, rt::now() + std::chrono::seconds{1});
  for (const ListedHost& listed : scope.hosts) {
    const auto addresses = transport::addresses_of(listed.host, kPort, end);
    if (!addresses) {
      finds.note(addresses.error().reason());
      continue;
    }
    const auto found = std::ranges::find_if(*addresses, &transport::SocketAddress::is_ipv4);
    if (found == addresses->end()) {
      finds.note(listed.host + " has no IPv4 address, which discovery takes");
      continue;
    }
    const std::uint32_t ipv4 = transport::parse_address(found->host());
    if (listed.port != 0) {
      finds.add({url_at(transport::address_text(ipv4), listed.port), true});
    } else {
      asked.push_back({ipv4, kPort});
    }
  }
  if (asked.empty()) return {};
  auto socket = LanSocket::open("0.0.0.0");
  if (!socket) return unexpected{socket.error()};
  Inquiry inquiry(scope.domain);
  inquiry.add(std::move(*socket), asked);
  std::set<std::uint32_t> silent;
  for (const LanPeer& peer : asked)
    silent.insert(peer.ipv4);
  {
    Answers answers(finds);
    inquiry.run(
        deadline,
        [&](const LanPeer& from, const Datagram& answer) {
          const bool is_asked = std::ranges::find(asked, from) != asked.end();
          if (!is_asked) return;
          answers.take(from, answer);
          silent.erase(from.ipv4);
        },
        [&] { return silent.empty(); });
  }
  // A registry need not answer queries.
  for (const std::uint32_t ipv4 : silent)
    finds.add({url_at(transport::address_text(ipv4), kRegistryPort), true});
  return {};
}

}  // namespace

expected<FoundServices, SetupError> find_services(const Scope& scope, MonotonicTime deadline) {
  FoundServices found;
  Finds finds(found);
  if (scope.is_url()) {
    finds.add({scope.url, true});
    return found;
  }
  expected<void, SetupError> done = find_on_this_host(finds);
  if (done && scope.kind == Scope::Kind::kLan) done = find_on_lan(scope, deadline, finds);
  if (done && scope.kind == Scope::Kind::kHosts) done = find_on_hosts(scope, deadline, finds);
  if (!done) return unexpected{std::move(done.error())};
  return found;
}

}  // namespace rtpm::discovery
