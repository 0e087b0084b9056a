// A client and a lane with sealed sessions, and an attacker between them, controlled by the input:
// raw bytes, forged frames of every kind, recorded frames again, elsewhere or changed. No call runs
// that the client did not seal, and none twice; tables keep their sizes, and a session continues as
// if there were no attacker. In some runs the peers themselves lie: their plain frames are changed
// before they are sealed. Then neither side breaks.

#include <algorithm>
#include <array>
#include <cstdint>
#include <deque>
#include <memory>
#include <set>
#include <vector>

#include "rtpm/base/assert.hpp"
#include "rtpm/sealed/client.hpp"
#include "rtpm/sealed/server.hpp"
#include "script.hpp"

using namespace rtpm;
using namespace rtpm::sealed;
using wire::FrameKind;
using wire::Medium;
using wire::PeerAddress;

namespace {

using Frame = std::vector<std::byte>;

constexpr std::uint32_t kSessionCountMax = 8;
constexpr std::size_t kRecordedMax = 64;
constexpr PeerAddress kClient{0, 1, 7};
constexpr PeerAddress kStranger{0, 2, 7};
constexpr Priority kPriority{100};

Frame copy_of(ConstBytes bytes) {
  return {bytes.begin(), bytes.end()};
}

/// Ephemeral keys that are the same in every run.
struct Draw {
  static void fill(void* context, MutableBytes bytes) noexcept {
    auto& state = *static_cast<std::uint64_t*>(context);
    for (std::byte& byte : bytes) {
      state = state * 6364136223846793005U + 1442695040888963407U;
      byte = static_cast<std::byte>(state >> 56);
    }
  }
  std::uint64_t state = 1;
  [[nodiscard]] RandomSource source() { return {&fill, &state}; }
};

/// Admits every key, as long as the input allows it.
struct Door : Admission {
  bool admits(const crypto::PublicKey&, const PeerAddress&) noexcept override { return is_open; }
  bool is_open = true;
};

class World {
 public:
  World(Medium medium, bool are_peers_honest)
      : medium_(medium), are_peers_honest_(are_peers_honest) {
    identity_.random = draw_.source();
    identity_.key = identity_.random.draw_key();
    key_ = identity_.random.draw_key();
    large_.resize(2 * std::size_t{kMessageMax});
    streams_.resize(2 * wire::stream_buffer_size(medium));
    wire::ServerSessionsConfig config;
    config.medium = medium;
    config.epoch = 9;
    config.key = {1, 2};
    config.session_count_max = kSessionCountMax;
    config.message_size_max = kMessageMax;
    config.large_memory = large_;
    config.stream_memory = streams_;
    config.frame_payload_max = static_cast<std::uint32_t>(wire::sealed_payload_max(medium));
    sessions_ = std::make_unique<wire::ServerSessions>(config);
    server_ =
        std::make_unique<SealedServer>(SealedServerConfig{.medium = medium,
                                                          .identity = &identity_,
                                                          .admission = &door_,
                                                          .key = config.key,
                                                          .session_count_max = kSessionCountMax,
                                                          .limits = {.generation_bits = 10}},
                                       *sessions_);
    channel_ = std::make_unique<wire::ClientChannel>(
        wire::ClientChannelConfig{
            .medium = medium, .client_epoch = 3, .channel = 1, .message_size_max = kMessageMax},
        MutableBytes(buffer_).first(wire::kHeaderSize + wire::sealed_payload_max(medium)));
    client_ = std::make_unique<SealedClient>(SealedClientConfig{.medium = medium,
                                                                .own = &key_,
                                                                .server = identity_.key.public_key,
                                                                .handshake_number = 50,
                                                                .random = draw_.source(),
                                                                .limits = {.generation_bits = 10}});
  }

  /// @param state  0 no session, 1 half-open, 2 confirmed, 3 keys renewed and the old ones gone
  void begin(std::uint8_t state) {
    if (state == 0) return;
    open();
    if (state >= 2) call();
    if (state < 3 || medium_ == Medium::kStream) return;
    renew();
    open();
    call();
  }
  void open() {
    emit(channel_->open(kPriority, now_ + std::chrono::seconds{1}, now_));
    talk();
  }
  void renew() {
    follow(client_->renew(now_));
    talk();
  }
  /// Makes a call of the honest client; returns whether it was answered.
  bool call() {
    if (!channel_->has_free_call()) return false;
    const std::uint64_t serial = ++serial_;
    store_le(payload_.data(), serial);
    const auto frame = channel_->call({.service = 1,
                                       .method = 1,
                                       .priority = kPriority,
                                       .deadline = now_ + std::chrono::seconds{5}},
                                      payload_, now_);
    if (!frame) return false;
    emit(*frame);
    talk();
    return replied_ == serial;
  }
  /// Lets the attacker send a frame to a side.
  void attack(ConstBytes frame, bool is_to_server, const PeerAddress& from) {
    if (frame.size() > wire::kStreamFrameSizeMax) return;
    is_attack_ = true;
    if (is_to_server) {
      to_server(copy_of(frame), from);
    } else {
      Frame opened = copy_of(frame);
      follow(client_->receive(opened, now_));
    }
    is_attack_ = false;
    // The client's frames in response arrive.
    talk();
  }
  [[nodiscard]] const Frame& recorded(std::uint8_t which) const {
    static const Frame kNone;
    return recorded_.empty() ? kNone : recorded_[which % recorded_.size()];
  }
  /// A header of any kind around the current session.
  [[nodiscard]] Frame forged(std::uint8_t kind, std::uint8_t flags, ConstBytes payload,
                             bool has_seal) const {
    wire::Header header;
    header.kind = static_cast<FrameKind>(1 + kind % wire::kFrameKindLast);
    header.flags = flags % 16;
    header.priority = kPriority;
    header.session = channel_->session();
    header.call_id = flags / 16;
    header.service = header.method = 1;
    header.budget_us = 1'000'000;
    const std::size_t size = std::min<std::size_t>(payload.size(), 1000);
    header.payload_size = header.message_size = static_cast<std::uint32_t>(size);
    Frame frame(wire::kHeaderSize + size);
    wire::encode(header, frame.data());
    std::ranges::copy(payload.first(size), frame.begin() + wire::kHeaderSize);
    if (has_seal) {
      frame.resize(frame.size() + crypto::kTrailerSize, std::byte{kind});
      store_le(frame.data() + wire::kHeaderSize + size, std::uint64_t{kind});
      wire::mark_sealed(frame.data());
    }
    return frame;
  }
  /// Lets a peer with keys send a frame of its own making.
  void lie(const Frame& plain, bool is_to_server) {
    if (!wire::decode(plain) ||
        plain.size() > wire::kHeaderSize + wire::sealed_payload_max(medium_))
      return;
    if (is_to_server) {
      if (wire::decode(plain)->kind == FrameKind::kHello) return;
      follow(client_->send(plain, now_));
    } else {
      give_to_client(server_->seal(plain));
    }
    talk();
  }
  void pass(Duration time) {
    now_ += time;
    sessions_->on_time(now_);
    server_->on_time(now_);
    for (auto event = channel_->on_time(now_); event.kind != wire::ChannelEvent::Kind::kNothing;
         event = channel_->on_time(now_))
      take(event);
    talk();
  }
  void set_admitted(bool is_admitted) {
    door_.is_open = is_admitted;
    if (!is_admitted) server_->end_unadmitted(now_);
    has_undisturbed_session_ = false;
  }
  void keep_session() {
    has_undisturbed_session_ = are_peers_honest_ && medium_ == Medium::kDatagram &&
                               channel_->has_free_call() && server_->half_open_count() == 0 &&
                               sessions_->is_known(channel_->session());
    session_ = channel_->session();
  }
  void check() const {
    RTPM_ASSERT(sessions_->session_count() <= kSessionCountMax, "the table keeps its size");
    RTPM_ASSERT(server_->half_open_count() <= kSessionCountMax / 4, "half-open ones keep theirs");
  }
  void check_end() {
    if (!has_undisturbed_session_) return;
    RTPM_ASSERT(channel_->is_ready() && channel_->session() == session_, "the session goes on");
    RTPM_ASSERT(call(), "and serves its client");
  }

 private:
  static constexpr std::uint32_t kMessageMax = 4096;

  void emit(ConstBytes frame) {
    if (!frame.empty()) follow(client_->send(frame, now_));
  }
  void follow(const SealedClient::Step& step) {
    if (!step.send.empty()) {
      sealed_.insert(copy_of(step.send));
      if (sent_.size() < kRecordedMax) sent_.push_back(copy_of(step.send));
    }
    if (!step.deliver.empty()) {
      RTPM_ASSERT(!is_attack_ || !are_peers_honest_ || may_deliver(step.deliver),
                  "an attacker tells the channel nothing");
      take(channel_->on_frame(copy_of(step.deliver), now_));
    }
    if (client_->has_work()) follow(client_->work(now_));
  }
  /// Handshakes use frames that anybody can send; and only the server itself can report a lost
  /// session.
  [[nodiscard]] static bool may_deliver(ConstBytes frame) {
    const auto header = wire::decode(frame);
    return header && header->kind <= FrameKind::kWelcome;
  }
  void take(const wire::ChannelEvent& event) {
    if (event.kind == wire::ChannelEvent::Kind::kReply && event.payload.size() >= 8) {
      replied_ = load_le<std::uint64_t>(event.payload.data());
    }
    if (event.kind == wire::ChannelEvent::Kind::kNeedBuffer) {
      channel_->set_reply_buffer(reply_, event.call);
    }
    emit(event.frame);
  }
  void talk() {
    for (int i = 0; i < 200 && !sent_.empty(); ++i) {
      const Frame frame = sent_.front();
      sent_.pop_front();
      record(frame);
      to_server(frame, kClient);
    }
    sent_.clear();
  }
  void record(const Frame& frame) {
    if (recorded_.size() < kRecordedMax) recorded_.push_back(frame);
  }
  void to_server(const Frame& frame, const PeerAddress& from) {
    Frame opened = frame;
    SealedServer::Outcome outcome = server_->on_frame(opened, from, now_);
    while (true) {
      if (outcome.verdict.action == wire::Verdict::Action::kDispatch) {
        // A call runs once for each frame that the client sealed, whichever side delivers it.
        RTPM_ASSERT(sealed_.erase(frame) == 1, "only what the client sealed runs, and only once");
        run(outcome.verdict.request);
      } else if (outcome.verdict.action == wire::Verdict::Action::kSend) {
        answer(outcome.verdict.frame, frame);
      }
      if (outcome.job == nullptr) break;
      HandshakeJob& job = *outcome.job;
      job.run();
      outcome = server_->on_job(job, now_);
    }
    while (sessions_->next_cancelled() != 0) {
    }
  }
  void run(const wire::Request& request) {
    const MutableBytes reply = sessions_->reply_buffer(request, now_);
    const std::size_t size =
        request.wants_stream() ? 0 : std::min(reply.size(), request.payload.size());
    std::ranges::copy(request.payload.first(size), reply.begin());
    answer(sessions_->complete(request, wire::Status::kOk, static_cast<std::uint32_t>(size), now_),
           {});
  }
  void answer(ConstBytes first, ConstBytes question) {
    for (ConstBytes plain = first; !plain.empty(); plain = sessions_->next_frame(now_)) {
      const ConstBytes out = server_->seal(plain);
      const bool is_welcome = out.size() == wire::kHeaderSize + wire::SealedWelcome::kSize;
      RTPM_ASSERT(
          question.empty() || wire::is_sealed(out) || is_welcome || out.size() <= question.size(),
          "no address gets more than it sent");
      give_to_client(out);
    }
  }
  void give_to_client(ConstBytes frame) {
    if (frame.empty()) return;
    record(copy_of(frame));
    Frame opened = copy_of(frame);
    const bool was_attack = std::exchange(is_attack_, false);
    follow(client_->receive(opened, now_));
    is_attack_ = was_attack;
  }

  Medium medium_;
  bool are_peers_honest_;
  Draw draw_;
  Door door_;
  MonotonicTime now_ = time_from_ns(1'000'000'000'000);
  ServerIdentity identity_;
  crypto::KeyPair key_;
  std::vector<std::byte> large_;
  std::vector<std::byte> streams_;
  std::array<std::byte, wire::kStreamFrameSizeMax> buffer_{};
  std::array<std::byte, kMessageMax> reply_{};
  std::array<std::byte, 8> payload_{};
  std::unique_ptr<wire::ServerSessions> sessions_;
  std::unique_ptr<SealedServer> server_;
  std::unique_ptr<wire::ClientChannel> channel_;
  std::unique_ptr<SealedClient> client_;
  std::deque<Frame> sent_;
  std::vector<Frame> recorded_;
  std::set<Frame> sealed_;  ///< Sealed by the client, and not yet run.
  std::uint64_t serial_ = 0;
  std::uint64_t replied_ = 0;
  std::uint64_t session_ = 0;
  bool has_undisturbed_session_ = false;
  bool is_attack_ = false;
};

void change(Frame& frame, fuzz::Script& script) {
  for (int count = 1 + script.byte() % 4; count > 0 && !frame.empty(); --count) {
    const std::size_t at = script.byte() % std::min<std::size_t>(frame.size(), 256);
    frame[at] ^= std::byte{script.byte()};
  }
}

void play(World& world, std::uint8_t step, fuzz::Script& script) {
  const bool is_to_server = step % 2 == 0;
  const PeerAddress from = step % 16 == 0 ? kStranger : kClient;
  switch (step / 16 % 10) {
    case 0:
      return world.attack(script.bytes(), is_to_server, from);
    case 1: {
      const std::uint8_t kind = script.byte();
      const std::uint8_t flags = script.byte();
      return world.attack(world.forged(kind, flags, script.bytes(), step % 4 < 2), is_to_server,
                          from);
    }
    case 2:
      return world.attack(world.recorded(script.byte()), is_to_server, from);
    case 3: {
      Frame frame = world.recorded(script.byte());
      change(frame, script);
      return world.attack(frame, is_to_server, from);
    }
    case 4:
      return static_cast<void>(world.call());
    case 5:
      return world.open(), world.keep_session();
    case 6:
      return world.renew();
    case 7:
      return world.pass(std::chrono::milliseconds{script.number() % 3'000});
    case 8:
      return world.set_admitted(step % 4 < 3);
    default: {
      const std::uint8_t kind = script.byte();
      const std::uint8_t flags = script.byte();
      Frame frame = world.forged(kind, flags, script.bytes(), false);
      change(frame, script);
      return world.lie(frame, is_to_server);
    }
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::Script script(data, size);
  const std::uint8_t how = script.byte();
  const bool are_peers_honest = how % 4 < 2;
  World world(how % 2 == 0 ? Medium::kDatagram : Medium::kStream, are_peers_honest);
  world.begin(how / 4 % 4);
  world.keep_session();
  while (script.has_more()) {
    const std::uint8_t step = script.byte();
    if (step / 16 % 10 == 9 && are_peers_honest) continue;
    play(world, step, script);
    world.check();
  }
  world.check_end();
  return 0;
}
