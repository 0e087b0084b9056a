#include <netinet/tcp.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <deque>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "rtpm/rt/clock.hpp"
#include "rtpm/wire/client_channel.hpp"
#include "rtpm/wire/control.hpp"
#include "subject.hpp"

namespace rtpm::spec {
namespace {

using wire::ChannelEvent;

wire::ClientChannelConfig config_of(const Line& setup, const Faults& faults) {
  wire::ClientChannelConfig config;
  config.medium = medium_of(setup);
  config.client_epoch = random_number();
  config.channel = 1;
  config.clock_domain = setup.number("clock_domain");
  config.message_size_max = static_cast<std::uint32_t>(setup.number("message_size_max"));
  config.open_call_max = wire::kCallWindow;
  // The channel's first handshake has the number behind it.
  if (!faults.numbers_from_one) {
    config.handshake_number = static_cast<std::uint32_t>(random_number());
  }
  return config;
}

class ClientSide final : public Side {
 public:
  ClientSide(const Line& setup, const Faults& faults)
      : medium_(medium_of(setup)),
        message_size_max_(static_cast<std::uint32_t>(setup.number("message_size_max"))),
        faults_(faults),
        server_(address_of(setup.value("address"))),
        channel_(config_of(setup, faults), buffer_) {
    channel_.set_on_host(true);
    std::string ready = "ready";
    if (medium_ == wire::Medium::kDatagram) {
      connect();
      sockaddr_in own{};
      socklen_t size = sizeof own;
      ::getsockname(socket_, reinterpret_cast<sockaddr*>(&own), &size);
      if (!faults.hides_address) ready += " address=" + text_of(own);
    }
    say(ready);
  }
  ~ClientSide() override { disconnect(); }

  [[nodiscard]] std::vector<int> sockets() const override {
    return socket_ < 0 ? std::vector<int>{} : std::vector<int>{socket_};
  }
  [[nodiscard]] MonotonicTime next_time() const override { return channel_.next_time(); }

  void on_time() override {
    for (ChannelEvent event = channel_.on_time(rt::now());
         event.kind != ChannelEvent::Kind::kNothing; event = channel_.on_time(rt::now())) {
      report(event);
    }
  }

  void on_readable(int) override {
    std::vector<std::byte> bytes(65536);
    const ssize_t size = ::recv(socket_, bytes.data(), bytes.size(), MSG_DONTWAIT);
    const auto there = ConstBytes(bytes).first(size < 0 ? 0 : static_cast<std::size_t>(size));
    if (medium_ == wire::Medium::kDatagram) {
      if (size >= 0) take(there);
      return;
    }
    if (size < 0) return;
    if (size == 0) {
      disconnect();
      channel_.reset();
      return;
    }
    splitter_.add(there);
    for (auto frame = splitter_.next(); !frame.empty(); frame = splitter_.next())
      take(frame);
  }

  void on_line(const Line& line) override {
    if (line.word(0) == "counters") return say_counters(channel_.counters());
    const std::string what = line.word(1);
    if (what == "open") {
      connect();
      send(channel_.open(priority_of(line), deadline_of(line), rt::now()));
    } else if (what == "call") {
      call(line);
    } else if (what == "bind") {
      bind(line);
    } else if (what == "take") {
      take_items(line.word(2));
    } else if (what == "cancel") {
      send(channel_.cancel(index_of(line.word(2)), rt::now()));
    } else if (what == "close") {
      send(channel_.close(rt::now()));
    } else {
      say("cannot " + what);
    }
  }

 private:
  static Priority priority_of(const Line& line) {
    return static_cast<int>(line.number("priority"));
  }
  static MonotonicTime deadline_of(const Line& line) {
    return rt::now() + std::chrono::microseconds(line.number("timeout_us"));
  }

  void connect() {
    if (socket_ >= 0) return;
    const bool is_stream = medium_ == wire::Medium::kStream;
    socket_ = ::socket(AF_INET, (is_stream ? SOCK_STREAM : SOCK_DGRAM) | SOCK_CLOEXEC, 0);
    if (::connect(socket_, reinterpret_cast<const sockaddr*>(&server_), sizeof server_) != 0)
      return say("cannot connect to " + text_of(server_));
    const int yes = 1;
    if (is_stream) ::setsockopt(socket_, IPPROTO_TCP, TCP_NODELAY, &yes, sizeof yes);
  }
  void disconnect() {
    if (socket_ >= 0) ::close(socket_);
    socket_ = -1;
    splitter_ = FrameSplitter(faults_);
  }
  void send(ConstBytes frame) {
    if (frame.empty() || socket_ < 0) return;
    const auto sent = with_faults(frame, faults_);
    if (faults_.repeats_rarely && is_early_copy(sent)) return;
    if (faults_.tells_no_gap && tells_gap(sent)) return;
    if (sent[3] == static_cast<std::byte>(wire::FrameKind::kHello)) hello_ = sent;
    (void)::send(socket_, sent.data(), sent.size(), MSG_NOSIGNAL);
  }
  static bool tells_gap(ConstBytes frame) {
    const auto header = wire::decode(frame);
    return header && header->kind == wire::FrameKind::kCredit &&
           (header->flags & wire::kFlagAckWanted) == 0 &&
           load_le<std::uint64_t>(frame.data() + wire::kHeaderSize + 8) != 0;
  }
  /// The fault: an answer to a COOKIE that the channel did not answer at once.
  void answer_cookie(ConstBytes frame) {
    const auto header = wire::decode(frame);
    if (!header || header->kind != wire::FrameKind::kCookie || hello_.empty()) return;
    std::ranges::copy(frame.subspan(wire::kHeaderSize), hello_.begin() + wire::kHeaderSize + 40);
    wire::mark_repeated(hello_.data());
    send(std::vector<std::byte>(hello_));
  }
  bool is_early_copy(ConstBytes frame) {
    const auto header = wire::decode(frame);
    if (!header || header->kind != wire::FrameKind::kCall) return false;
    const MonotonicTime now = rt::now();
    const bool is_copy = (header->flags & wire::kFlagRepeated) != 0;
    if (is_copy && now - call_sent_ < std::chrono::seconds{2}) return true;
    call_sent_ = now;
    return false;
  }
  void send_more() {
    for (ConstBytes frame = channel_.next_frame(rt::now()); !frame.empty();
         frame = channel_.next_frame(rt::now())) {
      send(frame);
    }
  }

  /// A call that was open when its session was lost.
  struct LostCall {
    std::string name;
    std::uint64_t server_epoch = 0;
    MonotonicTime begun{};
  };
  [[nodiscard]] std::vector<LostCall> open_calls() const {
    std::vector<LostCall> open;
    for (const auto& [index, name] : names_) {
      if (!channel_.is_open(index)) continue;
      open.push_back({name, channel_.welcome().server_epoch, channel_.call_begun(index)});
    }
    return open;
  }
  /// hp-5.5-2: reports which calls of the lost session may have run.
  void judge_lost() {
    for (const LostCall& call : std::exchange(lost_, {})) {
      const bool has_not_run = wire::has_not_run(call.server_epoch, channel_.welcome().server_epoch,
                                                 call.begun, rt::now());
      say((has_not_run ? "sees not_run " : "sees may_have_run ") + call.name);
    }
  }

  void take(ConstBytes bytes) {
    const auto frame = as_read(bytes, faults_);
    const std::vector<LostCall> open = open_calls();
    ChannelEvent event = channel_.on_frame(frame, rt::now());
    if (event.kind == ChannelEvent::Kind::kNeedBuffer) {
      channel_.set_reply_buffer(memory_.emplace_back(event.reply_size), event.call);
      event = channel_.on_frame(frame, rt::now());
    }
    if (event.kind == ChannelEvent::Kind::kLost) lost_ = open;
    if (faults_.answers_every_cookie && event.frame.empty()) answer_cookie(frame);
    report(event);
    if (event.kind == ChannelEvent::Kind::kReady) judge_lost();
  }

  void report(const ChannelEvent& event) {
    const std::string status = " status=" + std::string(to_string(event.status));
    switch (event.kind) {
      case ChannelEvent::Kind::kNothing:
      case ChannelEvent::Kind::kSend:
      case ChannelEvent::Kind::kItems:
      case ChannelEvent::Kind::kNeedBuffer:
        break;
      case ChannelEvent::Kind::kReady:
        say("sees ready");
        break;
      case ChannelEvent::Kind::kReply:
        report_reply(event, status);
        break;
      case ChannelEvent::Kind::kRefused:
        say("sees refused" + status);
        break;
      case ChannelEvent::Kind::kLost:
        say("sees lost");
        break;
      case ChannelEvent::Kind::kClosed:
        say("sees closed");
        break;
      case ChannelEvent::Kind::kTimeout:
        say("sees timeout" + (channel_.session() == 0 ? "" : ' ' + names_[event.call]));
        break;
      case ChannelEvent::Kind::kBroken:
        say("sees broken");
        if (!faults_.hangs_on) disconnect();
        break;
    }
    send(event.frame);
    send_more();
  }
  void report_reply(const ChannelEvent& event, const std::string& status) {
    const std::string& name = names_[event.call];
    if (!binds_.contains(name)) {
      return say("sees result " + name + status + " payload=" + hex_of_bytes(event.payload));
    }
    const auto reply = wire::decode_bind_reply(event.payload);
    const bool is_good = event.status == wire::Status::kOk && reply;
    say("sees bound " + name + (is_good ? " service=" + std::to_string(reply->service) : ""));
  }

  void call(const Line& line) {
    wire::CallParameters parameters{static_cast<std::uint32_t>(line.number("service")),
                                    static_cast<std::uint16_t>(line.number("method")),
                                    priority_of(line), line.number("trace_id"), deadline_of(line)};
    const std::string delivery = line.value("delivery");
    if (delivery == "receipt") parameters.delivery = wire::Delivery::kReceipt;
    if (delivery == "sent") parameters.delivery = wire::Delivery::kSent;
    parameters.stream_window = static_cast<std::uint32_t>(line.number("window"));
    if (parameters.stream_window > 0) {
      const std::uint32_t byte_window = wire::stream_bytes_first(medium_);
      const auto frame_size = static_cast<std::uint32_t>(wire::frame_payload_max(medium_));
      parameters.stream_buffers = {
          .frames = memory_.emplace_back(
              frame_size *
              wire::stream_frame_count(medium_, parameters.stream_window, byte_window)),
          .frame_size = frame_size,
          .item = memory_.emplace_back(message_size_max_),
          .byte_window = byte_window};
    }
    begin(line.word(2), parameters, bytes_of(line.value("payload")));
  }
  void bind(const Line& line) {
    std::vector<std::byte> payload(512);
    const std::string path = line.value("path");
    const std::string interface = line.value("interface");
    payload.resize(
        wire::encode(wire::BindRequest{path, interface, line.number("fingerprint")}, payload));
    binds_[line.word(2)] = true;
    begin(line.word(2),
          {wire::kSessionService, wire::kMethodBind, priority_of(line), 0, deadline_of(line)},
          payload);
  }
  void begin(const std::string& name, const wire::CallParameters& parameters,
             const std::vector<std::byte>& payload) {
    if (!channel_.has_free_call()) return say("sees window_full " + name);
    payloads_.push_back(payload);  // The call views it.
    const auto frame = channel_.call(parameters, payloads_.back(), rt::now());
    if (!frame) return say("sees " + std::string(to_string(frame.error())) + ' ' + name);
    if (parameters.delivery != wire::Delivery::kSent) names_[channel_.last_call()] = name;
    send(*frame);
    send_more();
  }
  void take_items(const std::string& name) {
    const wire::CallIndex index = index_of(name);
    while (const auto item = channel_.next_item(index)) {
      say("sees item " + name + " payload=" + hex_of_bytes(*item));
      send_more();
    }
    send_more();
  }
  [[nodiscard]] wire::CallIndex index_of(const std::string& name) const {
    for (const auto& [index, known] : names_) {
      if (known == name) return index;
    }
    return 0;
  }

  wire::Medium medium_;
  std::uint32_t message_size_max_;
  Faults faults_;
  sockaddr_in server_;
  int socket_ = -1;
  MonotonicTime call_sent_{};
  std::vector<std::byte> hello_;  ///< The last one that was sent.
  FrameSplitter splitter_;
  alignas(64) std::array<std::byte, wire::kStreamFrameSizeMax> buffer_{};
  std::deque<std::vector<std::byte>> payloads_;
  std::deque<std::vector<std::byte>> memory_;
  std::map<wire::CallIndex, std::string> names_;
  std::map<std::string, bool> binds_;
  std::vector<LostCall> lost_;
  wire::ClientChannel channel_;
};

}  // namespace

std::unique_ptr<Side> make_client(const Line& setup, const Faults& faults) {
  return std::make_unique<ClientSide>(setup, faults);
}

}  // namespace rtpm::spec
