#include "rtpm/discovery/announcement.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <optional>
#include <utility>

#include "answer_limit.hpp"
#include "folder_name.hpp"
#include "lan.hpp"
#include "rtpm/discovery/datagram.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/host.hpp"
#include "rtpm/rt/log.hpp"
#include "rtpm/rt/thread.hpp"
#include "rtpm/transport/address.hpp"
#include "rtpm/transport/lan_socket.hpp"
#include "rtpm/transport/socket_folder.hpp"

namespace rtpm::discovery {
namespace {

using transport::LanPeer;
using transport::LanSocket;

/// Datagrams received from one socket before the other sockets get their turn.
constexpr int kTurn = 64;

/// Whether answers may be sent to that address.
bool is_answerable(const LanPeer& peer) noexcept {
  const std::uint32_t first = peer.ipv4 >> 24;
  return peer.port != 0 && first != 0 && first < 224;
}

/// hp-10.1-3: an IPv4 address that other hosts can reach.
bool is_of_network(const std::string& host) {
  const auto address = transport::SocketAddress::parse(host, 0);
  return address && address->is_ipv4() && !address->is_loopback();
}

/// See AnnouncedService::hosts.
std::string announced_host(const std::vector<std::string>& hosts, const Scope& scope) {
  if (const auto interfaces = interfaces_of(scope); scope.kind == Scope::Kind::kLan && interfaces) {
    for (const transport::NetworkInterface& interface : *interfaces) {
      if (is_of_network(interface.address) &&
          std::ranges::find(hosts, interface.address) != hosts.end())
        return interface.address;
    }
  }
  const auto found = std::ranges::find_if(hosts, is_of_network);
  return found == hosts.end() ? hosts.front() : *found;
}

}  // namespace

class Announcement::Impl {
 public:
  explicit Impl(AnnouncedService service)
      : service_(std::move(service)), process_id_(transport::process_id()) {}
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;
  ~Impl() {
    if (!thread_.is_running()) return;
    is_stopping_ = true;
    // The thread only waits for datagrams.
    if (wake_) wake_->send(DatagramBytes{}, wake_peer_);
    thread_.join();
  }

  [[nodiscard]] expected<void, SetupError> begin(const Scope& scope) {
    host_ = announced_host(service_.hosts, scope);
    auto socket = transport::FolderSocket::create(
        transport::runtime_folder(), to_text({service_.is_registry, host_, service_.port,
                                              process_id_, transport::network_namespace()},
                                             static_cast<std::uint32_t>(rt::random_u64())));
    if (!socket) return unexpected{std::move(socket.error())};
    socket_.emplace(std::move(*socket));
    if (!scope.is_of_lan()) return {};
    // hp-10.1-3: addresses that only this host can reach are not announced on the LAN.
    if (!is_of_network(host_)) {
      say_once("no answers to the LAN: " + host_ +
               " is no IPv4 address of a network; serve one with --host");
      return {};
    }
    return answer(scope);
  }

  void keep() { socket_->keep(); }
  [[nodiscard]] AnswerCounts counts() const noexcept {
    return {answered_, malformed_, other_domain_, suppressed_};
  }

 private:
  [[nodiscard]] expected<void, SetupError> answer(const Scope& scope) {
    domain_ = scope.domain;
    // Answers are sent from this socket, so that they come from the served address.
    auto unicast = LanSocket::open(host_, kPort);
    if (!unicast) return unexpected{std::move(unicast.error())};
    sockets_.push_back(std::move(*unicast));
    if (scope.kind == Scope::Kind::kLan) {
      const auto interfaces = interfaces_of(scope);
      if (!interfaces) return unexpected{interfaces.error()};
      auto joined = LanSocket::join(group_of(domain_), kPort, *interfaces);
      if (!joined) return unexpected{std::move(joined.error())};
      sockets_.push_back(std::move(*joined));
    }
    auto wake = LanSocket::open("127.0.0.1");
    auto waker = LanSocket::open("127.0.0.1");
    if (!wake || !waker) return unexpected{(wake ? waker : wake).error()};
    wake_peer_ = wake->name();
    sockets_.push_back(std::move(*wake));
    wake_.emplace(std::move(*waker));
    say_once("answers to the LAN come from " + host_ + ":" + std::to_string(kPort));
    auto thread = rt::Thread::start({.name = "rtpm-discovery", .realtime = rt::RealtimeMode::kOff},
                                    [this] { run(); });
    if (!thread) return unexpected{std::move(thread.error())};
    thread_ = std::move(*thread);
    return {};
  }

  void run() {
    while (!is_stopping_) {
      transport::wait_for_any(sockets_, kNever);
      for (std::size_t i = 0; i + 1 < sockets_.size(); ++i)
        receive(sockets_[i], /*is_unicast=*/i == 0);
      drain(sockets_.back());
    }
  }

  static void drain(LanSocket& socket) {
    std::array<std::byte, kDatagramSize> buffer;
    LanPeer from{0, 1};
    while (from.port != 0)
      static_cast<void>(socket.receive(buffer, from));
  }

  void receive(LanSocket& socket, bool is_unicast) {
    std::array<std::byte, kDatagramSize> buffer;
    for (int i = 0; i < kTurn; ++i) {
      LanPeer from;
      const ConstBytes bytes = socket.receive(buffer, from);
      if (from.port == 0) return;
      const auto query = decode(bytes);
      if (!query || query->is_answer || !is_answerable(from)) {
        ++malformed_;
        log_.write("dropped a datagram from " + transport::to_string(from) + " that is no query");
      } else if (!is_unicast && query->domain != domain_) {
        ++other_domain_;
      } else if (!limit_.admit(from.ipv4, rt::now())) {
        ++suppressed_;
        log_.write("gave no answer to " + transport::to_string(from) + ", which asks too often");
      } else {
        // hp-10.1-4: an answer has the size of its query.
        const DatagramBytes reply =
            encode({.is_answer = true,
                    .domain = query->domain,
                    .number = query->number,
                    .services = is_unicast ? services_of_this_address()
                                           : std::vector<AnsweredService>{own_service()}});
        if (sockets_.front().send(reply, from)) ++answered_;
      }
    }
  }

  [[nodiscard]] AnsweredService own_service() const noexcept {
    return {service_.port, service_.is_registry, process_id_};
  }

  /// A query to the host reaches only one of its programs, which answers for all of this user.
  [[nodiscard]] std::vector<AnsweredService> services_of_this_address() const {
    std::vector<AnsweredService> services{own_service()};
    const auto content = transport::read_socket_folder(transport::runtime_folder());
    if (!content) return services;
    for (const std::string& text : content->names) {
      const auto name = parse_folder_name(text);
      const bool is_here = name && name->host == host_ &&
                           name->network == transport::network_namespace() &&
                           name->port != service_.port;
      if (is_here) services.push_back({name->port, name->is_registry, name->process_id});
    }
    std::ranges::stable_sort(services, std::ranges::greater{}, &AnsweredService::is_registry);
    return services;
  }

  const AnnouncedService service_;
  std::string host_{};  ///< The announced host.
  const std::uint32_t process_id_;
  std::optional<transport::FolderSocket> socket_{};
  std::uint8_t domain_ = 0;
  /// One for the served address, one for the group, one to wake the thread.
  std::vector<LanSocket> sockets_{};
  std::optional<LanSocket> wake_{};
  LanPeer wake_peer_{};
  AnswerLimit limit_{};
  rt::Log log_{"discovery", {.burst = 3, .interval = std::chrono::seconds{10}}};
  std::atomic<bool> is_stopping_ = false;
  std::atomic<std::uint64_t> answered_ = 0;
  std::atomic<std::uint64_t> malformed_ = 0;
  std::atomic<std::uint64_t> other_domain_ = 0;
  std::atomic<std::uint64_t> suppressed_ = 0;
  rt::Thread thread_;
};

expected<std::unique_ptr<Announcement>, SetupError> Announcement::create(const Scope& scope,
                                                                         AnnouncedService service) {
  auto impl = std::make_unique<Impl>(std::move(service));
  if (auto begun = impl->begin(scope); !begun) return unexpected{std::move(begun.error())};
  return std::unique_ptr<Announcement>(new Announcement(std::move(impl)));
}

Announcement::Announcement(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
Announcement::~Announcement() = default;

void Announcement::keep() {
  impl_->keep();
}
AnswerCounts Announcement::counts() const noexcept {
  return impl_->counts();
}

}  // namespace rtpm::discovery
