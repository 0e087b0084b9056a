#include <gtest/gtest.h>

#include <functional>

#include "peers.hpp"

// An attacker's uses of a recorded conversation: every bit changed, every frame replayed at any
// later time, in other sessions, in the other direction and after restarts; and all kinds of frames
// in all states of a session.
namespace rtpm::sealed::test {
namespace {

using namespace std::chrono_literals;
using Kind = wire::ChannelEvent::Kind;

constexpr MonotonicTime kNow = time_from_ns(1'000'000'000);

/// A conversation from HELLO to the last of three calls, and its frames.
struct Recording {
  explicit Recording(wire::Medium medium = wire::Medium::kDatagram)
      : server(medium), client(server.identity.key.public_key, medium) {
    client.open(kNow);
    pass_all();
    for (const char* text : {"one", "two", "three"}) {
      client.call(text, kNow);
      pass_all();
    }
  }
  void pass_all() {
    while (!client.sent.empty()) {
      to_server.push_back(client.sent.front());
      client.sent.pop_front();
      for (const Bytes& answer : server.receive(to_server.back(), kNow)) {
        to_client.push_back(answer);
        client.receive(answer, kNow);
      }
    }
  }
  /// Expects that foreign frames have not changed the state of client and server.
  void expect_unchanged(std::string_view what) {
    EXPECT_EQ(server.run_count, 3) << what;
    EXPECT_EQ(server.sealed->client_of(client.channel.session()), client.key.public_key) << what;
    EXPECT_TRUE(client.channel.is_ready()) << what;
    EXPECT_EQ(client.reply, "three") << what;
  }
  void expect_that_calls_still_work() {
    const std::uint64_t session = client.channel.session();
    client.call("four", kNow);
    talk(client, server, kNow);
    EXPECT_EQ(client.reply, "four");
    EXPECT_EQ(server.run_count, 4);
    EXPECT_EQ(client.channel.session(), session);
  }

  Server server;
  Client client;
  std::vector<Bytes> to_server;  // HELLO, HELLO with message 1, three CALLs.
  std::vector<Bytes> to_client;  // COOKIE, WELCOME, three REPLYs.
};

Bytes with_flipped(Bytes frame, std::size_t bit) {
  frame[bit / 8] ^= std::byte{1} << (bit % 8);
  return frame;
}

// sec-5-3, sec-3.4-1: a frame with a changed bit, even in the header, is never accepted. This
// includes frames of a handshake: at most the server answers with a COOKIE or a half-open session.
TEST(RecordedSessions, RefuseFramesWithAnyBitChanged) {
  Recording recording;
  ASSERT_EQ(recording.to_server.size(), 5u);
  ASSERT_EQ(recording.to_client.size(), 5u);
  for (const Bytes& frame : recording.to_server) {
    for (std::size_t bit = 0; bit < 8 * frame.size(); ++bit)
      static_cast<void>(recording.server.receive(with_flipped(frame, bit), kNow));
  }
  recording.client.events.clear();
  for (const Bytes& frame : recording.to_client) {
    for (std::size_t bit = 0; bit < 8 * frame.size(); ++bit)
      recording.client.receive(with_flipped(frame, bit), kNow);
  }
  EXPECT_TRUE(recording.client.events.empty());
  recording.client.sent.clear();
  recording.expect_unchanged("flipped");
  recording.expect_that_calls_still_work();
}

// The changed frames arrive before the genuine one: repetition repairs this kind of loss.
TEST(RecordedSessions, AcceptAFrameAfterChangedCopiesOfIt) {
  Recording recording;
  recording.client.call("four", kNow);
  const Bytes call = recording.client.sent.front();
  for (std::size_t bit = 0; bit < 8 * call.size(); ++bit) {
    // The server refuses frames of an unknown session.
    for (const Bytes& answer : recording.server.receive(with_flipped(call, bit), kNow))
      EXPECT_EQ(header_of(answer).kind, FrameKind::kRefuse) << bit;
  }
  recording.expect_unchanged("a call");
  const auto reply = recording.server.receive(call, kNow);
  ASSERT_EQ(reply.size(), 1u);
  recording.client.events.clear();
  for (std::size_t bit = 0; bit < 8 * reply[0].size(); ++bit)
    recording.client.receive(with_flipped(reply[0], bit), kNow);
  EXPECT_TRUE(recording.client.events.empty());
  recording.client.receive(reply[0], kNow);
  EXPECT_EQ(recording.client.reply, "four");
}

// sec-5-4, sec-5-7: frames are replayed at any later time, and in both directions.
TEST(RecordedSessions, RefuseFramesThatAreReplayed) {
  Recording recording;
  for (const Duration later : {0ns, Duration{1ms}, Duration{1s}, Duration{20min}}) {
    for (const auto* frames : {&recording.to_server, &recording.to_client}) {
      for (const Bytes& frame : *frames) {
        static_cast<void>(recording.server.receive(frame, kNow + later));
        recording.client.receive(frame, kNow + later);
      }
    }
    recording.client.sent.clear();
    recording.expect_unchanged("again");
  }
  recording.expect_that_calls_still_work();
}

// sec-3-1, sec-5-2: in another session of the same client, with another client, after a restart of
// either side, and at another server.
TEST(RecordedSessions, RefuseFramesOfOtherSessions) {
  using Change = std::function<void(Recording&)>;
  const std::vector<Change> changes{
      [](Recording& r) {
        r.client.sealed.reset();
        r.client.channel.reset();
        open_and_call(r.client, r.server, kNow);
      },
      [](Recording& r) { r.server.restart(); },
      [](Recording& r) {
        r.server.restart();
        r.client.sealed.reset();
        r.client.channel.reset();
        open_and_call(r.client, r.server, kNow);
      },
      [](Recording& r) { r.client.renew(kNow), talk(r.client, r.server, kNow); },
  };
  for (const Change& change : changes) {
    Recording recording;
    change(recording);
    const int before = recording.server.run_count;
    recording.client.events.clear();
    for (const Bytes& frame : recording.to_server)
      static_cast<void>(recording.server.receive(frame, kNow + 1s));
    for (const Bytes& frame : recording.to_client)
      recording.client.receive(frame, kNow + 1s);
    EXPECT_EQ(recording.server.run_count, before);
    EXPECT_TRUE(recording.client.events.empty());
  }
  const Recording recording;
  Recording other;
  for (Bytes frame : recording.to_server) {
    static_cast<void>(other.server.receive(frame, kNow));
    if (!wire::is_sealed(frame)) continue;
    // The frame gets the number of the other session.
    store_le(frame.data() + 8, other.client.channel.session());
    static_cast<void>(other.server.receive(frame, kNow));
  }
  for (Bytes frame : recording.to_client) {
    store_le(frame.data() + 8, other.client.channel.session());
    other.client.receive(frame, kNow);
  }
  other.client.sent.clear();
  other.expect_unchanged("elsewhere");
  other.expect_that_calls_still_work();
}

// ---- all kinds of frames in all states ----------------------------------------------------------

enum class State { kNone, kHalfOpen, kConfirmed, kReplaced };
enum class Seal { kNone, kGarbage, kOldKey };

/// Brings a server and a client into a state; returns the session for the frame.
std::uint64_t bring_to(State state, Client& client, Server& server) {
  if (state == State::kNone) return std::uint64_t{77} << 48;
  client.open(kNow);
  talk(client, server, kNow);
  const std::uint64_t first = client.channel.session();
  if (state == State::kHalfOpen) return first;
  client.call("one", kNow);
  talk(client, server, kNow);
  if (state == State::kConfirmed) return first;
  client.renew(kNow);
  talk(client, server, kNow);
  client.open(kNow);
  client.call("two", kNow);
  talk(client, server, kNow);
  return first;
}

/// A bare frame of any kind: unsealed, or sealed with noise or with a key of another session.
Bytes frame_of(FrameKind kind, Seal seal, std::uint64_t session, Client& old_client) {
  wire::Header header;
  header.kind = kind;
  header.priority = kPriority;
  header.session = session;
  header.call_id = 9;
  header.service = header.method = 1;
  header.budget_us = 1'000'000;
  header.fragment_count = 1;
  Bytes frame(wire::kHeaderSize);
  wire::encode(header, frame.data());
  if (seal == Seal::kNone) return frame;
  if (seal == Seal::kOldKey) {
    if (kind == FrameKind::kHello) return {};  // A handshake has no keys.
    header.session = old_client.channel.session();
    wire::encode(header, frame.data());
    frame = copy_of(old_client.sealed.send(frame, kNow).send);
    if (frame.empty()) return frame;
    store_le(frame.data() + 8, session);
    return frame;
  }
  frame.resize(frame.size() + crypto::kTrailerSize, std::byte{0x5a});
  store_le(frame.data() + wire::kHeaderSize, std::uint64_t{3});
  wire::mark_sealed(frame.data());
  return frame;
}

/// The server's reaction according to the specification.
std::optional<DropReason> expected_drop(State state, Seal seal, FrameKind kind) {
  if (seal == Seal::kNone) {
    // sec-4-4. A bare HELLO has no good payload in any state.
    if (kind == FrameKind::kHello) return DropReason::kBadPayload;
    if (state == State::kHalfOpen || state == State::kConfirmed) return DropReason::kUnsealed;
    return std::nullopt;  // The H-Protocol's own rules apply.
  }
  // sec-4-1
  if (kind <= FrameKind::kWelcome) return DropReason::kReservedSet;
  if (state == State::kHalfOpen || state == State::kConfirmed) return DropReason::kBadSeal;
  return std::nullopt;
}

// sec-4-1, sec-4-4, sec-6-1: in no state does any kind of frame make a server do something that
// requires the session's keys.
TEST(SessionStates, RefuseEachKindOfFrameWithoutTheirKeys) {
  for (const State state : {State::kNone, State::kHalfOpen, State::kConfirmed, State::kReplaced}) {
    for (const Seal seal : {Seal::kNone, Seal::kGarbage, Seal::kOldKey}) {
      for (std::uint8_t number = 1; number <= wire::kFrameKindLast; ++number) {
        const auto kind = static_cast<FrameKind>(number);
        SCOPED_TRACE(testing::Message() << "state " << static_cast<int>(state) << " seal "
                                        << static_cast<int>(seal) << " kind " << int{number});
        Server server;
        Client client(server.identity.key.public_key);
        const std::uint64_t session = bring_to(state, client, server);
        const std::uint64_t own = client.channel.session();
        Recording other;
        const Bytes frame = frame_of(kind, seal, session, other.client);
        if (frame.empty()) continue;  // A client does not seal this kind.
        const int run_count = server.run_count;
        const std::uint32_t session_count = server.sessions->session_count();
        for (const Bytes& answer : server.receive(frame, kNow)) {
          EXPECT_LE(answer.size(), frame.size());
          client.receive(answer, kNow);
        }
        if (const auto reason = expected_drop(state, seal, kind)) {
          EXPECT_EQ(server.sealed->counters().dropped_for(*reason), 1u);
        }
        EXPECT_EQ(server.run_count, run_count);
        EXPECT_EQ(server.sessions->session_count(), session_count);
        // A client does not accept any of these frames as its server's frame.
        client.events.clear();
        client.receive(frame, kNow);
        EXPECT_TRUE(client.events.empty());
        if (state == State::kNone) continue;
        EXPECT_EQ(client.channel.session(), own);
        client.call("last", kNow);
        talk(client, server, kNow);
        EXPECT_EQ(client.reply, "last");
      }
    }
  }
}

}  // namespace
}  // namespace rtpm::sealed::test
