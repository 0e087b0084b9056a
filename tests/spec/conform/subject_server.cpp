#include <fcntl.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <map>
#include <optional>
#include <sstream>
#include <string>
#include <utility>

#include "rtpm/rt/clock.hpp"
#include "rtpm/wire/control.hpp"
#include "rtpm/wire/server_sessions.hpp"
#include "subject.hpp"

namespace rtpm::spec {
namespace {

constexpr std::uint32_t kService = 1;
constexpr std::string_view kPath = "lab/arm0";
constexpr std::string_view kInterface = "lab.Arm";

std::optional<wire::Status> status_named(const std::string& name) {
  for (std::size_t i = 0; i < wire::kStatusCount; ++i) {
    if (to_string(static_cast<wire::Status>(i)) == name) return static_cast<wire::Status>(i);
  }
  return std::nullopt;
}

/// Parses bands such as "0-16383,16384-32767".
std::vector<Band> bands_of(const std::string& text) {
  std::vector<Band> bands;
  std::istringstream parts(text);
  for (std::string part; std::getline(parts, part, ',');) {
    const std::size_t dash = part.find('-');
    bands.push_back({std::stoi(part.substr(0, dash)), std::stoi(part.substr(dash + 1))});
  }
  return bands;
}

class ServerSide final : public Side {
 public:
  ServerSide(const Line& setup, const Faults& faults) : medium_(medium_of(setup)), faults_(faults) {
    config_.medium = medium_;
    config_.ceiling = static_cast<int>(setup.number("ceiling"));
    config_.epoch = random_number();
    config_.key = {random_number(), random_number()};
    config_.clock_domain = setup.number("clock_domain");
    config_.session_count_max = static_cast<std::uint32_t>(setup.number("session_count_max"));
    config_.message_size_max = static_cast<std::uint32_t>(setup.number("message_size_max"));
    start(bands_of(setup.value("bands")));
    listen(address_of(setup.value("address")));
  }
  ~ServerSide() override {
    ::close(socket_);
    for (const auto& [number, connection] : connections_)
      ::close(connection.socket);
  }

  [[nodiscard]] std::vector<int> sockets() const override {
    std::vector<int> sockets{socket_};
    for (const auto& [number, connection] : connections_)
      sockets.push_back(connection.socket);
    return sockets;
  }
  [[nodiscard]] MonotonicTime next_time() const override {
    MonotonicTime next = kNever;
    for (const Lane& lane : lanes_)
      next = std::min(next, lane.sessions->next_time());
    return next;
  }
  void on_time() override {
    for (Lane& lane : lanes_)
      lane.sessions->on_time(rt::now());
    report_cancelled();
  }

  void on_readable(int socket) override {
    if (socket == socket_ && medium_ == wire::Medium::kStream) {
      accept_connection();
    } else if (socket == socket_) {
      read_datagrams();
    } else {
      const auto found = std::ranges::find_if(
          connections_, [&](const auto& entry) { return entry.second.socket == socket; });
      if (found != connections_.end()) read_stream(found->first);
    }
  }

  void on_line(const Line& line) override {
    if (line.word(0) == "counters") {
      wire::FrameCounters counters;
      for (const Lane& lane : lanes_)
        counters.add(lane.sessions->counters());
      say_counters(counters);
    } else if (line.word(0) == "does" && line.word(1) == "stop") {
      for (Lane& lane : lanes_) {
        while (const auto outgoing = lane.sessions->close_next(rt::now()))
          send_to(outgoing->peer, outgoing->frame);
      }
    } else if (line.word(0) == "does") {
      act_on_call(line);
    } else {
      say("cannot " + line.word(0));
    }
    report_cancelled();
  }

 private:
  struct Connection {
    int socket = -1;
    FrameSplitter splitter;
    wire::ServerSessions* lane = nullptr;  ///< Chosen by the first frame.
  };
  struct Lane {
    Band band{};
    std::vector<std::byte> large_memory;
    std::vector<std::byte> stream_memory;
    std::unique_ptr<wire::ServerSessions> sessions;
  };
  struct Running {
    wire::Request request;
    wire::ServerSessions* sessions = nullptr;
  };

  void start(const std::vector<Band>& bands) {
    config_.lane_count = static_cast<std::uint32_t>(bands.size());
    for (const Band& band : bands) {
      Lane& lane = lanes_.emplace_back();
      lane.band = config_.band = band;
      lane.large_memory.resize(std::size_t{4} * config_.message_size_max);
      lane.stream_memory.resize(4 * stream_buffer_size(medium_));
      config_.large_memory = lane.large_memory;
      config_.stream_memory = lane.stream_memory;
      lane.sessions = std::make_unique<wire::ServerSessions>(config_);
      ++config_.lane;
    }
  }
  /// hp-11-2: over UDP each frame's priority selects its lane, over TCP the first frame's priority.
  wire::ServerSessions& lane_of(ConstBytes frame, const wire::PeerAddress& peer) {
    const auto connection = connections_.find(peer.high);
    const bool is_connected = connection != connections_.end();
    if (is_connected && connection->second.lane != nullptr) return *connection->second.lane;
    wire::ServerSessions* chosen = lanes_.front().sessions.get();
    const int priority =
        frame.size() < wire::kHeaderSize ? 0 : load_le<std::uint16_t>(frame.data() + 4);
    for (const Lane& lane : lanes_) {
      if (lane.band.low.value() <= priority && priority <= lane.band.high.value())
        chosen = lane.sessions.get();
    }
    if (is_connected) connection->second.lane = chosen;
    return *chosen;
  }

  void listen(const sockaddr_in& wanted) {
    const bool is_stream = medium_ == wire::Medium::kStream;
    socket_ = ::socket(AF_INET, (is_stream ? SOCK_STREAM : SOCK_DGRAM) | SOCK_CLOEXEC, 0);
    const int yes = 1;
    ::setsockopt(socket_, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
    sockaddr_in address = wanted;
    socklen_t size = sizeof address;
    if (::bind(socket_, reinterpret_cast<const sockaddr*>(&address), size) != 0 ||
        (is_stream && ::listen(socket_, 8) != 0)) {
      return say("cannot serve " + text_of(wanted));
    }
    ::getsockname(socket_, reinterpret_cast<sockaddr*>(&address), &size);
    say("ready address=" + text_of(address) + " service=" + std::to_string(kService));
  }

  void accept_connection() {
    const int socket = ::accept4(socket_, nullptr, nullptr, SOCK_CLOEXEC);
    if (socket < 0) return;
    const int yes = 1;
    ::setsockopt(socket, IPPROTO_TCP, TCP_NODELAY, &yes, sizeof yes);
    connections_[++connection_count_] = {socket, FrameSplitter(faults_), nullptr};
  }
  void read_datagrams() {
    std::vector<std::byte> frame(65536);
    sockaddr_in from{};
    socklen_t size = sizeof from;
    ssize_t received = 0;
    while ((received = ::recvfrom(socket_, frame.data(), frame.size(), MSG_DONTWAIT,
                                  reinterpret_cast<sockaddr*>(&from), &size)) >= 0) {
      const wire::PeerAddress peer{.low = from.sin_addr.s_addr, .port = from.sin_port};
      take(ConstBytes(frame).first(static_cast<std::size_t>(received)), peer);
    }
  }
  void read_stream(std::uint64_t number) {
    std::vector<std::byte> bytes(65536);
    const ssize_t size = ::recv(connections_[number].socket, bytes.data(), bytes.size(), 0);
    if (size <= 0) return disconnect(number);
    FrameSplitter& splitter = connections_[number].splitter;
    splitter.add(ConstBytes(bytes).first(static_cast<std::size_t>(size)));
    for (auto frame = splitter.next(); !frame.empty(); frame = splitter.next()) {
      take(frame, {.high = number});
      if (!connections_.contains(number)) return;
    }
  }
  void disconnect(std::uint64_t number) {
    ::close(connections_[number].socket);
    connections_.erase(number);
    for (Lane& lane : lanes_)
      lane.sessions->end_connection({.high = number});
    report_cancelled();
  }

  void take(ConstBytes bytes, const wire::PeerAddress& peer) {
    const auto frame = as_read(bytes, faults_);
    if (faults_.runs_copies) run_copy(frame);
    wire::ServerSessions& sessions = lane_of(frame, peer);
    const wire::Verdict verdict = sessions.on_frame(frame, peer, rt::now());
    switch (verdict.action) {
      case wire::Verdict::Action::kNothing:
        break;
      case wire::Verdict::Action::kSend:
        send_all(sessions, peer, verdict.frame);
        break;
      case wire::Verdict::Action::kHangUp:
        disconnect(peer.high);
        break;
      case wire::Verdict::Action::kDispatch:
        dispatch(sessions, verdict.request, peer);
        break;
    }
    report_cancelled();
    if (verdict.credit_tag != 0) static_cast<void>(give_item(verdict.credit_tag));
  }
  static void run_copy(ConstBytes frame) {
    const auto header = wire::decode(frame);
    if (!header || header->kind != wire::FrameKind::kCall) return;
    if ((header->flags & wire::kFlagRepeated) == 0) return;
    say("sees run again service=1 method=2 payload=" +
        hex_of_bytes(frame.subspan(wire::kHeaderSize)));
  }

  void dispatch(wire::ServerSessions& sessions, const wire::Request& request,
                const wire::PeerAddress& peer) {
    if (request.header.service == wire::kSessionService)
      return serve_session(sessions, request, peer);
    const auto run = static_cast<std::uint32_t>(++run_count_);
    running_[run] = {request, &sessions};
    sessions.set_tag(request, run);
    const auto left =
        std::chrono::duration_cast<std::chrono::microseconds>(request.deadline - rt::now());
    say("sees run " + std::to_string(run) + " service=" + std::to_string(request.header.service) +
        " method=" + std::to_string(request.header.method) + " deadline_us=" +
        std::to_string(left.count()) + " payload=" + hex_of_bytes(request.payload));
  }
  void serve_session(wire::ServerSessions& sessions, const wire::Request& request,
                     const wire::PeerAddress& peer) {
    std::vector<std::byte> reply;
    wire::Status status = wire::Status::kOk;
    if (request.header.method == wire::kMethodBind) {
      status = bind(request.payload, reply);
    } else if (request.header.method != wire::kMethodPing) {
      status = wire::Status::kNoSuchMethod;
    }
    std::ranges::copy(reply, sessions.reply_buffer(request, rt::now()).begin());
    const auto size = static_cast<std::uint32_t>(reply.size());
    send_all(sessions, peer, sessions.complete(request, status, size, rt::now()));
  }
  static wire::Status bind(ConstBytes payload, std::vector<std::byte>& reply) {
    const auto request = wire::decode_bind_request(payload);
    if (!request) return wire::Status::kBadRequest;
    if (request->path != kPath) return wire::Status::kNoSuchObject;
    if (request->interface != kInterface) {
      reply.resize(2 + kInterface.size());
      reply[0] = static_cast<std::byte>(kInterface.size());
      std::ranges::transform(kInterface, reply.begin() + 2,
                             [](char letter) { return static_cast<std::byte>(letter); });
      return wire::Status::kWrongInterface;
    }
    constexpr std::array<wire::MethodEntry, 2> kMethods{{{1, 0x11111111}, {2, 0x22222222}}};
    reply.resize(wire::BindReply::kSize + kMethods.size() * wire::MethodEntry::kSize);
    encode(wire::BindReply{.service = kService,
                           .fingerprint = 0x0123456789abcdef,
                           .method_count = kMethods.size()},
           reply);
    for (std::size_t i = 0; i < kMethods.size(); ++i) {
      encode(kMethods[i],
             MutableBytes(reply).subspan(wire::BindReply::kSize + i * wire::MethodEntry::kSize));
    }
    return wire::Status::kOk;
  }

  void act_on_call(const Line& line) {
    const auto found = running_.find(static_cast<std::uint32_t>(std::stoul(line.word(2))));
    if (found == running_.end()) return say("cannot find the call " + line.word(2));
    const wire::Request request = found->second.request;
    wire::ServerSessions& sessions = *found->second.sessions;
    const auto peer = sessions.peer_of(request);
    const auto payload = bytes_of(line.value("payload"));
    const auto size = static_cast<std::uint32_t>(payload.size());
    if (line.word(1) == "item") {
      const std::uint32_t size_max = sessions.item_size_max(request);
      if (size_max > 0 && size > size_max) return say("sees item_too_large " + line.word(2));
      items_[found->first] = payload;
      if (!give_item(found->first)) {
        items_.erase(found->first);
        say("sees no_credit " + line.word(2));
      }
      return;
    }
    const auto status = status_named(line.value("status"));
    if (!status) return say("cannot end with status " + line.value("status"));
    ConstBytes frame;
    if (line.word(1) == "receipt") {
      frame = sessions.accept(request, *status, rt::now());
    } else if (line.word(1) == "complete") {
      std::ranges::copy(payload, sessions.reply_buffer(request, rt::now()).begin());
      running_.erase(found);
      frame = sessions.complete(request, *status, size, rt::now());
    } else {
      return say("cannot " + line.word(1));
    }
    if (peer) send_all(sessions, *peer, frame);
  }

  /// Writes as much of the call's item as its caller accepts; false if that is nothing.
  bool give_item(std::uint32_t run) {
    const auto item = items_.find(run);
    const auto running = running_.find(run);
    if (item == items_.end() || running == running_.end()) return false;
    const wire::Request& request = running->second.request;
    wire::ServerSessions& sessions = *running->second.sessions;
    const auto peer = sessions.peer_of(request);
    bool has_given = false;
    do {
      const ConstBytes frame = sessions.push_item(request, item->second, rt::now());
      if (frame.empty()) return has_given;
      send_to(*peer, frame);
      has_given = true;
    } while (sessions.is_item_midway(request));
    items_.erase(item);
    return true;
  }
  /// Sends a frame, and then the frames that the sessions have to send.
  void send_all(wire::ServerSessions& sessions, const wire::PeerAddress& peer, ConstBytes frame) {
    for (; !frame.empty(); frame = sessions.next_frame(rt::now()))
      send_to(peer, frame);
  }
  void send_to(const wire::PeerAddress& peer, ConstBytes frame) {
    const auto sent = with_faults(frame, faults_);
    if (medium_ == wire::Medium::kStream) {
      const auto found = connections_.find(peer.high);
      if (found == connections_.end()) return;
      (void)::send(found->second.socket, sent.data(), sent.size(), MSG_NOSIGNAL);
      return;
    }
    sockaddr_in to{};
    to.sin_family = AF_INET;
    to.sin_addr.s_addr = static_cast<in_addr_t>(peer.low);
    to.sin_port = static_cast<in_port_t>(peer.port);
    (void)::sendto(socket_, sent.data(), sent.size(), 0, reinterpret_cast<const sockaddr*>(&to),
                   sizeof to);
  }
  void report_cancelled() {
    for (Lane& lane : lanes_) {
      for (std::uint32_t run = lane.sessions->next_cancelled(); run != 0;
           run = lane.sessions->next_cancelled()) {
        say("sees cancelled " + std::to_string(run));
      }
    }
  }

  wire::Medium medium_;
  Faults faults_;
  std::map<std::uint32_t, std::vector<std::byte>> items_;  ///< Items not yet written completely.
  wire::ServerSessionsConfig config_;
  std::vector<Lane> lanes_;
  int socket_ = -1;
  std::uint64_t connection_count_ = 0;
  std::map<std::uint64_t, Connection> connections_;
  std::uint64_t run_count_ = 0;
  std::map<std::uint32_t, Running> running_;
};

}  // namespace

std::unique_ptr<Side> make_server(const Line& setup, const Faults& faults) {
  return std::make_unique<ServerSide>(setup, faults);
}

}  // namespace rtpm::spec
