#include "conversation.hpp"

#include <algorithm>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <utility>

#include "free_bytes.hpp"
#include "rtpm/wire/client_channel.hpp"
#include "rtpm/wire/server_sessions.hpp"

namespace rtpm::spec {
namespace {

using wire::ChannelEvent;
using wire::Verdict;

std::string_view other_name(Role role) {
  return role == Role::kClient ? "server" : "client";
}

/// The tested side's output: a frame that it sent, or a step without its time.
struct Output {
  std::optional<std::string> frame_hex;
  Json step;
};
using Outputs = std::vector<Output>;

std::string describe(const Outputs& outputs) {
  std::string text;
  for (const Output& output : outputs) {
    text += "\n  " + (output.frame_hex ? "sent " + *output.frame_hex : output.step.dump());
  }
  return text;
}

Json counted(Role role, const std::string& reason) {
  return {{std::string(name_of(role)) + "_counts", reason}};
}

/// One side of the protocol behind the steps' words.
class Side {
 public:
  Side() = default;
  Side(const Side&) = delete;
  Side& operator=(const Side&) = delete;
  virtual ~Side() = default;
  /// @param is_foreign  whether the frame comes from another address than the client's
  virtual Outputs receive(const Bytes& frame, bool is_foreign, MonotonicTime now) = 0;
  /// Performs the step's action of the side's application.
  virtual Outputs act(const Json& step, const FreeBytes& free, MonotonicTime now) = 0;
};

class ServerSide final : public Side {
 public:
  explicit ServerSide(const Json& conversation) {
    const Json& setup = conversation.at("setup").at("server");
    config_.medium = medium_named(conversation.at("medium"));
    for (const Json& band : setup.contains("bands") ? setup.at("bands") : Json{setup.at("band")})
      bands_.push_back({band.at(0).get<int>(), band.at(1).get<int>()});
    config_.lane_count = static_cast<std::uint32_t>(bands_.size());
    config_.ceiling = setup.at("ceiling").get<int>();
    config_.epoch = wide_number(setup.at("epoch"));
    config_.clock_domain = wide_number(setup.at("clock_domain"));
    config_.session_count_max = setup.at("session_count_max");
    config_.message_size_max = setup.at("message_size_max");
    EXPECT_EQ(setup.at("window"), wire::kCallWindow);
    start();
  }

  Outputs receive(const Bytes& frame, bool is_foreign, MonotonicTime now) override {
    const wire::PeerAddress peer{.high = connection_number_, .port = is_foreign ? 2u : 1u};
    wire::ServerSessions& sessions = lane_of(frame);
    const wire::FrameCounters before = sessions.counters();
    const Verdict verdict = sessions.on_frame(frame, peer, now);
    Outputs outputs;
    if (const std::string reason = newly_dropped(before, sessions.counters()); !reason.empty()) {
      outputs.push_back({{}, counted(Role::kServer, reason)});
    }
    switch (verdict.action) {
      case Verdict::Action::kNothing:
        break;
      case Verdict::Action::kSend:
        send(outputs, sessions, verdict.frame, now);
        break;
      case Verdict::Action::kHangUp:
        outputs.push_back({{}, {{"server_sees", "hang_up"}}});
        break;
      case Verdict::Action::kDispatch:
        outputs.push_back({{}, note(sessions, verdict.request)});
        break;
    }
    report_cancelled(outputs);
    if (verdict.credit_tag != 0) give_item(outputs, call_of_tag_.at(verdict.credit_tag), now);
    return outputs;
  }

  Outputs act(const Json& step, const FreeBytes& free, MonotonicTime now) override {
    if (step.value("network_does", "") == "disconnect") {
      for (Lane& lane : lanes_)
        lane.sessions->end_connection({.high = connection_number_, .port = 1});
      ++connection_number_;
      Outputs outputs;
      report_cancelled(outputs);
      return outputs;
    }
    const std::string what = step.at("server_does");
    if (what == "restart") {
      config_.epoch = wide_number(step.at("epoch"));
      ++config_.key.low;
      running_.clear();
      start();
      return {};
    }
    Outputs outputs;
    if (what == "wait") {
      for (Lane& lane : lanes_)
        lane.sessions->on_time(now);
    } else if (what == "stop") {
      for (Lane& lane : lanes_) {
        while (const auto outgoing = lane.sessions->close_next(now))
          outputs.push_back({hex_of(outgoing->frame), {}});
      }
    } else {
      act_on_call(outputs, step, free, now);
    }
    report_cancelled(outputs);
    return outputs;
  }

 private:
  void act_on_call(Outputs& outputs, const Json& step, const FreeBytes& free, MonotonicTime now) {
    const std::string what = step.at("server_does");
    const auto running = running_.find(static_cast<std::uint32_t>(free.number(step.at("call_id"))));
    if (running == running_.end()) {
      ADD_FAILURE() << "this call does not run: " << step;
      return;
    }
    const wire::Request request = running->second.request;
    wire::ServerSessions& sessions = *running->second.sessions;
    if (what == "receipt") {
      send(outputs, sessions, sessions.accept(request, status_named(step.at("status")), now), now);
      return;
    }
    const Bytes payload = bytes_of_hex(step.at("payload"));
    const auto size = static_cast<std::uint32_t>(payload.size());
    if (what == "item") {
      const std::uint32_t size_max = sessions.item_size_max(request);
      if (size_max > 0 && size > size_max) {
        outputs.push_back({{}, {{"server_sees", "item_too_large"}, {"call_id", running->first}}});
        return;
      }
      items_[running->first] = payload;
      if (give_item(outputs, running->first, now)) return;
      items_.erase(running->first);
      outputs.push_back({{}, {{"server_sees", "no_credit"}, {"call_id", running->first}}});
      return;
    }
    EXPECT_EQ(what, "complete");
    running_.erase(running);
    const MutableBytes reply = sessions.reply_buffer(request, now);
    EXPECT_LE(payload.size(), reply.size());
    std::ranges::copy(payload, reply.begin());
    send(outputs, sessions, sessions.complete(request, status_named(step.at("status")), size, now),
         now);
  }

  /// Writes as much of the call's item as its caller accepts; false if that is nothing.
  bool give_item(Outputs& outputs, std::uint32_t call_id, MonotonicTime now) {
    const auto item = items_.find(call_id);
    const auto running = running_.find(call_id);
    if (item == items_.end() || running == running_.end()) return false;
    wire::ServerSessions& sessions = *running->second.sessions;
    bool has_given = false;
    do {
      const ConstBytes frame = sessions.push_item(running->second.request, item->second, now);
      if (frame.empty()) return has_given;
      outputs.push_back({hex_of(frame), {}});
      has_given = true;
    } while (sessions.is_item_midway(running->second.request));
    items_.erase(item);
    return true;
  }
  /// Records a frame and the further frames that the server has to send.
  static void send(Outputs& outputs, wire::ServerSessions& sessions, ConstBytes frame,
                   MonotonicTime now) {
    for (; !frame.empty(); frame = sessions.next_frame(now))
      outputs.push_back({hex_of(frame), {}});
  }
  void report_cancelled(Outputs& outputs) {
    for (Lane& lane : lanes_) {
      for (std::uint32_t tag = lane.sessions->next_cancelled(); tag != 0;
           tag = lane.sessions->next_cancelled()) {
        outputs.push_back({{}, {{"server_sees", "cancelled"}, {"call_id", call_of_tag_.at(tag)}}});
      }
    }
  }
  Json note(wire::ServerSessions& sessions, const wire::Request& request) {
    const wire::Header& header = request.header;
    running_[header.call_id] = {request, &sessions};
    const auto tag = static_cast<std::uint32_t>(call_of_tag_.size() + 1);
    call_of_tag_[tag] = header.call_id;
    sessions.set_tag(request, tag);
    return {{"server_sees", "run"},
            {"call_id", header.call_id},
            {"service", header.service},
            {"method", header.method},
            {"payload", hex_of(request.payload)},
            {"deadline_ns", to_ns(request.deadline)}};
  }

  struct Lane {
    std::vector<std::byte> large_memory;
    std::vector<std::byte> stream_memory;
    std::unique_ptr<wire::ServerSessions> sessions;
  };
  struct Running {
    wire::Request request;
    wire::ServerSessions* sessions = nullptr;
  };

  /// Starts or restarts the server: its lanes share the key and the epoch.
  void start() {
    lanes_.clear();
    lanes_.resize(bands_.size());
    for (std::size_t i = 0; i < bands_.size(); ++i) {
      Lane& lane = lanes_[i];
      lane.large_memory.resize(std::size_t{4} * config_.message_size_max);
      lane.stream_memory.resize(4 * stream_buffer_size(config_.medium));
      wire::ServerSessionsConfig config = config_;
      config.lane = static_cast<std::uint32_t>(i);
      config.band = bands_[i];
      config.large_memory = lane.large_memory;
      config.stream_memory = lane.stream_memory;
      lane.sessions = std::make_unique<wire::ServerSessions>(config);
    }
  }
  /// hp-11-2: the frame's priority selects the lane, wherever its session is.
  wire::ServerSessions& lane_of(const Bytes& frame) {
    if (frame.size() >= wire::kHeaderSize) {
      const auto priority = load_le<std::uint16_t>(frame.data() + 4);
      for (std::size_t i = 0; i < bands_.size(); ++i) {
        if (bands_[i].low.value() <= priority && priority <= bands_[i].high.value())
          return *lanes_[i].sessions;
      }
    }
    return *lanes_.front().sessions;
  }

  std::vector<Band> bands_;
  wire::ServerSessionsConfig config_;
  std::vector<Lane> lanes_;
  std::map<std::uint32_t, Running> running_;
  std::map<std::uint32_t, Bytes> items_;  ///< Items not yet written completely.
  std::map<std::uint32_t, std::uint32_t> call_of_tag_;
  std::uint64_t connection_number_ = 1;
};

class ClientSide final : public Side {
 public:
  explicit ClientSide(const Json& conversation)
      : medium_(medium_named(conversation.at("medium"))),
        message_size_max_(conversation.at("setup").at("client").at("message_size_max")),
        channel_(config_of(conversation), buffer_) {}

  Outputs receive(const Bytes& frame, bool, MonotonicTime now) override {
    const wire::FrameCounters before = channel_.counters();
    const std::vector<LostCall> open = open_calls();
    ChannelEvent event = channel_.on_frame(frame, now);
    if (event.kind == ChannelEvent::Kind::kNeedBuffer) {
      memory_.emplace_back(event.reply_size);
      channel_.set_reply_buffer(memory_.back(), event.call);
      event = channel_.on_frame(frame, now);
    }
    Outputs outputs = outputs_of(event);
    if (event.kind == ChannelEvent::Kind::kLost) lost_ = open;
    if (event.kind == ChannelEvent::Kind::kReady) judge_lost(outputs, now);
    send_more(outputs, now);
    if (const std::string reason = newly_dropped(before, channel_.counters()); !reason.empty()) {
      outputs.push_back({{}, counted(Role::kClient, reason)});
    }
    return outputs;
  }

  Outputs act(const Json& step, const FreeBytes& free, MonotonicTime now) override {
    if (step.value("network_does", "") == "disconnect") {
      channel_.reset();
      return {};
    }
    const std::string what = step.at("client_does");
    if (what == "wait") return wait(now);
    if (what == "cancel") return {{hex_of(channel_.cancel(index_of(step, free), now)), {}}};
    if (what == "take") return take(step, free, now);
    if (what == "close") return {{hex_of(channel_.close(now)), {}}};
    const Priority priority = step.at("priority").get<int>();
    const MonotonicTime deadline = time_from_ns(step.at("deadline_ns"));
    if (what == "open") return {{hex_of(channel_.open(priority, deadline, now)), {}}};
    EXPECT_EQ(what, "call");
    if (!channel_.has_free_call()) return {{{}, {{"client_sees", "window_full"}}}};
    wire::CallParameters parameters{step.at("service"), step.at("method"), priority,
                                    wide_number(step.at("trace_id")), deadline};
    parameters.delivery = delivery_named(step.value("delivery", "reply"));
    parameters.stream_window = step.value("window", 0u);
    if (parameters.stream_window > 0) give_stream_buffers(parameters);
    payloads_.push_back(bytes_of_hex(step.at("payload")));
    const auto frame = channel_.call(parameters, payloads_.back(), now);
    if (!frame) return {{{}, {{"client_sees", to_string(frame.error())}}}};
    Outputs outputs{{hex_of(*frame), {}}};
    const std::uint32_t call_id = wire::decode(*frame)->call_id;
    indices_[call_id] = channel_.last_call();
    call_ids_[channel_.last_call()] = call_id;
    expect_free(call_id);
    send_more(outputs, now);
    return outputs;
  }

 private:
  /// A call that was open when its session was lost.
  struct LostCall {
    std::uint32_t call_id = 0;
    std::uint64_t server_epoch = 0;
    MonotonicTime begun{};
  };
  std::vector<LostCall> open_calls() const {
    std::vector<LostCall> open;
    for (const auto& [index, call_id] : call_ids_) {
      if (!channel_.is_open(index)) continue;
      open.push_back({call_id, channel_.welcome().server_epoch, channel_.call_begun(index)});
    }
    return open;
  }
  /// hp-5.5-2, hp-5.5-3: reports which calls of the lost session may have run.
  void judge_lost(Outputs& outputs, MonotonicTime now) {
    for (const LostCall& call : std::exchange(lost_, {})) {
      const bool is_safe =
          wire::has_not_run(call.server_epoch, channel_.welcome().server_epoch, call.begun, now);
      outputs.push_back(
          {{}, {{"client_sees", is_safe ? "not_run" : "may_have_run"}, {"call_id", call.call_id}}});
    }
  }
  /// hp-4.3-2: no open call has the slot of the new one.
  void expect_free(std::uint32_t new_call) const {
    for (const LostCall& open : open_calls()) {
      if (open.call_id == new_call) continue;
      EXPECT_NE((new_call - open.call_id) % channel_.welcome().window, 0u)
          << new_call << " begins while " << open.call_id << " is open";
    }
  }
  void give_stream_buffers(wire::CallParameters& parameters) {
    constexpr std::size_t kFrameSize = wire::kDatagramPayloadSizeMax;
    const std::uint32_t byte_window = wire::stream_bytes_first(medium_);
    memory_.emplace_back(kFrameSize *
                         wire::stream_frame_count(medium_, parameters.stream_window, byte_window));
    parameters.stream_buffers = {
        .frames = memory_.back(), .frame_size = kFrameSize, .item = {}, .byte_window = byte_window};
    memory_.emplace_back(message_size_max_);
    parameters.stream_buffers.item = memory_.back();
  }
  static wire::Delivery delivery_named(const std::string& name) {
    if (name == "receipt") return wire::Delivery::kReceipt;
    return name == "sent" ? wire::Delivery::kSent : wire::Delivery::kReply;
  }
  wire::CallIndex index_of(const Json& step, const FreeBytes& free) {
    return indices_.at(static_cast<std::uint32_t>(free.number(step.at("call_id"))));
  }
  Outputs wait(MonotonicTime now) {
    Outputs outputs;
    for (ChannelEvent event = channel_.on_time(now); event.kind != ChannelEvent::Kind::kNothing;
         event = channel_.on_time(now)) {
      std::ranges::move(outputs_of(event), std::back_inserter(outputs));
      send_more(outputs, now);
    }
    return outputs;
  }
  /// Takes all available items of a stream.
  Outputs take(const Json& step, const FreeBytes& free, MonotonicTime now) {
    Outputs outputs;
    const wire::CallIndex index = index_of(step, free);
    while (const auto item = channel_.next_item(index)) {
      outputs.push_back({{},
                         {{"client_sees", "item"},
                          {"call_id", call_ids_.at(index)},
                          {"payload", hex_of(*item)}}});
    }
    send_more(outputs, now);
    return outputs;
  }
  void send_more(Outputs& outputs, MonotonicTime now) {
    for (ConstBytes frame; !(frame = channel_.next_frame(now)).empty();)
      outputs.push_back({hex_of(frame), {}});
  }

  static wire::ClientChannelConfig config_of(const Json& conversation) {
    const Json& setup = conversation.at("setup").at("client");
    return {medium_named(conversation.at("medium")),
            wide_number(setup.at("epoch")),
            wide_number(setup.at("channel")),
            wide_number(setup.at("clock_domain")),
            setup.at("message_size_max"),
            wire::kCallWindow};
  }
  /// Returns the application's report, and the frame that is sent with it.
  Outputs outputs_of(const ChannelEvent& event) {
    Outputs outputs = report_of(event);
    if (!event.frame.empty()) outputs.push_back({hex_of(event.frame), {}});
    return outputs;
  }
  Outputs report_of(const ChannelEvent& event) {
    const std::string status(to_string(event.status));
    switch (event.kind) {
      case ChannelEvent::Kind::kNothing:
      case ChannelEvent::Kind::kSend:
      case ChannelEvent::Kind::kItems:  // Its application takes them when the vector asks for it.
        return {};
      case ChannelEvent::Kind::kReady:
        return {{{}, {{"client_sees", "ready"}}}};
      case ChannelEvent::Kind::kReply:
        return {{{},
                 {{"client_sees", "result"},
                  {"call_id", call_ids_.at(event.call)},
                  {"status", status},
                  {"payload", hex_of(event.payload)}}}};
      case ChannelEvent::Kind::kRefused:
        return {{{}, {{"client_sees", "refused"}, {"status", status}}}};
      case ChannelEvent::Kind::kLost:
        return {{{}, {{"client_sees", "lost"}}}};
      case ChannelEvent::Kind::kClosed:
        return {{{}, {{"client_sees", "closed"}}}};
      case ChannelEvent::Kind::kNeedBuffer:
        return {{{}, {{"client_sees", "a large reply"}}}};
      case ChannelEvent::Kind::kTimeout: {
        Json step{{"client_sees", "timeout"}};
        if (channel_.session() != 0) step["call_id"] = call_ids_.at(event.call);
        return {{{}, step}};
      }
      case ChannelEvent::Kind::kBroken:
        return {{{}, {{"client_sees", "broken"}}}};
    }
    return {};
  }

  alignas(64) std::array<std::byte, 4096> buffer_{};
  std::deque<Bytes> payloads_;  ///< The calls' payloads, which they view.
  std::deque<std::vector<std::byte>> memory_;
  std::map<std::uint32_t, wire::CallIndex> indices_;
  std::map<wire::CallIndex, std::uint32_t> call_ids_;
  std::vector<LostCall> lost_;
  wire::Medium medium_;
  std::uint32_t message_size_max_;
  wire::ClientChannel channel_;
};

/// The kind of a step, as the tested side sees it.
enum class StepIs { kInput, kOutput, kNothing };

StepIs judge(const Json& step, Role role) {
  const std::string self(name_of(role));
  const std::string other(other_name(role));
  if (step.contains("frame")) {
    const std::string way = step.at("frame");
    if (way == self + " to " + other) return StepIs::kOutput;
    if (way == "network to " + self) return StepIs::kInput;
    if (way == other + " to " + self && !step.value("is_lost", false)) return StepIs::kInput;
    EXPECT_TRUE(way == other + " to " + self || way == "network to " + other) << way;
    return StepIs::kNothing;
  }
  if (step.contains(self + "_sees") || step.contains(self + "_counts")) return StepIs::kOutput;
  if (step.contains(self + "_does") || step.contains("network_does")) return StepIs::kInput;
  EXPECT_TRUE(step.contains(other + "_sees") || step.contains(other + "_counts") ||
              step.contains(other + "_does"))
      << "what kind of step is this? " << step;
  return StepIs::kNothing;
}

class Player {
 public:
  Player(const Json& conversation, Role role) : role_(role), free_(conversation.at("free"), role) {
    if (role == Role::kServer) {
      side_ = std::make_unique<ServerSide>(conversation);
    } else {
      side_ = std::make_unique<ClientSide>(conversation);
    }
  }

  /// Returns the mistake, "" if there is none.
  std::string take(const Json& step) {
    switch (judge(step, role_)) {
      case StepIs::kNothing:
        break;
      case StepIs::kInput:
        if (!outputs_.empty()) return surplus();
        apply(step);
        break;
      case StepIs::kOutput:
        return consume(step);
    }
    return {};
  }
  std::string surplus() const {
    return outputs_.empty() ? std::string()
                            : "before this, not in the vector:" + describe(outputs_);
  }

 private:
  void apply(const Json& step) {
    const MonotonicTime now = time_from_ns(step.value("arrives_ns", step.at("at_ns")));
    if (step.contains("frame")) {
      const Bytes frame = bytes_of_hex(free_.fill_in(step.at("hex")));
      outputs_ = side_->receive(frame, step.value("address", "client") != "client", now);
    } else {
      outputs_ = side_->act(step, free_, now);
    }
  }

  std::string consume(const Json& step) {
    Json wanted = step;
    wanted.erase("at_ns");
    if (wanted.contains("call_id")) wanted["call_id"] = free_.number(wanted["call_id"]);
    const auto found = std::ranges::find_if(outputs_, [&](const Output& output) {
      if (step.contains("frame") != output.frame_hex.has_value()) return false;
      if (output.frame_hex) return free_.matches(step.at("hex"), *output.frame_hex);
      Json there = output.step;
      // With a single open call, a vector need not name it.
      if (!wanted.contains("call_id")) there.erase("call_id");
      return there == wanted;
    });
    if (found == outputs_.end()) {
      return "wanted: " + step.dump() + "\nwhat happened:" + describe(outputs_);
    }
    outputs_.erase(found);
    return {};
  }

  Role role_;
  FreeBytes free_;
  std::unique_ptr<Side> side_;
  Outputs outputs_;
};

}  // namespace

std::string play(const Json& conversation, Role role) {
  Player player(conversation, role);
  std::size_t index = 0;
  for (const Json& step : conversation.at("steps")) {
    const std::string wrong = player.take(step);
    if (!wrong.empty()) return "step " + std::to_string(index) + ": " + wrong;
    ++index;
  }
  return player.surplus();
}

}  // namespace rtpm::spec
