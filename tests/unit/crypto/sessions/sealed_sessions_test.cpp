#include <gtest/gtest.h>

#include <algorithm>

#include "peers.hpp"

namespace rtpm::sealed::test {
namespace {

using namespace std::chrono_literals;
using Kind = wire::ChannelEvent::Kind;

constexpr MonotonicTime kNow = time_from_ns(1'000'000'000);

Bytes forged(const Bytes& like, FrameKind kind, wire::Status status, std::size_t size = 0) {
  wire::Header header = header_of(like);
  header.kind = kind;
  header.flags = 0;
  header.status = status;
  header.item = 0;
  header.payload_size = header.message_size = static_cast<std::uint32_t>(size);
  header.fragment_count = 1;
  Bytes frame(wire::kHeaderSize + size);
  wire::encode(header, frame.data());
  return frame;
}

// sec-3.1-1, sec-3.2-2, sec-2-4: the sizes are those of the page, without an extra round trip.
TEST(SealedSessions, OpenInTwoRoundTripsAndCarryCalls) {
  Server server;
  Client client(server.identity.key.public_key);
  client.open(kNow);
  ASSERT_EQ(client.sent.size(), 1u);
  EXPECT_EQ(client.sent[0].size(), 128u);
  const auto cookie = server.receive(client.sent[0], kNow);
  client.sent.clear();
  ASSERT_EQ(cookie.size(), 1u);
  EXPECT_EQ(cookie[0].size(), 120u);
  EXPECT_EQ(server.job_count, 0);
  client.receive(cookie[0], kNow);
  ASSERT_EQ(client.sent.size(), 1u);
  EXPECT_EQ(client.sent[0].size(), 232u);
  const auto welcome = server.receive(client.sent[0], kNow);
  client.sent.clear();
  ASSERT_EQ(welcome.size(), 1u);
  EXPECT_EQ(welcome[0].size(), 176u);
  client.receive(welcome[0], kNow);
  EXPECT_EQ(client.events.back(), Kind::kReady);
  EXPECT_EQ(server.door.asked_for, client.key.public_key);
  EXPECT_EQ(server.sealed->client_of(client.channel.session()), client.key.public_key);

  client.call("move to zero", kNow);
  const Bytes call = client.sent.front();
  EXPECT_EQ(call.size(), wire::kHeaderSize + 12 + 24);
  const std::string_view text = "move to zero";
  const auto bytes = std::as_bytes(std::span(text));
  EXPECT_EQ(std::search(call.begin(), call.end(), bytes.begin(), bytes.end()), call.end());
  talk(client, server, kNow);
  EXPECT_EQ(client.reply, "move to zero");
  EXPECT_EQ(server.run_count, 1);
}

TEST(SealedSessions, UseACommonSuite) {
  for (const std::uint8_t ours : {std::uint8_t{1}, std::uint8_t{3}}) {
    for (const std::uint8_t theirs : {std::uint8_t{1}, std::uint8_t{3}}) {
      for (const wire::Medium medium : {wire::Medium::kDatagram, wire::Medium::kStream}) {
        Server server(medium, theirs);
        Client client(server.identity.key.public_key, medium, ours);
        client.open(kNow);
        talk(client, server, kNow);
        ASSERT_TRUE(client.channel.is_ready()) << int{ours} << int{theirs};
        const std::string largest(wire::sealed_payload_max(medium), 'x');
        for (const std::string& text : {std::string("hello"), largest}) {
          client.call(text, kNow);
          talk(client, server, kNow);
          EXPECT_EQ(client.reply, text);
        }
      }
    }
  }
}

// sec-3-3: the same bytes get the same answer, without any work; other bytes get new keys.
TEST(SealedSessions, AnswerCopiesOfAHelloWithTheSameWelcome) {
  Server server;
  Client client(server.identity.key.public_key);
  client.open(kNow);
  client.receive(server.receive(client.sent.front(), kNow)[0], kNow);
  const Bytes hello = client.sent.back();
  const auto welcome = server.receive(hello, kNow);
  const auto again = server.receive(hello, kNow);
  ASSERT_EQ(again.size(), 1u);
  EXPECT_EQ(again, welcome);
  EXPECT_EQ(server.job_count, 1);
  EXPECT_EQ(server.sessions->session_count(), 1u);
  // sec-3-1: the client's own repetition has the same bytes, too.
  client.sent.clear();
  client.on_time(kNow + 5ms);
  ASSERT_EQ(client.sent.size(), 1u);
  EXPECT_EQ(client.sent[0], hello);
}

// sec-3.2-2
TEST(SealedSessions, SpendNoKeyWorkOnAHelloWithoutAGoodCookie) {
  Server server;
  Client client(server.identity.key.public_key);
  client.open(kNow);
  client.receive(server.receive(client.sent.front(), kNow)[0], kNow);
  const Bytes hello = client.sent.back();
  const auto answer = server.receive(hello, kNow, {.low = 2, .port = 7});
  ASSERT_EQ(answer.size(), 1u);
  EXPECT_EQ(answer[0].size(), 120u);
  EXPECT_EQ(server.job_count, 0);
}

// sec-3.2-2: a client that did not prove a key gets no answer; one that did gets a refusal.
TEST(SealedSessions, RefuseOnlyClientsThatProvedAKey) {
  Server server;
  server.door.is_open = false;
  Client client(server.identity.key.public_key);
  client.open(kNow);
  client.receive(server.receive(client.sent.front(), kNow)[0], kNow);
  Bytes changed = client.sent.back();
  changed[200] ^= std::byte{1};
  EXPECT_TRUE(server.receive(changed, kNow).empty());
  EXPECT_EQ(server.door.asked_for, std::nullopt);
  const auto refused = server.receive(client.sent.back(), kNow);
  ASSERT_EQ(refused.size(), 1u);
  EXPECT_EQ(header_of(refused[0]).status, wire::Status::kNotAllowed);
  EXPECT_EQ(server.sessions->session_count(), 0u);
  // sec-6-2: the client takes the refusal as a hint, because anyone may have sent it.
  client.receive(refused[0], kNow);
  EXPECT_TRUE(client.events.empty() || client.events.back() != Kind::kRefused);
  EXPECT_EQ(client.sealed.hint(), wire::Status::kNotAllowed);
}

// sec-3.2-2: an admitted client's public key alone gets the same silence as any other, at the same
// cost: the server checks admission only after the key is proved.
TEST(SealedSessions, RevealNothingToAPublicKeyWithoutItsPrivateKey) {
  for (const bool is_open : {false, true}) {
    Server server;
    server.door.is_open = is_open;
    crypto::KeyPair stolen = crypto::KeyPair::generate();
    stolen.public_key = crypto::KeyPair::generate().public_key;
    Client client(server.identity.key.public_key, wire::Medium::kDatagram, 3, std::move(stolen));
    client.open(kNow);
    client.receive(server.receive(client.sent.front(), kNow)[0], kNow);
    EXPECT_TRUE(server.receive(client.sent.back(), kNow).empty());
    EXPECT_EQ(server.door.asked_for, std::nullopt);
    EXPECT_EQ(server.job_count, 1);
    EXPECT_EQ(server.sealed->counters().dropped_for(DropReason::kBadSeal), 1u);
    EXPECT_EQ(server.sessions->session_count(), 0u);
  }
}

// sec-2-4, sec-3.1-2: a client does not talk to a server without level S or with another key.
TEST(SealedSessions, NeverFallBackToUnsealedOrAnotherKey) {
  wire::ServerSessionsConfig config;
  config.epoch = 1;
  wire::ServerSessions plain(config);
  Server server;
  Client client(server.identity.key.public_key);
  client.open(kNow);
  const wire::Verdict verdict = plain.on_frame(client.sent.front(), kClientAddress, kNow);
  client.sent.clear();
  client.receive(copy_of(verdict.frame), kNow);
  EXPECT_TRUE(client.sent.empty());
  EXPECT_EQ(client.sealed.hint(), wire::Status::kVersionUnsupported);
  EXPECT_EQ(client.sealed.counters().dropped_for(DropReason::kBadPayload), 1u);

  Server other;
  other.door.is_open = true;
  client.open(kNow);
  talk(client, other, kNow);
  EXPECT_FALSE(client.channel.is_ready());
  EXPECT_EQ(client.sealed.other_key(), other.identity.key.public_key);
  EXPECT_EQ(other.sessions->session_count(), 0u);
}

// sec-6-2, sec-6-3: if a frame claims that the session is unknown, the client asks its server.
TEST(SealedSessions, SurviveAForgedRefusal) {
  Server server;
  Client client(server.identity.key.public_key);
  client.open(kNow);
  talk(client, server, kNow);
  client.call("one", kNow);
  const Bytes call = client.sent.front();
  client.sent.clear();  // Lost.
  client.events.clear();
  client.receive(forged(call, FrameKind::kRefuse, wire::Status::kUnknownSession), kNow);
  EXPECT_EQ(client.sent.size(), 1u) << "a handshake in the background";
  // The client asks at most once every 100 ms.
  client.receive(forged(call, FrameKind::kRefuse, wire::Status::kUnknownSession), kNow + 99ms);
  EXPECT_EQ(client.sent.size(), 1u);
  for (const FrameKind kind : {FrameKind::kClose, FrameKind::kReply, FrameKind::kAck}) {
    client.receive(forged(call, kind, wire::Status::kOk), kNow);
  }
  const std::uint64_t session = client.channel.session();
  talk(client, server, kNow);
  EXPECT_TRUE(client.events.empty());
  EXPECT_EQ(client.channel.session(), session);
  EXPECT_EQ(server.sessions->session_count(), 1u);
  client.sent.push_back(call);
  talk(client, server, kNow);
  EXPECT_EQ(client.reply, "one");
  EXPECT_EQ(client.sealed.counters().dropped_for(DropReason::kUnsealed), 5u);
}

// sec-6-3: the server itself says under its key that the session is unknown.
TEST(SealedSessions, AreReopenedAfterARestartOfTheServer) {
  Server server;
  Client client(server.identity.key.public_key);
  client.open(kNow);
  talk(client, server, kNow);
  const std::uint64_t epoch = client.channel.welcome().server_epoch;
  server.restart();
  client.call("one", kNow);
  client.events.clear();
  talk(client, server, kNow);
  ASSERT_FALSE(client.events.empty());
  EXPECT_EQ(client.events.back(), Kind::kLost);
  // The next handshake is already done.
  client.open(kNow);
  EXPECT_TRUE(client.sent.empty());
  ASSERT_TRUE(client.channel.is_ready());
  EXPECT_NE(client.channel.welcome().server_epoch, epoch);
  client.call("two", kNow);
  talk(client, server, kNow);
  EXPECT_EQ(client.reply, "two");
}

/// A handmade handshake of `key` after `client` got its COOKIE; message 1 names `former`.
std::optional<wire::SealedWelcome> welcome_of(const Client& client, const crypto::KeyPair& key,
                                              std::uint64_t former, Server& server) {
  Bytes hello = client.sent.back();
  wire::Header header = header_of(hello);
  ++header.call_id;
  wire::encode(header, hello.data());
  const auto payload = std::span<const std::byte, wire::Hello::kSize>(
      ConstBytes(hello).subspan(wire::kHeaderSize, wire::Hello::kSize));
  const auto read = wire::decode_sealed_hello(ConstBytes(hello).subspan(wire::kHeaderSize));
  Bytes cookie(wire::SealedCookie::kSize);
  wire::encode(wire::SealedCookie{read->hello.cookie, server.identity.key.public_key,
                                  server.identity.suites},
               cookie);
  const bool is_aes = (read->hello.features & wire::kFeatureAesGcm) != 0;
  crypto::Initiator initiator(is_aes ? crypto::Suite::kAesGcm : crypto::Suite::kChaChaPoly,
                              key.clone(), server.identity.key.public_key, {},
                              crypto::KeyPair::generate(),
                              wire::prologue_of(header, payload, cookie));
  Bytes named(wire::kMessage1PayloadSize);
  store_le(named.data(), former);
  EXPECT_TRUE(
      initiator.write_message_1(named, MutableBytes(hello).last(wire::SealedHello::kMessageSize)));
  const auto answers = server.receive(hello, kNow);
  if (answers.size() != 1 || header_of(answers[0]).kind != FrameKind::kWelcome) return std::nullopt;
  Bytes inner(wire::SealedWelcome::kInnerSize);
  EXPECT_TRUE(initiator.read_message_2(ConstBytes(answers[0]).subspan(wire::kHeaderSize), inner));
  return wire::decode_sealed_welcome(inner, read->hello.features);
}

// sec-6-3, sec-6-4
TEST(SealedSessions, AreReportedAliveOnlyToTheirClient) {
  Server server;
  Client client(server.identity.key.public_key);
  open_and_call(client, server, kNow);
  const std::uint64_t session = client.channel.session();

  Client stranger(server.identity.key.public_key);
  stranger.open(kNow);
  stranger.receive(server.receive(stranger.sent.front(), kNow)[0], kNow);
  const auto to_stranger = welcome_of(stranger, stranger.key, session, server);
  ASSERT_TRUE(to_stranger);
  EXPECT_EQ(to_stranger->former, wire::FormerSession::kGone);
  EXPECT_NE(to_stranger->session, session);

  const auto to_client = welcome_of(stranger, client.key, session, server);
  ASSERT_TRUE(to_client);
  EXPECT_EQ(to_client->former, wire::FormerSession::kAlive);
  EXPECT_EQ(to_client->session, session);
  const auto of_none = welcome_of(stranger, client.key, 0, server);
  ASSERT_TRUE(of_none);
  EXPECT_EQ(of_none->former, wire::FormerSession::kNone);
  // The client's session goes on all the while.
  client.call("two", kNow);
  talk(client, server, kNow);
  EXPECT_EQ(client.reply, "two");
}

TEST(SealedSessions, LimitConcurrentHandshakes) {
  Server server;
  std::vector<HandshakeJob*> jobs;
  for (std::uint32_t i = 0; i < 9; ++i) {
    Client client(server.identity.key.public_key);
    client.open(kNow);
    client.receive(server.receive(client.sent.front(), kNow)[0], kNow);
    Bytes hello = client.sent.back();
    const auto outcome = server.sealed->on_frame(hello, kClientAddress, kNow);
    if (outcome.job != nullptr) jobs.push_back(outcome.job);
    // A duplicate of a handshake in progress causes no further work.
    EXPECT_EQ(server.sealed->on_frame(hello, kClientAddress, kNow).job, nullptr);
  }
  EXPECT_EQ(jobs.size(), 8u);
  EXPECT_EQ(server.sealed->counters().dropped_for(DropReason::kRateLimited), 2u);
}

// sec-6-1: a session that its client did not confirm replaces no other one, and does not stay.
TEST(SealedSessions, ExpireHalfOpenAndReplaceNothing) {
  Server server;
  Client client(server.identity.key.public_key);
  client.open(kNow);
  talk(client, server, kNow);
  EXPECT_EQ(server.sealed->half_open_count(), 1u);
  client.call("one", kNow);
  talk(client, server, kNow);
  EXPECT_EQ(server.sealed->half_open_count(), 0u);
  const std::uint64_t session = client.channel.session();

  // The same client loses its keys and starts again; its WELCOME is lost.
  client.sealed.reset();
  client.open(kNow);
  while (!client.sent.empty()) {
    const Bytes frame = client.sent.front();
    client.sent.pop_front();
    for (const Bytes& answer : server.receive(frame, kNow)) {
      if (header_of(answer).kind != FrameKind::kWelcome) client.receive(answer, kNow);
    }
  }
  EXPECT_EQ(server.sealed->half_open_count(), 1u);
  EXPECT_TRUE(server.sessions->is_known(session));
  server.sealed->on_time(kNow + 2s + 1ns);
  EXPECT_EQ(server.sealed->half_open_count(), 0u);
  EXPECT_TRUE(server.sessions->is_known(session));
}

// sec-6-1: half-open sessions take at most a quarter of the table.
TEST(SealedSessions, UseAQuarterOfTheTableAtMostHalfOpen) {
  Server server;
  std::vector<std::unique_ptr<Client>> clients;
  for (std::uint32_t i = 0; i < 6; ++i) {
    clients.push_back(std::make_unique<Client>(server.identity.key.public_key));
    clients.back()->open(kNow + i * 1ms);
    talk(*clients.back(), server, kNow + i * 1ms);
  }
  EXPECT_EQ(server.sealed->half_open_count(), 2u);
}

/// Plays one call delayed by `held`; returns whether it ran. The clocks differ by a day.
bool runs_after(Duration held, Duration budget, Client& client, Server& server, MonotonicTime now) {
  client.call("held", now, budget);
  const Bytes call = client.sent.front();
  client.sent.clear();
  const int before = server.run_count;
  for (const Bytes& answer : server.receive(call, now + 24h + held))
    client.receive(answer, now);
  static_cast<void>(client.channel.on_time(now + budget + 1s));  // Its caller no longer waits.
  client.sent.clear();
  return server.run_count > before;
}

/// A session whose first call took no time, between machines whose clocks differ by a day.
void open_far_away(Client& client, Server& server, MonotonicTime now) {
  client.open(now);
  talk(client, server, now, now + 24h);
  ASSERT_TRUE(client.channel.is_ready());
  EXPECT_TRUE(runs_after(0ns, 10ms, client, server, now));
}

// sec-6.1-1: over both transports, and for any clock readings.
TEST(SealedSessions, RunNoCallThatWasDelayedBeyondItsBudget) {
  for (const wire::Medium medium : {wire::Medium::kDatagram, wire::Medium::kStream}) {
    Server server(medium);
    Client client(server.identity.key.public_key, medium);
    open_far_away(client, server, kNow);
    MonotonicTime now = kNow;
    std::uint64_t expired = 0;
    for (const Duration held : {1ms, 5ms, 10ms, 50ms, 500ms, 2'000ms, 9'000ms}) {
      for (const Duration budget : {1ms, 10ms, 100ms, 3'000ms}) {
        now += 10s;
        // This call is fast, so that 200 ppm of the pause between the two calls do not matter.
        EXPECT_TRUE(runs_after(0ns, 10ms, client, server, now));
        now += 2ms;
        const bool is_late = held > budget + 1ms;
        EXPECT_EQ(runs_after(held, budget, client, server, now), !is_late)
            << held.count() << ' ' << budget.count();
        expired += is_late ? 1 : 0;
        EXPECT_EQ(server.sealed->counters().expired_count, expired);
      }
    }
  }
}

// sec-6.1-1: transit time is subtracted from the call's budget.
TEST(SealedSessions, SubtractTheTransitTimeFromABudget) {
  Server server;
  Client client(server.identity.key.public_key);
  open_far_away(client, server, kNow);
  EXPECT_TRUE(runs_after(500us, 100ms, client, server, kNow + 10ms));
  EXPECT_EQ(server.last_deadline, kNow + 24h + 110ms + 500us);
  EXPECT_TRUE(runs_after(41ms, 100ms, client, server, kNow + 20ms));
  EXPECT_LT(server.last_deadline, kNow + 24h + 122ms);
  EXPECT_GT(server.last_deadline, kNow + 24h + 120ms);
}

// sec-6.1: two clocks drift apart by 200 ppm at most.
TEST(SealedSessions, RunCallsOfDriftingClocks) {
  for (const int parts_per_million : {-200, 200}) {
    Server server;
    Client client(server.identity.key.public_key);
    open_far_away(client, server, kNow);
    for (int minute = 1; minute < 600; ++minute) {
      const Duration gone = minute * 60s;
      EXPECT_TRUE(
          runs_after(gone * parts_per_million / 1'000'000, 1ms, client, server, kNow + gone));
    }
  }
}

// sec-6.1-2, sec-6-6: after a suspend the first call ends the session; the next opens another.
TEST(SealedSessions, AreReplacedAfterASuspendOfTheClient) {
  Server server;
  Client client(server.identity.key.public_key);
  open_far_away(client, server, kNow);
  const std::uint64_t session = client.channel.session();
  EXPECT_FALSE(runs_after(8s, 100ms, client, server, kNow + 1s)) << "that may be an attacker's";
  EXPECT_TRUE(server.sessions->is_known(session));
  EXPECT_FALSE(runs_after(1h, 100ms, client, server, kNow + 2s));
  EXPECT_FALSE(server.sessions->is_known(session));

  client.events.clear();
  client.call("one", kNow + 3s);
  talk(client, server, kNow + 3s, kNow + 25h);
  ASSERT_FALSE(client.events.empty());
  EXPECT_EQ(client.events.back(), Kind::kClosed) << "its calls may have run, for all it knows";
  client.open(kNow + 3s);
  ASSERT_TRUE(client.channel.is_ready());
  EXPECT_NE(client.channel.session(), session);
  EXPECT_TRUE(runs_after(1h, 1ms, client, server, kNow + 3s));
}

// sec-6-6: the call ran, its reply was lost, and the client has its grant back before it asks
// again.
TEST(SealedSessions, RunNoCallAgainAfterARevokedGrant) {
  Server server;
  Client client(server.identity.key.public_key);
  open_and_call(client, server, kNow);
  client.call("two", kNow);
  EXPECT_EQ(server.receive(client.sent.front(), kNow).size(), 1u);
  client.sent.clear();
  server.door.is_open = false;
  server.sealed->end_unadmitted(kNow);
  EXPECT_EQ(server.sessions->session_count(), 0u);
  server.door.is_open = true;
  client.events.clear();
  client.on_time(kNow + 50ms);
  talk(client, server, kNow + 50ms);
  ASSERT_FALSE(client.events.empty());
  EXPECT_EQ(client.events.back(), Kind::kClosed);
  EXPECT_EQ(server.run_count, 2);
}

// sec-6-7: a key that exceeds its share evicts only its own sessions.
TEST(SealedSessions, LimitTheShareOfOneKey) {
  Server server;  // It has capacity for 8 sessions.
  const crypto::KeyPair key = crypto::KeyPair::generate();
  std::vector<std::unique_ptr<Client>> clients;
  const auto add = [&](crypto::KeyPair own, MonotonicTime now) -> Client& {
    clients.push_back(std::make_unique<Client>(server.identity.key.public_key,
                                               wire::Medium::kDatagram, 3, std::move(own)));
    Client& client = *clients.back();
    const wire::PeerAddress from{.low = clients.size(), .port = 7};
    client.open(now);
    talk(client, server, now, now, from);
    if (!client.channel.is_ready()) return client;
    client.call("one", now);
    talk(client, server, now, now, from);
    return client;
  };
  for (int i = 0; i < 6; ++i)
    EXPECT_EQ(add(key.clone(), kNow + i * 1s).reply, "one");
  EXPECT_EQ(add(key.clone(), kNow + 10s).sealed.hint(), wire::Status::kOverload);
  EXPECT_EQ(server.sessions->session_count(), 6u);
  EXPECT_EQ(add(crypto::KeyPair::generate(), kNow + 10s).reply, "one");
  // The first session has been silent long enough.
  const std::uint64_t first = clients[0]->channel.session();
  EXPECT_EQ(add(key.clone(), kNow + 31s).reply, "one");
  EXPECT_FALSE(server.sessions->is_known(first));
  EXPECT_EQ(server.sessions->session_count(), 7u);
}

// sec-6-7: of 16 sessions 4 may be half-open, and 3 of them may belong to one key.
TEST(SealedSessions, LimitTheHalfOpenShareOfOneKey) {
  Server server(wire::Medium::kDatagram, 3, false, 16);
  std::vector<std::unique_ptr<Client>> clients;
  const auto add = [&](crypto::KeyPair own) {
    clients.push_back(std::make_unique<Client>(server.identity.key.public_key,
                                               wire::Medium::kDatagram, 3, std::move(own)));
    const MonotonicTime now = kNow + static_cast<int>(clients.size()) * 1ms;
    clients.back()->open(now);
    talk(*clients.back(), server, now);
    return clients.back()->channel.session();
  };
  const std::uint64_t victim = add(crypto::KeyPair::generate());
  const crypto::KeyPair key = crypto::KeyPair::generate();
  for (int i = 0; i < 10; ++i)
    add(key.clone());
  EXPECT_TRUE(server.sessions->is_known(victim));
  EXPECT_EQ(server.sealed->half_open_count(), 4u);
}

// sec-4-4: a sealed session accepts no unsealed frame; unsealed sessions may exist beside it.
TEST(SealedSessions, CoexistWithUnsealedOnesIfAllowed) {
  for (const bool takes_unsealed : {false, true}) {
    Server server(wire::Medium::kDatagram, 3, takes_unsealed);
    Client client(server.identity.key.public_key);
    client.open(kNow);
    talk(client, server, kNow);
    client.call("one", kNow);
    const Bytes call = client.sent.front();
    Bytes plain = forged(call, FrameKind::kCall, wire::Status::kOk, 4);
    EXPECT_TRUE(server.receive(plain, kNow).empty());
    EXPECT_EQ(server.sealed->counters().dropped_for(DropReason::kUnsealed), 1u);
    EXPECT_TRUE(server.receive(forged(call, FrameKind::kClose, wire::Status::kOk), kNow).empty());
    // sec-4-2: the size of a frame whose flag was taken away is not looked at.
    Bytes stripped = call;
    wire::unmark_sealed(stripped.data());
    EXPECT_TRUE(server.receive(stripped, kNow).empty());
    EXPECT_EQ(server.sealed->counters().dropped_for(DropReason::kUnsealed), 3u);
    talk(client, server, kNow);
    EXPECT_EQ(client.reply, "one");

    std::array<std::byte, wire::kDatagramFrameSizeMax> buffer{};
    wire::ClientChannel channel({.client_epoch = 9, .channel = 2}, buffer);
    const auto answers = server.receive(copy_of(channel.open(kPriority, kNever, kNow)), kNow);
    EXPECT_EQ(answers.size(), takes_unsealed ? 1u : 0u);
    if (!takes_unsealed) continue;
    const auto hello = copy_of(channel.on_frame(answers[0], kNow).frame);
    static_cast<void>(channel.on_frame(server.receive(hello, kNow)[0], kNow));
    ASSERT_TRUE(channel.is_ready());
    const auto plain_call = channel.call(
        {.service = 1, .method = 1, .priority = kPriority, .deadline = kNever}, plain, kNow);
    const auto replies = server.receive(copy_of(*plain_call), kNow);
    ASSERT_EQ(replies.size(), 1u);
    EXPECT_EQ(channel.on_frame(replies[0], kNow).kind, Kind::kReply);
    EXPECT_EQ(server.sealed->client_of(channel.session()), std::nullopt);
    // The flag alone does not turn a frame of an unsealed session into a sealed one.
    Bytes flagged = copy_of(*plain_call);
    flagged.resize(flagged.size() + 24);
    wire::mark_sealed(flagged.data());
    EXPECT_TRUE(server.receive(flagged, kNow).empty());
  }
}

// sec-6-1, sec-6.2-2: over a stream a HELLO replaces the session of its connection (hp-4-4), but no
// sealed one.
TEST(SealedSessions, SurviveAForgedHelloOverAStream) {
  Server server(wire::Medium::kStream, 3, /*takes_unsealed=*/true);
  Client client(server.identity.key.public_key, wire::Medium::kStream);
  client.open(kNow);
  const Bytes hello = client.sent.front();
  talk(client, server, kNow);
  client.call("one", kNow);
  talk(client, server, kNow);
  Bytes again = hello;
  again[48] ^= std::byte{1};  // The sender's time is not part of the prologue.
  EXPECT_TRUE(server.receive(again, kNow).empty());
  std::array<std::byte, wire::kStreamFrameSizeMax> buffer{};
  wire::ClientChannel plain({.medium = wire::Medium::kStream, .client_epoch = 9, .channel = 2},
                            buffer);
  EXPECT_TRUE(server.receive(copy_of(plain.open(kPriority, kNever, kNow)), kNow).empty());
  client.call("two", kNow);
  talk(client, server, kNow);
  EXPECT_EQ(client.reply, "two");
}

// sec-3.2-3: its client would wait for an answer to the later one in vain.
TEST(SealedSessions, EndAStreamAtASecondHandshakeBesideTheFirst) {
  Server server(wire::Medium::kStream);
  Client client(server.identity.key.public_key, wire::Medium::kStream);
  client.open(kNow);
  Bytes hello = client.sent.front();
  ASSERT_NE(server.sealed->on_frame(hello, kClientAddress, kNow).job, nullptr);
  EXPECT_TRUE(server.receive(hello, kNow).empty());
  EXPECT_FALSE(server.has_hung_up) << "a copy is answered with the first";
  client.open(kNow);
  EXPECT_TRUE(server.receive(client.sent.back(), kNow).empty());
  EXPECT_TRUE(server.has_hung_up);
}

// sec-5-7: over a stream, any frame that does not fit ends the connection.
TEST(SealedSessions, EndAStreamAtTheFirstInvalidFrame) {
  for (const int fault : {0, 1, 2}) {
    Server server(wire::Medium::kStream);
    Client client(server.identity.key.public_key, wire::Medium::kStream);
    client.open(kNow);
    EXPECT_EQ(client.sent.front().size(), 232u) << "message 1 at once";
    talk(client, server, kNow);
    ASSERT_TRUE(client.channel.is_ready());
    client.call("one", kNow);
    Bytes call = client.sent.front();
    if (fault == 0) talk(client, server, kNow);  // In this case the frame is a duplicate.
    if (fault == 1) call.back() ^= std::byte{1};
    if (fault == 2) call[call.size() - 24] ^= std::byte{1};
    EXPECT_TRUE(server.receive(call, kNow).empty());
    EXPECT_TRUE(server.has_hung_up) << fault;
    client.receive(call, kNow);
    EXPECT_TRUE(client.is_broken);
  }
}

// sec-6-5: the old session goes on until the channel moves to the new one, which loses no frame.
TEST(SealedSessions, RenewTheirKeysBeforeTheOldOnesEnd) {
  Server server;
  Client client(server.identity.key.public_key);
  open_and_call(client, server, kNow);
  const std::uint64_t old = client.channel.session();
  EXPECT_FALSE(client.sealed.is_renewal_due(kNow + 23h));
  EXPECT_TRUE(client.sealed.is_renewal_due(kNow + 24h));
  client.renew(kNow);
  EXPECT_EQ(client.sent.size(), 1u);
  talk(client, server, kNow);
  ASSERT_TRUE(client.sealed.has_next(kNow));
  client.call("two", kNow);
  talk(client, server, kNow);
  EXPECT_EQ(client.reply, "two");
  EXPECT_EQ(client.channel.session(), old);

  client.open(kNow);
  EXPECT_TRUE(client.sent.empty());
  ASSERT_TRUE(client.channel.is_ready());
  EXPECT_NE(client.channel.session(), old);
  EXPECT_TRUE(server.sessions->is_known(old));
  client.call("three", kNow);
  talk(client, server, kNow);
  EXPECT_EQ(client.reply, "three");
  EXPECT_FALSE(server.sessions->is_known(old));
}

// Both sides drop a new session that its channel does not adopt.
TEST(SealedSessions, KeepTheirKeysIfARenewalIsNotUsed) {
  Server server;
  Client client(server.identity.key.public_key);
  open_and_call(client, server, kNow);
  const std::uint64_t old = client.channel.session();
  client.renew(kNow);
  talk(client, server, kNow);
  EXPECT_FALSE(client.sealed.has_next(kNow + 1s));
  server.sealed->on_time(kNow + 3s);
  EXPECT_EQ(server.sessions->session_count(), 1u);
  client.open(kNow + 3s);
  talk(client, server, kNow + 3s);
  EXPECT_EQ(client.channel.session(), old) << "the server reports it alive";
  client.call("two", kNow + 3s);
  talk(client, server, kNow + 3s);
  EXPECT_EQ(client.reply, "two");
}

TEST(SealedSessions, LimitTheHandshakesOfOneHost) {
  Server server;
  int job_count = 0;
  for (std::uint32_t i = 0; i < 40; ++i) {
    Client client(server.identity.key.public_key);
    client.open(kNow);
    client.receive(server.receive(client.sent.front(), kNow)[0], kNow);
    const int before = server.job_count;
    static_cast<void>(server.receive(client.sent.back(), kNow));
    job_count += server.job_count > before ? 1 : 0;
  }
  EXPECT_EQ(job_count, 32);
}

TEST(SealedSessions, DropTheirKeysWhenClosed) {
  Server server;
  Client client(server.identity.key.public_key);
  client.open(kNow);
  talk(client, server, kNow);
  const std::uint64_t session = client.channel.session();
  client.send(client.channel.close(kNow), kNow);
  EXPECT_FALSE(client.sealed.has_session());
  talk(client, server, kNow);
  EXPECT_EQ(server.sealed->client_of(session), std::nullopt);
  EXPECT_EQ(server.sessions->session_count(), 0u);
}

}  // namespace
}  // namespace rtpm::sealed::test
