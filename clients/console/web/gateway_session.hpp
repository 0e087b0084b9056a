#pragma once

#include <array>
#include <boost/asio/buffer.hpp>
#include <boost/asio/write.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>
#include <chrono>
#include <memory>
#include <set>
#include <string>
#include <utility>

#include "web/gateway.hpp"
#include "web/places.hpp"
#include "web/server.hpp"

/// A part of web/server.cpp.
namespace rtpm::console {

class GatewaySession;

/// All connections of pages to servers.
struct GatewayTable {
  PlaceTable places{kGatewayCountMax};
  std::set<GatewaySession*> sessions{};
};

/// A page's connection to a server of the registry. It passes bytes on, one message or block at a
/// time in each direction, so that a side that does not read holds up the other one, and nothing
/// queues here.
class GatewaySession final : public std::enable_shared_from_this<GatewaySession> {
 public:
  /// @param kept  lives as long as this
  GatewaySession(GatewayTable& table, std::string peer, boost::beast::tcp_stream page,
                 boost::beast::tcp_stream target, std::shared_ptr<void> kept)
      : table_(table),
        place_(table.places, std::move(peer), [this] { drop(); }),
        page_(std::move(page)),
        target_(std::move(target)),
        kept_(std::move(kept)) {
    table_.sessions.insert(this);
  }
  GatewaySession(const GatewaySession&) = delete;
  GatewaySession& operator=(const GatewaySession&) = delete;
  ~GatewaySession() { table_.sessions.erase(this); }

  void start(const boost::beast::http::request<boost::beast::http::string_body>& request) {
    boost::beast::get_lowest_layer(page_).expires_never();
    boost::beast::websocket::stream_base::timeout timeout{};
    timeout.handshake_timeout = kSilenceMax;
    timeout.idle_timeout = kSilenceMax;
    timeout.keep_alive_pings = true;
    page_.set_option(timeout);
    page_.set_option(boost::beast::websocket::stream_base::decorator(
        [](boost::beast::websocket::response_type& response) {
          response.set(boost::beast::http::field::sec_websocket_protocol,
                       std::string(kGatewaySubprotocol));
          response.set(boost::beast::http::field::server, "rtpm-console");
        }));
    page_.read_message_max(kGatewayMessageSizeMax);
    page_.auto_fragment(false);
    page_.binary(true);
    page_.async_accept(request, [self = shared_from_this()](boost::system::error_code error) {
      if (error) return self->drop();
      self->take_from_page();
      self->take_from_target();
    });
  }

  /// Ends both connections without a word.
  void drop() {
    boost::beast::get_lowest_layer(page_).close();
    target_.close();
  }

 private:
  void take_from_page() {
    page_.async_read(from_page_,
                     [self = shared_from_this()](boost::system::error_code error, std::size_t) {
                       if (error || self->page_.got_text()) return self->drop();
                       self->pass_to_target();
                     });
  }

  void pass_to_target() {
    target_.expires_after(kPassTime);
    boost::asio::async_write(
        target_, from_page_.cdata(),
        [self = shared_from_this()](boost::system::error_code error, std::size_t) {
          if (error) return self->drop();
          self->target_.expires_never();
          self->from_page_.consume(self->from_page_.size());
          self->take_from_page();
        });
  }

  void take_from_target() {
    target_.socket().async_read_some(
        boost::asio::buffer(block_),
        [self = shared_from_this()](boost::system::error_code error, std::size_t size) {
          if (error) return self->leave();
          self->pass_to_page(size);
        });
  }

  void pass_to_page(std::size_t size) {
    page_.async_write(boost::asio::buffer(block_.data(), size),
                      [self = shared_from_this()](boost::system::error_code error, std::size_t) {
                        if (error) return self->drop();
                        self->take_from_target();
                      });
  }

  /// The server has ended the connection.
  void leave() {
    target_.close();
    page_.async_close(boost::beast::websocket::close_code::going_away,
                      [self = shared_from_this()](boost::system::error_code) { self->drop(); });
  }

  /// A page that is silent for so long is disconnected, after a ping.
  static constexpr auto kSilenceMax = std::chrono::seconds{5};
  /// How long a server may take for a page's message.
  static constexpr auto kPassTime = std::chrono::seconds{10};

  GatewayTable& table_;
  Place place_;
  boost::beast::websocket::stream<boost::beast::tcp_stream> page_;
  boost::beast::tcp_stream target_;
  std::shared_ptr<void> kept_;
  boost::beast::flat_buffer from_page_{kGatewayMessageSizeMax};
  std::array<char, kGatewayBlockSize> block_{};
};

}  // namespace rtpm::console
