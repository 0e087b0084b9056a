#include <gtest/gtest.h>
#include <signal.h>

#include <fstream>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "fixture.hpp"
#include "rtpm/base/bytes.hpp"

// Hostile clients of rtpm-console: whatever they do, another client is served as before.
namespace rtpm::system_test {
namespace {

class HostileClients : public ConsoleSystem {
 protected:
  void TearDown() override {
    if (console_) expect_service();
    ConsoleSystem::TearDown();
  }

  /// A well-behaved client gets the state.
  void expect_service() const {
    const auto client = connect();
    ASSERT_TRUE(client->web().is_accepted()) << client->web().answer();
    client->subscribe("console/state");
    EXPECT_TRUE(client->next_message("console/state").json().is_object());
  }
  /// The code with which the console closes.
  [[nodiscard]] static int close_code_of(WebClient& client) {
    while (const auto frame = client.next(kPatience)) {
      if (frame->close_code() != 0) return frame->close_code();
    }
    return 0;
  }
};

TEST_F(HostileClients, AreRefusedFromOtherOriginsAndHosts) {
  const std::uint16_t port = console_->port;
  for (const std::string headers : {"Origin: http://evil.com\r\n", "Origin: null\r\n",
                                    "Host: evil.com\r\n", "Host: 127.0.0.1:x\r\n"}) {
    const WebClient client(port, {.target = console_->target, .headers = headers});
    EXPECT_EQ(status_of(client.answer()), "403") << headers;
    EXPECT_EQ(status_of(http(port, "GET /health HTTP/1.1", headers)), "403") << headers;
  }
  const WebClient own(port,
                      {.target = console_->target,
                       .headers = "Origin: http://127.0.0.1:" + std::to_string(port) + "\r\n"});
  EXPECT_TRUE(own.is_accepted()) << own.answer();
}

TEST_F(HostileClients, AreRefusedWithoutASubprotocol) {
  for (const std::string subprotocol : {"", "mqtt", "foxglove.sdk.v2"}) {
    const WebClient client(console_->port, {.subprotocol = subprotocol});
    EXPECT_EQ(status_of(client.answer()), "400") << subprotocol;
  }
  const WebClient older(console_->port, {.subprotocol = "foxglove.websocket.v1"});
  expect_text(older.answer(), {"Sec-WebSocket-Protocol: foxglove.websocket.v1"});
}

TEST_F(HostileClients, CannotReadFilesElsewhere) {
  std::ofstream(folder_ + "/page/index.html") << "<html>";
  std::ofstream(folder_ + "/secret.txt") << "secret";
  for (const std::string path :
       {"/../secret.txt", "/%2e%2e/secret.txt", "/..%2fsecret.txt", "/x/../../secret.txt",
        "/%2e%2e%2f%2e%2e%2fetc/passwd", "//etc/passwd", "/..\\secret.txt"}) {
    const std::string answer = http(console_->port, "GET " + path + " HTTP/1.1", "");
    EXPECT_EQ(status_of(answer), "404") << path;
    EXPECT_EQ(answer.find("secret\n"), std::string::npos) << path;
  }
  EXPECT_EQ(status_of(http(console_->port, "GET /%00 HTTP/1.1", "")), "400");
  EXPECT_EQ(status_of(http(console_->port, "POST / HTTP/1.1", "Content-Length: 0\r\n")), "405");
}

TEST_F(HostileClients, AreClosedIfTheyDoNotSpeakHttp) {
  for (const std::string& bytes :
       {std::string("\x16\x03\x01\x02garbage\r\n\r\n"), std::string("GET\r\n\r\n"),
        std::string(std::size_t{70'000}, 'A')}) {
    Socket socket(console_->port);
    socket.send(bytes);
    EXPECT_TRUE(socket.is_closed_within(kPatience));
  }
}

// Slowloris: a byte now and then does not keep a socket.
TEST_F(HostileClients, AreClosedIfTheySendSlowly) {
  Socket socket(console_->port);
  socket.send("GET / HTTP/1.1\r\n");
  bool is_closed = false;
  for (int i = 0; i < 200 && !is_closed; ++i) {
    is_closed = !socket.send("X") || socket.is_closed_within(std::chrono::milliseconds{100});
  }
  EXPECT_TRUE(is_closed);
}

// The console serves 128 HTTP requests and 64 clients without the token, and drops the oldest.
TEST_F(HostileClients, AreHeldToTheLimitOfConnections) {
  std::vector<Socket> sockets;
  for (int i = 0; i < 200; ++i)
    sockets.emplace_back(console_->port);
  for (std::size_t i = 0; i < 200 - 128; ++i)
    EXPECT_TRUE(sockets[i].is_closed_within(kPatience)) << i;
  EXPECT_FALSE(sockets.back().is_closed_within(std::chrono::milliseconds{1}));
  // The idle connections are closed soon.
  for (Socket& socket : sockets)
    EXPECT_TRUE(socket.is_closed_within(kPatience));
}

TEST_F(HostileClients, AreEvictedOldestFirstWithoutTheToken) {
  std::vector<std::unique_ptr<WebClient>> observers;
  for (int i = 0; i < 65; ++i)
    observers.push_back(std::make_unique<WebClient>(console_->port, WebClient::Options{}));
  EXPECT_TRUE(observers.back()->is_accepted());
  EXPECT_EQ(close_code_of(*observers.front()), 1013);
  const auto watcher = connect();
  watcher->subscribe("console/state");
  const Json state =
      watcher->await_state([](const Json& one) { return one["clients"]["count"] == 65; });
  EXPECT_EQ(state["clients"]["count"], 65);
}

TEST_F(HostileClients, AreClosedAfterAHugeFrame) {
  WebClient observer(console_->port, {});
  observer.send_text(std::string((std::size_t{64} << 10) + 1, ' '));
  EXPECT_EQ(close_code_of(observer), 1009);
  WebClient client(console_->port, {.target = console_->target});
  ASSERT_TRUE(client.is_accepted());
  client.send_text(std::string((std::size_t{1} << 20) + 1, ' '));
  EXPECT_EQ(close_code_of(client), 1009);
  // The frame claims a length that it does not have.
  WebClient liar(console_->port, {.target = console_->target});
  liar.socket().send(std::string("\x82\xff\x7f\xff\xff\xff\xff\xff\xff\xff\0\0\0\0", 14));
  EXPECT_NE(close_code_of(liar), 0);
  // A request just below the limit is answered.
  WebClient large(console_->port, {.target = console_->target});
  large.send_text(R"({"op":"getParameters","parameterNames":[],"id":"x","pad":")" +
                  std::string(std::size_t{1'000'000}, 'x') + "\"}");
  bool is_answered = false;
  while (!is_answered) {
    const auto frame = large.next(kPatience);
    ASSERT_TRUE(frame && frame->opcode != 8);
    is_answered = frame->payload.find("parameterValues") != std::string::npos;
  }
}

TEST_F(HostileClients, AreClosedAfterTenFramesOfGarbage) {
  WebClient client(console_->port, {.target = console_->target});
  for (int i = 0; i < 9; ++i)
    client.send_text("{garbage");
  // One valid frame in between restarts the count.
  client.send_text(R"({"op":"subscribeConnectionGraph"})");
  for (int i = 0; i < 5; ++i)
    client.send_binary("\x09");
  for (int i = 0; i < 5; ++i)
    client.send_text(R"({"op":"dance"})");
  std::size_t told_count = 0;
  int code = 0;
  while (code == 0) {
    const auto frame = client.next(kPatience);
    ASSERT_TRUE(frame);
    told_count += frame->payload.find(R"("level":2)") != std::string::npos ? 1U : 0U;
    code = frame->close_code();
  }
  EXPECT_EQ(code, 1002);
  EXPECT_EQ(told_count, 18u);
}

TEST_F(HostileClients, AreClosedAfterAProtocolViolation) {
  for (const std::string& frame :
       {std::string("\x81\x02hi", 4), std::string("\xf1\x80\0\0\0\0", 6),
        std::string("\x83\x80\0\0\0\0", 6), std::string("\x81\x82\0\0\0\0\xff\xfe", 8)}) {
    WebClient client(console_->port, {.target = console_->target});
    client.socket().send(frame);
    EXPECT_NE(close_code_of(client), 0);
  }
}

TEST_F(HostileClients, GetAnErrorForWrongIds) {
  const auto client = connect();
  ASSERT_TRUE(client->await_channel("console/state"));
  const Json id = client->channels().at("console/state")["id"];
  const auto subscribe = [&](const Json& subscription, const Json& channel) {
    client->send(
        {{"op", "subscribe"},
         {"subscriptions", Json::array({{{"id", subscription}, {"channelId", channel}}})}});
  };
  subscribe(1, id);
  subscribe(1, client->channels().at("console/log")["id"]);  // The id is in use.
  subscribe(2, id);                                          // This channel is subscribed twice.
  subscribe(3, 4'000'000);                                   // There is no such channel.
  client->send({{"op", "unsubscribe"}, {"subscriptionIds", {77}}});
  client->send({{"op", "advertise"}, {"channels", Json::array()}});
  EXPECT_TRUE(client->read_until([&] { return client->statuses().size() >= 5; }));
  client->web().send_binary(std::string("\x02\xff\xff\xff\xff\x01\0\0\0\4\0\0\0json{}", 19));
  client->web().send_binary(std::string("\x02\x01\0\0\0\x01\0\0\0\3\0\0\0cdr", 16));
}

TEST_F(HostileClients, GetAnErrorForGarbageInCalls) {
  const auto client = connect();
  ASSERT_TRUE(client->await_service("lab/arm0/set_models"));
  ASSERT_TRUE(client->await_service("lab/arm0/config/list"));
  std::mt19937 random(11);
  const std::vector<std::string> methods{"command",    "set_models",   "read_flight_record",
                                         "renew",      "config/apply", "config/get",
                                         "config/list"};
  for (int i = 0; i < 200; ++i) {
    const std::string& method = methods[random() % methods.size()];
    const Json service = client->services().at("lab/arm0/" + method);
    const bool is_json = random() % 2 == 0;
    const std::string encoding = is_json ? "json" : "flatbuffer";
    std::string frame("\x02", 1);
    const auto put = [&](std::uint32_t number) {
      for (int shift = 0; shift < 32; shift += 8)
        frame += static_cast<char>(number >> shift & 0xff);
    };
    put(service["id"].get<std::uint32_t>());
    put(static_cast<std::uint32_t>(10'000 + i));
    put(static_cast<std::uint32_t>(encoding.size()));
    frame += encoding;
    for (std::size_t size = random() % 300; size > 0; --size)
      frame += is_json ? "{}[]\":,0123xlease"[random() % 16] : static_cast<char>(random());
    client->web().send_binary(frame);
  }
  for (const std::string request : {"table Evil { x:int; } {}", "{} table Evil { x:int; }",
                                    "include \"x.fbs\"; {}", "[]", "{"}) {
    EXPECT_FALSE(client->call_text("lab/arm0/config/get", request));
  }
  // Calls above the limit of open ones are refused for a while.
  Json described;
  do {
    described = client->call("lab/arm0/describe", Json::object());
  } while (described.value("failure", "").starts_with("too many calls"));
  EXPECT_EQ(described["serial"], "sim-arm0") << described;
}

// A client may have a limited number of calls under way; more are refused, not queued.
TEST_F(HostileClients, AreRefusedCallsBeyondTheLimit) {
  const auto client = connect();
  ASSERT_TRUE(client->await_service("lab/arm0/describe"));
  devices_->process.stop();
  const auto id = client->services().at("lab/arm0/describe")["id"].get<std::uint32_t>();
  for (std::uint32_t call = 1000; call < 1100; ++call) {
    std::string frame(19, '\0');
    ByteWriter writer(std::as_writable_bytes(std::span(frame)));
    writer.put(std::uint8_t{2});
    writer.put(id);
    writer.put(call);
    writer.put(std::uint32_t{4});
    writer.put_bytes(std::as_bytes(std::span(std::string_view("json{}"))));
    client->web().send_binary(frame);
  }
  std::size_t refused_count = 0;
  while (refused_count < 100 - 32) {
    const auto frame = client->web().next(kPatience);
    ASSERT_TRUE(frame) << refused_count;
    refused_count += frame->payload.find("too many calls") != std::string::npos ? 1U : 0U;
  }
  // A stop does not count among these calls: it is tried, however many are open.
  EXPECT_TRUE(client->call("console/estop", Json::object()).contains("failed"));
  // Other clients are not delayed.
  const auto other = connect();
  EXPECT_TRUE(other->call("console/recordings", Json::object()).contains("files"));
  devices_->process.send_signal(SIGCONT);
}

TEST_F(HostileClients, LoseOnlyDataIfTheyDoNotRead) {
  const auto watcher = connect();
  watcher->subscribe("console/state");
  ASSERT_TRUE(watcher->await_channel("lab/arm0/sample"));
  std::vector<std::unique_ptr<ConsoleClient>> deaf;
  for (int i = 0; i < 10; ++i) {
    deaf.push_back(connect());
    for (const char* topic : {"console/state", "lab/arm0/sample", "console/latency"})
      deaf.back()->subscribe(topic);
  }
  // These clients do not answer pings, so the console disconnects them in the end.
  const Json state =
      watcher->await_state([](const Json& one) { return one["clients"]["count"] == 1; });
  EXPECT_EQ(is_live(state, "lab/arm0"), true);
}

TEST_F(HostileClients, AreRemovedWhenTheyVanish) {
  const auto watcher = connect();
  watcher->subscribe("console/state");
  for (int i = 0; i < 30; ++i) {
    const auto client = connect();
    client->subscribe("console/state");
  }
  const Json state =
      watcher->await_state([](const Json& one) { return one["clients"]["count"] == 1; });
  EXPECT_EQ(state["clients"]["count"], 1);
}

}  // namespace
}  // namespace rtpm::system_test
