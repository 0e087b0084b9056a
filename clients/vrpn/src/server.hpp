#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <list>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/driver/descriptor.hpp"
#include "rtpm/driver/sample.hpp"
#include "rtpm/transport/socket.hpp"
#include "rtpm/vrpn/message.hpp"
#include "rtpm/vrpn/payload.hpp"

namespace rtpm::vrpn {

struct ServedDevice {
  std::string name;  ///< Clients ask for NAME@host.
  driver::Descriptor descriptor{};
};

struct ServerConfig {
  std::string host = "127.0.0.1";  ///< A numeric address.
  std::uint16_t port = kPort;      ///< 0: the system chooses.
  std::vector<ServedDevice> devices{};
};

struct ServerCounters {
  std::uint64_t connection_count = 0;  ///< Accepted so far.
  std::uint64_t refused_count = 0;     ///< Beyond kConnectionCountMax.
  std::uint64_t dropped_count = 0;     ///< Reports that a slow client did not get.
  std::uint64_t closed_count = 0;  ///< Connections closed for what the peer sent, or did not read.
};

/// A server of VRPN: devices as Tracker, Button, Analog and ForceDevice. Never waits for a client,
/// and takes no command from one.
/// @threads  one at a time
/// @realtime none
class Server {
 public:
  static constexpr std::size_t kConnectionCountMax = 32;
  /// A client that reads so little gets no poses, analogs and forces until it has read.
  static constexpr std::size_t kBacklogSizeMax = 64 * 1024;
  /// At so much, which only button changes reach, the connection is closed.
  static constexpr std::size_t kUnreadSizeMax = 256 * 1024;

  /// Listens on TCP and UDP.
  /// @errors the address is not numeric, or can't be used
  [[nodiscard]] static expected<Server, SetupError> create(ServerConfig config);

  /// Sends the device's sample to all clients; of its buttons each change since the last sample.
  /// @param time_us  of the sample, since 1970
  void publish(std::size_t device, const driver::Sample& sample, std::int64_t time_us);
  /// Accepts, reads and writes whatever can be without waiting.
  void poll();

  [[nodiscard]] std::uint16_t port() const noexcept { return port_; }
  [[nodiscard]] std::size_t client_count() const noexcept { return connections_.size(); }
  [[nodiscard]] const ServerCounters& counters() const noexcept { return counters_; }

 private:
  struct Connection {
    transport::Descriptor socket;
    std::vector<std::byte> unread_cookie{};
    bool is_greeted = false;  ///< The peer's cookie has arrived.
    Parser parser{};
    std::vector<std::byte> out{};
    std::uint32_t message_count = 0;
    std::map<std::int32_t, std::string> senders{};  ///< The peer's.
    std::map<std::int32_t, std::string> types{};
    bool is_closed = false;
  };
  struct Buttons {
    bool is_known = false;
    std::uint32_t pressed = 0;
    std::array<std::uint16_t, driver::kButtonCountMax> edges{};
  };

  explicit Server(ServerConfig config) : config_(std::move(config)) {}
  [[nodiscard]] expected<void, SetupError> listen();
  void accept();
  /// Connects to each client that asks by a datagram, at the datagram's own address.
  void answer_datagrams();
  void add(transport::Descriptor socket);
  void greet(Connection& connection);
  void read(Connection& connection);
  void take(Connection& connection, ConstBytes bytes);
  void take(Connection& connection, const Message& message);
  void write(Connection& connection);
  void send(Connection& connection, std::int32_t sender, std::string_view type,
            std::int64_t time_us, const Payload& payload);
  /// Sends to all; leaves out slow clients if the report `may_be_dropped`.
  void send_all(std::size_t device, std::string_view type, std::int64_t time_us,
                const Payload& payload, bool may_be_dropped);
  void publish_buttons(std::size_t device, const driver::Sample& sample, std::int64_t time_us);
  void close(Connection& connection);

  ServerConfig config_;
  transport::Descriptor tcp_{};
  transport::Descriptor udp_{};
  std::uint16_t port_ = 0;
  std::list<Connection> connections_{};
  std::map<std::size_t, Buttons> buttons_{};  ///< By device.
  ServerCounters counters_{};
};

}  // namespace rtpm::vrpn
