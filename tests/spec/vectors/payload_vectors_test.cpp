#include <gtest/gtest.h>

#include <array>

#include "rtpm/rt/host.hpp"
#include "rtpm/wire/client_channel.hpp"
#include "rtpm/wire/control.hpp"
#include "rtpm/wire/fragments.hpp"
#include "rtpm/wire/handshake.hpp"
#include "rtpm/wire/interface_text.hpp"
#include "rtpm/wire/server_sessions.hpp"
#include "rtpm/wire/stream.hpp"
#include "rtpm/wire/url.hpp"
#include "vectors.hpp"

// The vectors of payloads and addresses in spec/vectors/.
namespace rtpm::spec {
namespace {

constexpr int kPriority = 24000;

Bytes frame_with(wire::Header header, const Bytes& payload) {
  header.priority = kPriority;
  header.payload_size = header.message_size = static_cast<std::uint32_t>(payload.size());
  Bytes frame(wire::kHeaderSize);
  encode(header, frame.data());
  frame.insert(frame.end(), payload.begin(), payload.end());
  frame.shrink_to_fit();
  return frame;
}

/// Calls `check(vector, payload)` for each of a file's good or bad vectors.
template <class Check>
void for_each_payload(const char* file, const char* which, const Check& check) {
  const Json vectors = read_vectors(file).at(which);
  EXPECT_FALSE(vectors.empty());
  for (const Json& vector : vectors) {
    SCOPED_TRACE(vector.at("name"));
    check(vector, bytes_of_hex(vector.at("hex")));
  }
}

struct AtAServer {
  wire::Verdict verdict{};
  std::string dropped_as;
};

AtAServer send_hello(wire::ServerSessions& server, const Bytes& payload) {
  wire::Header header;
  header.kind = wire::FrameKind::kHello;
  header.call_id = 5;
  const wire::FrameCounters before = server.counters();
  const wire::Verdict verdict =
      server.on_frame(frame_with(header, payload), {.low = 1}, time_from_ns(1));
  return {verdict, newly_dropped(before, server.counters())};
}

wire::ServerSessions new_server() {
  wire::ServerSessionsConfig config;
  config.epoch = 1;
  return wire::ServerSessions(config);
}

TEST(HelloVectors, GoodOnesAreReadAndAnswered) {
  for_each_payload("hello.json", "good", [](const Json& vector, const Bytes& payload) {
    const auto hello = wire::decode_hello(payload);
    ASSERT_TRUE(hello);
    const Json& fields = vector.at("fields");
    EXPECT_EQ(hello->version_min, fields.at("version_min"));
    EXPECT_EQ(hello->version_max, fields.at("version_max"));
    EXPECT_EQ(hello->features, fields.at("features"));
    EXPECT_EQ(hello->client_epoch, wide_number(fields.at("client_epoch")));
    EXPECT_EQ(hello->channel, wide_number(fields.at("channel")));
    EXPECT_EQ(hello->clock_domain, wide_number(fields.at("clock_domain")));
    EXPECT_EQ(hello->message_size_max, fields.at("message_size_max"));
    EXPECT_EQ(hex_of(hello->cookie), fields.at("cookie"));
    Bytes again(wire::Hello::kSize);
    encode(*hello, again);
    EXPECT_EQ(again, payload);

    wire::ServerSessions server = new_server();
    const AtAServer outcome = send_hello(server, payload);
    ASSERT_EQ(outcome.verdict.action, wire::Verdict::Action::kSend);
    const auto answer = wire::decode_frame(outcome.verdict.frame);
    ASSERT_TRUE(answer);
    EXPECT_EQ(to_string(answer->kind), vector.at("answer").at("kind"));
    EXPECT_EQ(to_string(answer->status), vector.at("answer").value("status", "ok"));
    EXPECT_EQ(server.session_count(), 0u);
  });
}

TEST(HelloVectors, BadOnesAreDropped) {
  for_each_payload("hello.json", "bad", [](const Json& vector, const Bytes& payload) {
    EXPECT_FALSE(wire::decode_hello(payload));
    wire::ServerSessions server = new_server();
    const AtAServer outcome = send_hello(server, payload);
    EXPECT_EQ(outcome.verdict.action, wire::Verdict::Action::kNothing);
    EXPECT_EQ(outcome.dropped_as, vector.at("drop"));
  });
}

/// A client that waits for the answer to its HELLO.
class OpeningClient {
 public:
  OpeningClient() {
    const ConstBytes hello = client_.open(kPriority, kNever, time_from_ns(1));
    handshake_number_ = wire::decode_frame(hello)->call_id;
  }
  wire::ChannelEvent receive(wire::FrameKind kind, std::uint64_t session, const Bytes& payload) {
    wire::Header header;
    header.kind = kind;
    header.session = session;
    header.call_id = handshake_number_;
    return client_.on_frame(frame_with(header, payload), time_from_ns(2));
  }
  const wire::ClientChannel& channel() const { return client_; }
  std::string dropped_as() const { return newly_dropped({}, client_.counters()); }

 private:
  std::array<std::byte, 128> buffer_{};
  wire::ClientChannel client_{{.client_epoch = 1}, buffer_};
  std::uint32_t handshake_number_ = 0;
};

TEST(CookieVectors, GoodOnesAreReturned) {
  for_each_payload("cookie.json", "good", [](const Json& vector, const Bytes& payload) {
    OpeningClient client;
    const auto event = client.receive(wire::FrameKind::kCookie, 0, payload);
    ASSERT_EQ(event.kind, wire::ChannelEvent::Kind::kSend);
    const auto hello = wire::decode_hello(event.frame.subspan(wire::kHeaderSize));
    ASSERT_TRUE(hello);
    EXPECT_EQ(hex_of(hello->cookie), vector.at("hex"));
  });
}

TEST(CookieVectors, BadOnesAreDropped) {
  for_each_payload("cookie.json", "bad", [](const Json& vector, const Bytes& payload) {
    OpeningClient client;
    EXPECT_EQ(client.receive(wire::FrameKind::kCookie, 0, payload).kind,
              wire::ChannelEvent::Kind::kNothing);
    EXPECT_EQ(client.dropped_as(), vector.at("drop"));
  });
}

// hp-5.6-4
TEST(AckVectors, AreDecodedOrRejected) {
  for_each_payload("ack.json", "good", [](const Json& vector, const Bytes& payload) {
    const auto ack = wire::decode_ack(payload);
    ASSERT_TRUE(ack);
    EXPECT_EQ(ack->first_missing, vector.at("fields").at("first_missing"));
    Bytes again(wire::FragmentAck::kSize);
    encode(*ack, again);
    EXPECT_EQ(again, payload);
    EXPECT_EQ(hex_of(ConstBytes(again).subspan(8)), vector.at("fields").at("later"));
  });
  for_each_payload("ack.json", "bad", [](const Json& vector, const Bytes& payload) {
    EXPECT_FALSE(wire::decode_ack(payload));
    EXPECT_EQ(vector.at("drop"), "bad_payload");
  });
}

// hp-5.10-8
TEST(CreditVectors, AreDecodedOrRejected) {
  for_each_payload("credit.json", "good", [](const Json& vector, const Bytes& payload) {
    const auto credit = wire::decode_credit(payload);
    ASSERT_TRUE(credit);
    EXPECT_EQ(credit->first_missing, vector.at("fields").at("first_missing"));
    EXPECT_EQ(credit->byte_limit, vector.at("fields").at("byte_limit"));
    EXPECT_EQ(credit->later, wide_number(vector.at("fields").at("later")));
    Bytes again(wire::StreamCredit::kSize);
    encode(*credit, again);
    EXPECT_EQ(again, payload);
  });
  for_each_payload("credit.json", "bad", [](const Json& vector, const Bytes& payload) {
    EXPECT_FALSE(wire::decode_credit(payload));
    EXPECT_EQ(vector.at("drop"), "bad_payload");
  });
}

TEST(WelcomeVectors, GoodOnesOpenASession) {
  for_each_payload("welcome.json", "good", [](const Json& vector, const Bytes& payload) {
    OpeningClient client;
    const std::uint64_t session = wide_number(vector.at("session"));
    EXPECT_EQ(client.receive(wire::FrameKind::kWelcome, session, payload).kind,
              wire::ChannelEvent::Kind::kReady);
    EXPECT_EQ(client.channel().session(), session);
    const wire::Welcome& welcome = client.channel().welcome();
    const Json& fields = vector.at("fields");
    EXPECT_EQ(welcome.version, fields.at("version"));
    EXPECT_EQ(welcome.band.low.value(), fields.at("band_low"));
    EXPECT_EQ(welcome.band.high.value(), fields.at("band_high"));
    EXPECT_EQ(welcome.ceiling.value(), fields.at("ceiling"));
    EXPECT_EQ(welcome.features, fields.at("features"));
    EXPECT_EQ(welcome.window, fields.at("window"));
    EXPECT_EQ(welcome.server_epoch, wide_number(fields.at("server_epoch")));
    EXPECT_EQ(welcome.clock_domain, wide_number(fields.at("clock_domain")));
    EXPECT_EQ(welcome.message_size_max, fields.at("message_size_max"));
    Bytes again(wire::Welcome::kSize);
    encode(welcome, again);
    EXPECT_EQ(again, payload);
  });
}

TEST(WelcomeVectors, BadOnesAreDropped) {
  for_each_payload("welcome.json", "bad", [](const Json& vector, const Bytes& payload) {
    OpeningClient client;
    EXPECT_EQ(
        client.receive(wire::FrameKind::kWelcome, wide_number(vector.at("session")), payload).kind,
        wire::ChannelEvent::Kind::kNothing);
    EXPECT_EQ(client.dropped_as(), vector.at("drop"));
    EXPECT_FALSE(client.channel().is_ready());
  });
}

TEST(BindRequestVectors, AreReadOrRefused) {
  for_each_payload("bind-request.json", "good", [](const Json& vector, const Bytes& payload) {
    const auto request = wire::decode_bind_request(payload);
    ASSERT_TRUE(request);
    EXPECT_EQ(request->path, vector.at("path"));
    EXPECT_EQ(request->interface, vector.at("interface"));
    EXPECT_EQ(request->fingerprint, wide_number(vector.at("fingerprint")));
    Bytes again(payload.size());
    EXPECT_EQ(encode(*request, again), payload.size());
    EXPECT_EQ(again, payload);
  });
  for_each_payload("bind-request.json", "bad", [](const Json& vector, const Bytes& payload) {
    EXPECT_FALSE(wire::decode_bind_request(payload));
    EXPECT_EQ(vector.at("status"), "bad_request");
  });
}

TEST(BindReplyVectors, AreDecodedOrRejected) {
  for_each_payload("bind-reply.json", "good", [](const Json& vector, const Bytes& payload) {
    const auto reply = wire::decode_bind_reply(payload);
    ASSERT_TRUE(reply);
    EXPECT_EQ(reply->service, vector.at("service"));
    EXPECT_EQ(reply->priority.value(), vector.at("priority"));
    EXPECT_EQ(reply->is_server_declared, vector.at("is_server_declared"));
    EXPECT_EQ(reply->is_method_list_complete, vector.at("is_method_list_complete"));
    EXPECT_EQ(reply->fingerprint, wide_number(vector.at("fingerprint")));
    const Json& methods = vector.at("methods");
    ASSERT_EQ(reply->method_count, methods.size());
    for (std::uint16_t i = 0; i < reply->method_count; ++i) {
      EXPECT_EQ(wire::method_entry(payload, i).id, methods[i].at("id"));
      EXPECT_EQ(wire::method_entry(payload, i).fingerprint, methods[i].at("fingerprint"));
    }
  });
  for_each_payload("bind-reply.json", "bad", [](const Json& vector, const Bytes& payload) {
    EXPECT_FALSE(wire::decode_bind_reply(payload));
    EXPECT_FALSE(vector.at("is_taken"));
  });
}

TEST(UrlVectors, AreParsedOrRejected) {
  const Json vectors = read_vectors("urls.json");
  for (const Json& vector : vectors.at("good")) {
    const auto url = wire::parse_url(vector.at("text").get<std::string>());
    ASSERT_TRUE(url) << vector;
    EXPECT_EQ(Json(url->hosts), vector.at("hosts"));
    EXPECT_EQ(url->port, vector.at("port"));
    EXPECT_EQ(url->path, vector.at("path"));
    EXPECT_EQ(url->text(), vector.at("text"));
  }
  for (const Json& text : vectors.at("bad")) {
    EXPECT_FALSE(wire::parse_url(text.get<std::string>())) << text;
  }
}

// hp-4.1-7
TEST(ClockDomainVectors, AreDerivedFromBootAndTimeNamespace) {
  const Json vectors = read_vectors("clock-domain.json").at("vectors");
  EXPECT_FALSE(vectors.empty());
  for (const Json& vector : vectors) {
    EXPECT_EQ(rt::clock_domain_of(vector.at("boot_id").get<std::string>(),
                                  vector.at("time_namespace").get<std::string>()),
              wide_number(vector.at("clock_domain")))
        << vector.at("name");
  }
}

// hp-12.2-1, hp-12.2-2, hp-6.3-2
TEST(VersionVectors, AreCompatibleOrNot) {
  const Json pairs = read_vectors("versions.json").at("pairs");
  EXPECT_GT(pairs.size(), 80u);
  for (const Json& pair : pairs) {
    const auto obstacle = wire::find_obstacle(pair.at("client").get<std::string>(),
                                              pair.at("server").get<std::string>());
    EXPECT_EQ(!obstacle, pair.at("is_understood"))
        << pair.at("name") << ": " << obstacle.value_or("nothing differs");
  }
}

}  // namespace
}  // namespace rtpm::spec
