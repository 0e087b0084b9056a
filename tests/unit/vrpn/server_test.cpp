#include "server.hpp"

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <map>
#include <string>

#include "rtpm/device_vrpn/vrpn_driver.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/test/os.hpp"
#include "served.hpp"

// The server and the driver, with each other and with peers that send anything.
namespace rtpm::vrpn {
namespace {

using test::Served;
using namespace std::chrono_literals;

sockaddr_in loopback(std::uint16_t port) {
  return {.sin_family = AF_INET,
          .sin_port = htons(port),
          .sin_addr = {.s_addr = htonl(INADDR_LOOPBACK)},
          .sin_zero = {}};
}

/// A client that keeps the payloads that it got, by type.
class Client {
 public:
  explicit Client(std::uint16_t port) : socket_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    const sockaddr_in to = loopback(port);
    EXPECT_EQ(::connect(socket_.number(), reinterpret_cast<const sockaddr*>(&to), sizeof to), 0);
  }
  explicit Client(transport::Descriptor socket) : socket_(std::move(socket)) {}

  void send(ConstBytes bytes) const {
    EXPECT_EQ(::send(socket_.number(), bytes.data(), bytes.size(), MSG_NOSIGNAL),
              static_cast<ssize_t>(bytes.size()));
  }
  void greet() const { send(cookie()); }
  /// Reads until `type` arrived `count` times; false if the server ends the connection.
  bool read_until(std::string_view type, std::size_t count) {
    std::array<std::byte, 1024> bytes{};
    while (got[std::string(type)].size() < count) {
      const ssize_t size = ::recv(socket_.number(), bytes.data(), bytes.size(), 0);
      if (size <= 0) return false;
      ConstBytes rest = ConstBytes(bytes).first(static_cast<std::size_t>(size));
      if (skipped_ < kCookieSize) {
        const std::size_t skip = std::min(rest.size(), kCookieSize - skipped_);
        skipped_ += skip;
        rest = rest.subspan(skip);
      }
      parser_.push(rest);
      while (const auto message = parser_.next())
        take(*message);
    }
    return true;
  }
  std::map<std::string, std::vector<Payload>> got;
  std::map<std::int32_t, std::string> senders;
  std::map<std::int32_t, std::string> types;

 private:
  void take(const Message& message) {
    if (message.type == kSenderDescription) senders[message.sender] = *read_name(message.payload);
    if (message.type == kTypeDescription) types[message.sender] = *read_name(message.payload);
    if (message.type >= 0) {
      got[types.at(message.type)].emplace_back(message.payload.begin(), message.payload.end());
    }
  }

  transport::Descriptor socket_;
  std::size_t skipped_ = 0;
  Parser parser_{};
};

TEST(VrpnServer, ServesPosesAnalogsAndForces) {
  Served served;
  Client client(served.port());
  client.greet();
  ASSERT_TRUE(client.read_until(kForceType, 2));
  EXPECT_EQ(client.senders.at(0), "Arm0");
  const driver::Sample sample = test::full_sample();
  EXPECT_EQ(client.got[std::string(kPoseType)].at(0), pose_payload(0, sample.pose));
  EXPECT_EQ(client.got[std::string(kAnalogType)].at(0),
            analog_payload(std::span(sample.analogs).first(2)));
  EXPECT_EQ(client.got[std::string(kForceType)].at(0),
            force_payload(sample.wrench_applied.force_newton));
}

TEST(VrpnServer, SendsEachChangeOfAButton) {
  Served served;
  Client client(served.port());
  client.greet();
  const std::string type(kButtonType);
  ASSERT_TRUE(client.read_until(type, 2)) << "the state of both buttons comes first";
  driver::Sample sample = test::full_sample();
  sample.button_edges = {2, 3};  // A click between two samples; and a click and a press.
  sample.buttons = 2;
  served.set(sample);
  ASSERT_TRUE(client.read_until(type, 7));
  const std::vector<Payload> changes(client.got[type].begin() + 2, client.got[type].end());
  EXPECT_EQ(changes, (std::vector<Payload>{button_payload(0, true), button_payload(0, false),
                                           button_payload(1, true), button_payload(1, false),
                                           button_payload(1, true)}));
}

TEST(VrpnServer, AnswersPings) {
  Served served;
  Client client(served.port());
  client.greet();
  std::vector<std::byte> bytes;
  const Payload device = name_payload("Arm0");
  const Payload type = name_payload(kPingType);
  // The client has numbers of its own.
  append(bytes, {.sender = 40, .type = kSenderDescription, .payload = device}, 0);
  append(bytes, {.sender = 50, .type = kTypeDescription, .payload = type}, 1);
  append(bytes, {.sender = 40, .type = 50}, 2);
  client.send(bytes);
  EXPECT_TRUE(client.read_until(kPongType, 1));
}

TEST(VrpnServer, ConnectsToAClientThatAsksByADatagram) {
  Served served;
  const transport::Descriptor listening(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
  sockaddr_in at = loopback(0);
  socklen_t size = sizeof at;
  auto* const address = reinterpret_cast<sockaddr*>(&at);
  ASSERT_EQ(::bind(listening.number(), address, size), 0);
  ASSERT_EQ(::listen(listening.number(), 1), 0);
  ::getsockname(listening.number(), address, &size);
  const transport::Descriptor udp(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  const sockaddr_in to = loopback(served.port());
  // Another address in the text has no effect: nobody makes the server call a third party.
  const std::string text = "192.0.2.1 " + std::to_string(ntohs(at.sin_port));
  ASSERT_GT(::sendto(udp.number(), text.c_str(), text.size() + 1, 0,
                     reinterpret_cast<const sockaddr*>(&to), sizeof to),
            0);
  Client client(transport::Descriptor(::accept(listening.number(), nullptr, nullptr)));
  client.greet();
  EXPECT_TRUE(client.read_until(kPoseType, 1));
}

TEST(VrpnServer, ClosesConnectionsOfOtherProtocols) {
  Served served;
  for (const std::string& text :
       {std::string("GET / HTTP/1.1\r\nHost: x\r\n\r\n"), std::string(64, '\0')}) {
    Client client(served.port());
    client.send(std::as_bytes(std::span(text)));
    EXPECT_FALSE(client.read_until(kPoseType, 1));
  }
  Client client(served.port());
  client.greet();
  client.send(std::array<std::byte, 32>{});  // A message of length 0.
  EXPECT_FALSE(client.read_until(kPoseType, 1'000'000));
  EXPECT_EQ(served.counters().closed_count, 3u);
}

TEST(VrpnServer, DropsReportsOfAClientThatReadsNothing) {
  auto server = Server::create({.port = 0, .devices = {test::full_device()}});
  ASSERT_TRUE(server);
  const Client sleeper(server->port());
  sleeper.greet();
  // First the system's own buffers fill.
  for (int i = 0; i < 1'000'000 && server->counters().dropped_count == 0; ++i) {
    server->poll();
    server->publish(0, test::full_sample(), 1);
  }
  EXPECT_GT(server->counters().dropped_count, 0u);
  Client other(server->port());
  other.greet();
  ASSERT_TRUE(rtpm::test::await([&] {
    server->poll();
    return server->client_count() == 2;
  }));
  server->poll();
  server->publish(0, test::full_sample(), 1);
  server->poll();
  EXPECT_TRUE(other.read_until(kPoseType, 1));
}

TEST(VrpnServer, RefusesConnectionsBeyondItsLimit) {
  Served served;
  std::vector<std::unique_ptr<Client>> clients;
  for (std::size_t i = 0; i < Server::kConnectionCountMax + 2; ++i)
    clients.push_back(std::make_unique<Client>(served.port()));
  EXPECT_TRUE(rtpm::test::await([&] { return served.counters().refused_count == 2; }));
  EXPECT_EQ(served.client_count(), Server::kConnectionCountMax);
}

TEST(VrpnServer, NamesWhatItCantListenAt) {
  const auto nowhere = Server::create({.host = "nowhere"});
  ASSERT_FALSE(nowhere);
  EXPECT_NE(nowhere.error().text().find("no numeric address"), std::string::npos);
  Served served;
  const auto twice = Server::create({.port = served.port()});
  ASSERT_FALSE(twice);
  EXPECT_NE(twice.error().text().find(std::to_string(served.port())), std::string::npos);
}

TEST(VrpnDriver, TakesATrackersPoses) {
  Served served;
  device_vrpn::VrpnDriver driver({.port = served.port(), .tracker = "Arm0"}, "s", "f");
  ASSERT_TRUE(driver.configure({.period = 10ms}));
  ASSERT_TRUE(driver.activate());
  driver::Command command;
  driver::Sample sample;
  command.cycle_time = rt::now();
  ASSERT_EQ(driver.exchange(command, sample), driver::ExchangeStatus::kOk);
  EXPECT_EQ(sample.pose.position_m, test::full_sample().pose.position_m);
  EXPECT_DOUBLE_EQ(sample.pose.orientation.z, 0.6);
  driver::Sample moved = test::full_sample();
  moved.pose.position_m.x = 1;
  served.set(moved);
  EXPECT_TRUE(rtpm::test::await([&] {
    command.cycle_time = rt::now();
    static_cast<void>(driver.exchange(command, sample));
    return sample.pose.position_m.x == 1;
  }));
  // VRPN fell silent.
  command.cycle_time += 1s;
  EXPECT_EQ(driver.exchange(command, sample), driver::ExchangeStatus::kLate);
  command.cycle_time += 2s;
  EXPECT_EQ(driver.exchange(command, sample), driver::ExchangeStatus::kGone);
  driver.deactivate();
  EXPECT_EQ(driver.exchange(command, sample), driver::ExchangeStatus::kGone);
}

TEST(VrpnDriver, SaysWhyItHasNoTracker) {
  Served served;
  device_vrpn::VrpnDriver other({.port = served.port(), .tracker = "Arm1"}, "s", "f");
  const auto refused = other.configure({.period = 10ms});
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().text().find("Arm1"), std::string::npos) << refused.error().text();
  device_vrpn::VrpnDriver none({.port = 1}, "s", "f");
  const auto gone = none.configure({.period = 10ms});
  ASSERT_FALSE(gone);
  EXPECT_NE(gone.error().text().find("Connection refused"), std::string::npos);
  EXPECT_FALSE(device_vrpn::read_settings("port=0"));
  EXPECT_FALSE(device_vrpn::read_settings("sensor=-1"));
  EXPECT_FALSE(device_vrpn::read_settings("colour=red"));
  const auto read = device_vrpn::read_settings("host=10.0.0.3 tracker=Head sensor=2");
  ASSERT_TRUE(read);
  EXPECT_EQ(read->port, kPort);
  EXPECT_EQ(read->sensor, 2);
}

}  // namespace
}  // namespace rtpm::vrpn
