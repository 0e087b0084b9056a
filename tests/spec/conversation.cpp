#include "conversation.hpp"

#include <algorithm>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <utility>

#include "rtpm/wire/client_channel.hpp"
#include "rtpm/wire/server_sessions.hpp"

namespace rtpm::spec {
namespace {

using wire::ChannelEvent;
using wire::Verdict;

std::string_view name_of(Role role) {
  return role == Role::kClient ? "client" : "server";
}
std::string_view other_name(Role role) {
  return role == Role::kClient ? "server" : "client";
}

/// The bytes that one side is free to choose: `<name>` in a vector's hex. Those of the side that is
/// tested are learned from the first frame in which they stand; the other's are the examples.
class FreeBytes {
 public:
  FreeBytes(const Json& free, Role role) {
    for (const auto& [name, choice] : free.items()) {
      size_[name] = choice.at("size");
      if (choice.at("chosen_by") != name_of(role)) known_[name] = choice.at("example");
    }
  }

  /// The hex of a frame that is given to the tested side.
  [[nodiscard]] std::string fill_in(const std::string& pattern) const {
    std::string hex;
    for_each_part(pattern, [&](const std::string& part, bool is_name) {
      if (!is_name) hex += part;
      if (is_name) hex += known(part);
      return true;
    });
    return hex;
  }
  /// Whether a frame of the tested side is as the pattern says; learns what stands there for the
  /// first time.
  [[nodiscard]] bool matches(const std::string& pattern, const std::string& hex) {
    std::map<std::string, std::string> learned;
    std::size_t at = 0;
    const bool is_same = for_each_part(pattern, [&](const std::string& part, bool is_name) {
      const std::size_t size = is_name ? 2 * size_.at(part) : part.size();
      if (at + size > hex.size()) return false;
      const std::string here = hex.substr(at, size);
      at += size;
      if (!is_name) return here == part;
      if (known_.contains(part)) return here == known_[part];
      const auto [place, is_first] = learned.try_emplace(part, here);
      return is_first || place->second == here;
    });
    if (!is_same || at != hex.size()) return false;
    for (const auto& [name, value] : learned)
      learn(name, value);
    return true;
  }
  /// A number that stands as itself or as "<name>".
  [[nodiscard]] std::uint64_t number(const Json& value) const {
    if (value.is_number()) return value;
    return little_endian(fill_in(value));
  }

 private:
  [[nodiscard]] static std::uint64_t little_endian(const std::string& hex) {
    std::uint64_t value = 0;
    const Bytes bytes = bytes_of_hex(hex);
    for (std::size_t i = bytes.size(); i > 0; --i)
      value = value << 8 | std::to_integer<std::uint64_t>(bytes[i - 1]);
    return value;
  }
  [[nodiscard]] std::string known(const std::string& name) const {
    const auto found = known_.find(name);
    if (found != known_.end()) return found->second;
    ADD_FAILURE() << "<" << name << "> is used before it was sent";
    return std::string(2 * size_.at(name), '0');
  }
  /// A name without its number: choices of one kind are different, and calls count upward.
  [[nodiscard]] static std::string kind_of(const std::string& name) {
    return name.substr(0, name.find_last_not_of("0123456789") + 1);
  }
  void learn(const std::string& name, const std::string& value) {
    const std::string kind = kind_of(name);
    for (const auto& [other, other_value] : known_) {
      if (kind_of(other) != kind || kind == "cookie") continue;
      EXPECT_NE(value, other_value) << "<" << name << "> is the same as <" << other << ">";
      if (kind != "call") continue;
      const auto step =
          static_cast<std::uint32_t>(little_endian(value) - little_endian(other_value));
      EXPECT_LT(step, 1u << 31) << "<" << name << "> is not later than <" << other << ">";
    }
    known_[name] = value;
  }
  /// Calls `take(part, is_name)` for the stretches of a pattern until it gives false.
  template <class Take>
  static bool for_each_part(const std::string& pattern, const Take& take) {
    for (std::size_t at = 0; at < pattern.size();) {
      const bool is_name = pattern[at] == '<';
      const std::size_t end = std::min(pattern.find(is_name ? '>' : '<', at), pattern.size());
      if (!take(pattern.substr(at + (is_name ? 1 : 0), end - at - (is_name ? 1 : 0)), is_name)) {
        return false;
      }
      at = is_name ? end + 1 : end;
    }
    return true;
  }

  std::map<std::string, std::size_t> size_;
  std::map<std::string, std::string> known_;
};

/// What the tested side did: a frame that it sent, or a step without its time.
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
  /// `is_foreign`: from another address than the client's.
  virtual Outputs receive(const Bytes& frame, bool is_foreign, MonotonicTime now) = 0;
  /// Does what the step says its application does.
  virtual Outputs act(const Json& step, const FreeBytes& free, MonotonicTime now) = 0;
};

class ServerSide final : public Side {
 public:
  explicit ServerSide(const Json& conversation) {
    const Json& setup = conversation.at("setup").at("server");
    config_.medium = medium_named(conversation.at("medium"));
    config_.band = {setup.at("band").at(0).get<int>(), setup.at("band").at(1).get<int>()};
    config_.ceiling = setup.at("ceiling").get<int>();
    config_.epoch = wide_number(setup.at("epoch"));
    config_.clock_domain = wide_number(setup.at("clock_domain"));
    config_.session_count_max = setup.at("session_count_max");
    config_.message_size_max = setup.at("message_size_max");
    EXPECT_EQ(setup.at("window"), wire::kCallWindow);
    bulk_memory_.resize(std::size_t{4} * config_.message_size_max);
    stream_memory_.resize(4 * stream_room_size(config_.medium));
    config_.bulk_memory = bulk_memory_;
    config_.stream_memory = stream_memory_;
    sessions_ = std::make_unique<wire::ServerSessions>(config_);
  }

  Outputs receive(const Bytes& frame, bool is_foreign, MonotonicTime now) override {
    const wire::PeerAddress peer{.high = connection_number_, .port = is_foreign ? 2u : 1u};
    const wire::FrameCounters before = sessions_->counters();
    const Verdict verdict = sessions_->on_frame(frame, peer, now);
    Outputs outputs;
    if (const std::string reason = newly_dropped(before, sessions_->counters()); !reason.empty()) {
      outputs.push_back({{}, counted(Role::kServer, reason)});
    }
    switch (verdict.action) {
      case Verdict::Action::kNothing:
        break;
      case Verdict::Action::kSend:
        send(outputs, verdict.frame, now);
        break;
      case Verdict::Action::kHangUp:
        outputs.push_back({{}, {{"server_sees", "hang_up"}}});
        break;
      case Verdict::Action::kDispatch:
        outputs.push_back({{}, note(verdict.request)});
        break;
    }
    tell_cancelled(outputs);
    return outputs;
  }

  Outputs act(const Json& step, const FreeBytes& free, MonotonicTime now) override {
    if (step.value("network_does", "") == "disconnect") {
      sessions_->forget({.high = connection_number_++, .port = 1});
      return {};
    }
    const std::string what = step.at("server_does");
    if (what == "restart") {
      config_.epoch = wide_number(step.at("epoch"));
      ++config_.key.low;
      sessions_ = std::make_unique<wire::ServerSessions>(config_);
      running_.clear();
      return {};
    }
    Outputs outputs;
    if (what == "wait") {
      sessions_->on_time(now);
    } else if (what == "stop") {
      while (const auto outgoing = sessions_->close_next(now))
        outputs.push_back({hex_of(outgoing->frame), {}});
    } else {
      act_on_call(outputs, step, free, now);
    }
    tell_cancelled(outputs);
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
    const wire::Request request = running->second;
    if (what == "receipt") {
      send(outputs, sessions_->accept(request, status_named(step.at("status")), now), now);
      return;
    }
    const Bytes payload = bytes_of_hex(step.at("payload"));
    const auto size = static_cast<std::uint32_t>(payload.size());
    if (what == "item") {
      const MutableBytes room = sessions_->item_buffer(request);
      if (room.empty()) {
        outputs.push_back({{}, {{"server_sees", "no_credit"}, {"call_id", running->first}}});
        return;
      }
      std::ranges::copy(payload, room.begin());
      send(outputs, sessions_->push_item(request, size, now), now);
      return;
    }
    EXPECT_EQ(what, "complete");
    running_.erase(running);
    const MutableBytes reply = sessions_->reply_buffer(request);
    EXPECT_LE(payload.size(), reply.size());
    std::ranges::copy(payload, reply.begin());
    send(outputs, sessions_->complete(request, status_named(step.at("status")), size, now), now);
  }

  /// Takes note of a frame and of what the server has to send behind it.
  void send(Outputs& outputs, ConstBytes frame, MonotonicTime now) {
    for (; !frame.empty(); frame = sessions_->next_frame(now))
      outputs.push_back({hex_of(frame), {}});
  }
  void tell_cancelled(Outputs& outputs) {
    for (std::uint32_t tag = sessions_->next_cancelled(); tag != 0;
         tag = sessions_->next_cancelled()) {
      outputs.push_back({{}, {{"server_sees", "cancelled"}, {"call_id", call_of_tag_.at(tag)}}});
    }
  }
  Json note(const wire::Request& request) {
    const wire::Header& header = request.header;
    running_[header.call_id] = request;
    const auto tag = static_cast<std::uint32_t>(call_of_tag_.size() + 1);
    call_of_tag_[tag] = header.call_id;
    sessions_->set_tag(request, tag);
    return {{"server_sees", "run"},
            {"call_id", header.call_id},
            {"service", header.service},
            {"method", header.method},
            {"payload", hex_of(request.payload)},
            {"deadline_ns", to_ns(request.deadline)}};
  }

  std::vector<std::byte> bulk_memory_;
  std::vector<std::byte> stream_memory_;
  wire::ServerSessionsConfig config_;
  std::unique_ptr<wire::ServerSessions> sessions_;
  std::map<std::uint32_t, wire::Request> running_;
  std::map<std::uint32_t, std::uint32_t> call_of_tag_;
  std::uint64_t connection_number_ = 1;
};

class ClientSide final : public Side {
 public:
  explicit ClientSide(const Json& conversation) : channel_(config_of(conversation), buffer_) {}

  Outputs receive(const Bytes& frame, bool, MonotonicTime now) override {
    const wire::FrameCounters before = channel_.counters();
    ChannelEvent event = channel_.on_frame(frame, now);
    if (event.kind == ChannelEvent::Kind::kNeedRoom) {
      rooms_.emplace_back(event.room_size);
      channel_.give_room(rooms_.back(), event.call);
      event = channel_.on_frame(frame, now);
    }
    Outputs outputs = outputs_of(event);
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
    wire::CallParameters parameters{step.at("service"), step.at("method"), priority,
                                    wide_number(step.at("trace_id")), deadline};
    parameters.delivery = delivery_named(step.value("delivery", "reply"));
    parameters.stream_window = step.value("window", 0u);
    rooms_.emplace_back(parameters.stream_window * wire::kDatagramPayloadSizeMax);
    parameters.stream_memory = rooms_.back();
    payloads_.push_back(bytes_of_hex(step.at("payload")));
    const auto frame = channel_.call(parameters, payloads_.back(), now);
    if (!frame) return {{{}, {{"client_sees", to_string(frame.error())}}}};
    Outputs outputs{{hex_of(*frame), {}}};
    const std::uint32_t call_id = wire::decode(*frame)->call_id;
    indices_[call_id] = channel_.last_call();
    call_ids_[channel_.last_call()] = call_id;
    send_more(outputs, now);
    return outputs;
  }

 private:
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
  /// Takes all items of a stream that are there.
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
  /// What the application is told, and what is sent with it.
  Outputs outputs_of(const ChannelEvent& event) {
    Outputs outputs = told_of(event);
    if (!event.frame.empty()) outputs.push_back({hex_of(event.frame), {}});
    return outputs;
  }
  Outputs told_of(const ChannelEvent& event) {
    const std::string status(to_string(event.status));
    switch (event.kind) {
      case ChannelEvent::Kind::kNothing:
      case ChannelEvent::Kind::kSend:
      case ChannelEvent::Kind::kItems:  // Its application takes them when the vector says so.
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
      case ChannelEvent::Kind::kNeedRoom:
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
  std::deque<Bytes> payloads_;  ///< Of the calls, which view them.
  std::deque<std::vector<std::byte>> rooms_;
  std::map<std::uint32_t, wire::CallIndex> indices_;
  std::map<wire::CallIndex, std::uint32_t> call_ids_;
  wire::ClientChannel channel_;
};

/// What a step is to the tested side.
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

  /// What is wrong, "" if nothing is.
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
      // Where one call only is open, a vector need not say which.
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
