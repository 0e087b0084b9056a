#include "web/server.hpp"

#include <algorithm>
#include <boost/asio/connect.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/write.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>
#include <chrono>
#include <fstream>
#include <iterator>
#include <optional>
#include <set>
#include <utility>

#include "foxglove/replies.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/rt/clock.hpp"
#include "web/frame_budget.hpp"
#include "web/gateway_session.hpp"
#include "web/places.hpp"
#include "web/request_rules.hpp"
#include "web/token.hpp"
#include "work/worker_pool.hpp"

namespace rtpm::console {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
namespace websocket = beast::websocket;
using asio::ip::tcp;
using beast::error_code;

/// The time limit for reading a request's header, and for writing a response.
constexpr auto kRequestTime = std::chrono::seconds{5};
constexpr auto kResponseTime = std::chrono::seconds{20};
/// A client is pinged after half of this time in silence, and disconnected after all of it: an
/// operator who is gone holds no lease for longer than OperatorDesk::kGoneMax.
constexpr auto kSilenceMax = std::chrono::seconds{5};
constexpr auto kHandshakeTime = std::chrono::seconds{5};
constexpr auto kAcceptRetry = std::chrono::milliseconds{100};
constexpr auto kEndTime = std::chrono::milliseconds{500};
/// How long a client may take for a block of a download.
constexpr auto kBlockTime = std::chrono::seconds{60};
constexpr std::size_t kBlockSize = std::size_t{256} << 10;
/// How long a server of the registry may take to accept a connection.
constexpr auto kConnectTime = std::chrono::seconds{2};
constexpr std::string_view kDownloadPath = "/download/";
constexpr std::uint32_t kHeaderSizeMax = 8 * 1024;
constexpr std::uint64_t kBodySizeMax = 1024;
constexpr std::uintmax_t kFileSizeMax = std::uintmax_t{64} << 20;
/// Enough for a burst that outruns the accepting thread; the system has its own limit.
constexpr int kBacklog = 4096;
/// The most displaced clients that have not answered the close frame yet.
constexpr std::size_t kLeavingCountMax = 32;
/// The most data queued for a client without the token.
constexpr std::size_t kObserverDataByteMax = std::size_t{1} << 20;

std::string text_of(beast::string_view view) {
  return {view.data(), view.size()};
}

/// The key of a peer: all loopback addresses count as one, as does an IPv6 network, because a host
/// may use any number of its addresses.
std::string peer_of(const tcp::socket& socket) {
  error_code error;
  const tcp::endpoint endpoint = socket.remote_endpoint(error);
  if (error) return {};
  asio::ip::address address = endpoint.address();
  if (address.is_v6() && address.to_v6().is_v4_mapped()) {
    address = asio::ip::make_address_v4(asio::ip::v4_mapped, address.to_v6());
  }
  if (address.is_loopback()) return "loopback";
  if (address.is_v4()) return address.to_string();
  asio::ip::address_v6::bytes_type bytes = address.to_v6().to_bytes();
  std::fill(bytes.begin() + bytes.size() / 2, bytes.end(), std::uint8_t{0});
  return asio::ip::address_v6(bytes).to_string();
}

}  // namespace

class HttpSession;
class WebSocketSession;

struct WebServer::Impl {
  Impl(WebConfig wanted, ConnectionHandler& answering, DownloadSource& offering,
       const GatewayTargets& reachable)
      : config(std::move(wanted)),
        handler(answering),
        source(offering),
        targets(reachable),
        acceptor(context),
        retry(context) {}

  expected<void, SetupError> listen();
  void accept();
  void add_session(tcp::socket socket);
  void repeat(const std::shared_ptr<asio::steady_timer>& timer, Duration period,
              const std::shared_ptr<std::function<void()>>& work);
  void end();

  WebConfig config;
  ConnectionHandler& handler;
  DownloadSource& source;
  const GatewayTargets& targets;
  // Must outlive the context, whose destructor destroys the remaining sessions and their places.
  std::size_t socket_count = 0;
  PlaceTable requests{kRequestCountMax};
  PlaceTable observers{kObserverCountMax};
  PlaceTable operators{kOperatorCountMax};
  PlaceTable leaving{kLeavingCountMax};
  PlaceTable downloads{kDownloadCountMax};
  GatewayTable gateways{};
  asio::io_context context{1};
  tcp::acceptor acceptor;
  asio::steady_timer retry;
  std::uint16_t port = 0;
  std::uint64_t last_id = 0;
  std::set<WebSocketSession*> sessions{};
  bool is_ending = false;
  /// The sessions for which `reader` reads a block.
  std::set<std::shared_ptr<HttpSession>> reading{};
  /// Reads the blocks of downloads, so that a slow disk delays no other client.
  WorkerPool reader{};
};

namespace {

/// Counts a socket while it lives.
class SocketCount {
 public:
  explicit SocketCount(std::size_t& count) noexcept : count_(&count) { ++*count_; }
  SocketCount(const SocketCount&) = delete;
  SocketCount& operator=(const SocketCount&) = delete;
  SocketCount(SocketCount&& other) noexcept : count_(std::exchange(other.count_, nullptr)) {}
  SocketCount& operator=(SocketCount&&) = delete;
  ~SocketCount() {
    if (count_ != nullptr) --*count_;
  }

 private:
  std::size_t* count_;
};

}  // namespace

/// A client after its handshake.
class WebSocketSession final : public Connection,
                               public std::enable_shared_from_this<WebSocketSession> {
 public:
  WebSocketSession(WebServer::Impl& server, beast::tcp_stream stream, SocketCount count,
                   bool has_token, bool has_wrong_token)
      : server_(server),
        peer_(peer_of(stream.socket())),
        socket_(std::move(stream)),
        next_read_(server.context),
        count_(std::move(count)),
        id_(++server.last_id),
        has_token_(has_token),
        has_wrong_token_(has_wrong_token),
        queue_(has_token ? SendQueue::kDataByteMax : kObserverDataByteMax) {
    place_.emplace(has_token ? server.operators : server.observers, peer_, [this] { give_way(); });
  }
  ~WebSocketSession() override = default;

  void start(const http::request<http::string_body>& request, std::string subprotocol) {
    beast::get_lowest_layer(socket_).expires_never();
    websocket::stream_base::timeout timeout{};
    timeout.handshake_timeout = kHandshakeTime;
    timeout.idle_timeout = kSilenceMax;
    timeout.keep_alive_pings = true;
    socket_.set_option(timeout);
    socket_.set_option(websocket::stream_base::decorator(
        [subprotocol = std::move(subprotocol)](websocket::response_type& response) {
          response.set(http::field::sec_websocket_protocol, subprotocol);
          response.set(http::field::server, "rtpm-console");
        }));
    socket_.control_callback(
        [this](websocket::frame_type, beast::string_view) { last_heard_ = rt::now(); });
    socket_.read_message_max(has_token_ ? kFrameSizeMax : kObserverFrameSizeMax);
    socket_.auto_fragment(false);
    socket_.async_accept(request, [self = shared_from_this()](error_code error) {
      if (!error) self->open();
    });
  }

  void leave() { close(CloseCode::kGoingAway, "rtpm-console ends"); }

  std::uint64_t id() const noexcept override { return id_; }
  std::string_view refusal() const noexcept override {
    if (server_.config.is_read_only) return kReadOnly;
    return has_token_ ? std::string_view() : kNoToken;
  }
  bool has_wrong_token() const noexcept override { return has_wrong_token_; }
  std::uint64_t dropped_count() const noexcept override { return queue_.dropped_count(); }

  void send_text(SharedText text) override {
    send_control({.body = std::move(text), .is_text = true});
  }
  void send_binary(SharedText bytes) override {
    send_control({.body = std::move(bytes), .is_text = false});
  }
  void send_message(std::uint32_t subscription_id, std::uint64_t log_time_ns,
                    SharedText payload) override {
    if (!is_open_) return;
    queue_.push_data(message_frame(subscription_id, log_time_ns, std::move(payload)));
    write();
  }
  void send_picture(std::uint32_t subscription_id, std::uint64_t log_time_ns, SharedText payload,
                    bool is_key) override {
    if (!is_open_) return;
    queue_.push_picture(subscription_id,
                        message_frame(subscription_id, log_time_ns, std::move(payload)), is_key);
    write();
  }
  void close(CloseCode code, std::string_view reason) override {
    if (!is_open_) return;
    end(rt::now());
    close_reason_.emplace(static_cast<websocket::close_code>(code));
    close_reason_->reason.assign(reason.data(), std::min<std::size_t>(reason.size(), 120));
    // Queued after earlier frames, which may contain the reason.
    write();
  }

 private:
  static OutgoingFrame message_frame(std::uint32_t subscription_id, std::uint64_t log_time_ns,
                                     SharedText payload) {
    OutgoingFrame frame{.head_size = foxglove::kMessageHeadSize, .body = std::move(payload)};
    const auto head = foxglove::message_head(subscription_id, log_time_ns);
    std::ranges::copy(head, frame.head.begin());
    return frame;
  }
  /// Closes a displaced client; skips the closing handshake if too many are closing.
  void give_way() {
    const auto self = shared_from_this();
    place_.emplace(server_.leaving, peer_, [this] { drop(); });
    if (!is_open_) return drop();
    close(CloseCode::kTryAgainLater, "clients without the token are too many; this was the oldest");
  }

  void drop() {
    end(rt::now());
    beast::get_lowest_layer(socket_).close();
  }

  void open() {
    is_open_ = true;
    last_heard_ = rt::now();
    server_.sessions.insert(this);
    server_.handler.on_open(*this);
    read();
  }

  /// Reports the end to the handler once, whatever its cause.
  void end(MonotonicTime since) {
    if (!is_open_) return;
    is_open_ = false;
    server_.sessions.erase(this);
    server_.handler.on_close(*this, since);
  }
  void end(error_code error) { end(error == beast::error::timeout ? last_heard_ : rt::now()); }

  void send_control(OutgoingFrame frame) {
    if (!is_open_) return;
    if (queue_.push_control(std::move(frame))) return write();
    // The client has not read for a long time, so a close frame is pointless.
    drop();
  }

  void read() {
    socket_.async_read(
        buffer_, [self = shared_from_this()](error_code error, std::size_t) { self->take(error); });
  }

  void take(error_code error) {
    if (error) return end(error);
    last_heard_ = rt::now();
    const auto data = buffer_.cdata();
    if (is_open_ && socket_.got_text()) {
      server_.handler.on_text(*this, {static_cast<const char*>(data.data()), data.size()});
    } else if (is_open_) {
      server_.handler.on_binary(*this, {static_cast<const std::byte*>(data.data()), data.size()});
    }
    const std::size_t size = buffer_.size();
    buffer_.consume(size);
    // Keeps reading after close(), until the client has answered it.
    const Duration wait = has_token_ ? Duration{0} : budget_.take(size, rt::now());
    if (wait == Duration{0}) return read();
    next_read_.expires_after(std::chrono::nanoseconds{wait});
    next_read_.async_wait([self = shared_from_this()](error_code aborted) {
      if (!aborted) self->read();
    });
  }

  void write() {
    if (is_writing_) return;
    auto next = queue_.pop();
    if (!next) {
      if (close_reason_) {
        socket_.async_close(*close_reason_, [self = shared_from_this()](error_code) {});
        close_reason_.reset();
      }
      return;
    }
    is_writing_ = true;
    sending_ = std::move(*next);
    socket_.text(sending_.is_text);
    const std::array<asio::const_buffer, 2> buffers{
        asio::const_buffer(sending_.head.data(), sending_.head_size),
        asio::const_buffer(sending_.body ? sending_.body->data() : nullptr,
                           sending_.body ? sending_.body->size() : 0)};
    socket_.async_write(buffers, [self = shared_from_this()](error_code error, std::size_t) {
      self->is_writing_ = false;
      self->sending_ = {};
      if (error) return self->end(error);
      if (self->is_open_ || self->close_reason_) self->write();
    });
  }

  WebServer::Impl& server_;
  std::string peer_;
  websocket::stream<beast::tcp_stream> socket_;
  asio::steady_timer next_read_;
  SocketCount count_;
  std::optional<Place> place_{};
  std::uint64_t id_;
  bool has_token_;
  bool has_wrong_token_;
  FrameBudget budget_{};
  MonotonicTime last_heard_{};  ///< When a frame, including an answer to a ping, last arrived.
  bool is_open_ = false;
  bool is_writing_ = false;
  std::optional<websocket::close_reason> close_reason_{};  ///< Sent once nothing else is queued.
  beast::flat_buffer buffer_{};
  SendQueue queue_;
  OutgoingFrame sending_{};
};

/// A socket that speaks HTTP, until it ends, or becomes a WebSocketSession or a GatewaySession.
class HttpSession final : public std::enable_shared_from_this<HttpSession> {
 public:
  HttpSession(WebServer::Impl& server, tcp::socket socket, SocketCount count)
      : server_(server), stream_(std::move(socket)), count_(std::move(count)) {
    place_.emplace(server.requests, peer_of(stream_.socket()), [this] { stream_.close(); });
    own_names_ = server.config.host_names;
    error_code ignored;
    const auto local = stream_.socket().local_endpoint(ignored);
    if (!ignored) own_names_.push_back(local.address().to_string());
  }

  void read() {
    parser_.emplace();
    parser_->header_limit(kHeaderSizeMax);
    parser_->body_limit(kBodySizeMax);
    // The limit covers the whole request, so an occasional byte can't keep it open.
    stream_.expires_after(kRequestTime);
    http::async_read(
        stream_, buffer_, *parser_,
        [self = shared_from_this()](error_code error, std::size_t) { self->answer(error); });
  }

 private:
  void answer(error_code error) {
    if (error == http::error::end_of_stream) return close();
    if (error.category() == http::make_error_code(http::error::bad_target).category()) {
      return refuse(http::status::bad_request, "this is no HTTP request that is answered here");
    }
    if (error) return;
    const auto& request = parser_->get();
    const std::string host = text_of(request[http::field::host]);
    if (!is_own_host(host, own_names_)) {
      return refuse(http::status::forbidden,
                    "the Host header '" + printable(host, 64) +
                        "' does not name this server; open it by localhost or its address, or "
                        "start rtpm-console with --host-name and that name");
    }
    const auto origin = request.find(http::field::origin);
    if (origin != request.end() && !is_own_origin(text_of(origin->value()), host)) {
      return refuse(http::status::forbidden, "pages of other origins are not served");
    }
    const auto target = read_target(text_of(request.target()));
    if (!target) return refuse(http::status::bad_request, "the target is malformed");
    if (websocket::is_upgrade(request)) {
      return target->path == kGatewayPath ? connect(*target) : upgrade(*target);
    }
    if (request.method() != http::verb::get && request.method() != http::verb::head) {
      return refuse(http::status::method_not_allowed, "only GET and HEAD are answered");
    }
    if (target->path.starts_with(kDownloadPath)) return download(target->path);
    if (target->path == "/health") {
      return respond(http::status::ok, "application/json", "{\"status\":\"ok\"}");
    }
    send_file(target->path);
  }

  void upgrade(const RequestTarget& target) {
    const auto& request = parser_->get();
    const std::string_view subprotocol =
        choose_subprotocol(text_of(request[http::field::sec_websocket_protocol]));
    if (subprotocol.empty()) {
      return refuse(http::status::bad_request,
                    "the client must offer the sub-protocol foxglove.sdk.v1 or "
                    "foxglove.websocket.v1");
    }
    const bool has_token = is_same_token(target.token, server_.config.token);
    const bool has_wrong_token = !target.token.empty() && !has_token;
    if (has_token && server_.operators.is_full()) {
      return refuse(http::status::service_unavailable,
                    std::to_string(kOperatorCountMax) +
                        " clients with the token are connected; close one of them first");
    }
    place_.reset();
    auto session = std::make_shared<WebSocketSession>(
        server_, std::move(stream_), std::move(count_), has_token, has_wrong_token);
    session->start(request, std::string(subprotocol));
  }

  /// Connects a page to a server of the registry.
  void connect(const RequestTarget& target) {
    const auto& request = parser_->get();
    if (!offers_subprotocol(text_of(request[http::field::sec_websocket_protocol]),
                            kGatewaySubprotocol)) {
      return refuse(http::status::bad_request,
                    "the client must offer the sub-protocol " + std::string(kGatewaySubprotocol));
    }
    // Through it a page may call every method that the console may.
    if (server_.config.is_read_only) return refuse(http::status::forbidden, std::string(kReadOnly));
    if (!is_same_token(target.token, server_.config.token))
      return refuse(http::status::forbidden, std::string(kNoToken));
    if (server_.gateways.places.is_full()) {
      return refuse(http::status::service_unavailable,
                    std::to_string(kGatewayCountMax) + " connections to servers are open already");
    }
    endpoints_.clear();
    for (const ServerAddress& address : server_.targets.gateway_addresses(target.to)) {
      error_code error;
      const auto host = asio::ip::make_address(address.host, error);
      if (!error) endpoints_.emplace_back(host, address.port);
    }
    if (endpoints_.empty()) {
      return refuse(http::status::not_found, "the registry names no object of a server at '" +
                                                 printable(target.to, 64) + "'");
    }
    connecting_.emplace(server_.context);
    connecting_->expires_after(kConnectTime);
    stream_.expires_never();
    connecting_->async_connect(endpoints_,
                               [self = shared_from_this()](error_code error, const tcp::endpoint&) {
                                 self->connected(error);
                               });
  }

  void connected(error_code error) {
    if (error) {
      return refuse(http::status::bad_gateway,
                    "the server can't be reached: " + printable(error.message(), 64));
    }
    error_code ignored;
    connecting_->socket().set_option(tcp::no_delay(true), ignored);
    connecting_->expires_never();
    if (server_.is_ending || server_.gateways.places.is_full()) return close();
    place_.reset();
    std::string peer = peer_of(stream_.socket());
    const auto session = std::make_shared<GatewaySession>(
        server_.gateways, std::move(peer), std::move(stream_), std::move(*connecting_),
        std::make_shared<SocketCount>(std::move(count_)));
    session->start(parser_->get());
  }

  /// Sends the file of a ticket: "/download/TICKET/run.csv".
  void download(const std::string& path) {
    if (server_.downloads.is_full()) {
      return refuse(http::status::service_unavailable,
                    std::to_string(kDownloadCountMax) + " downloads are under way; try again");
    }
    // A browser that looks first must not use the ticket up.
    if (parser_->get().method() != http::verb::get)
      return refuse(http::status::method_not_allowed, "a download answers GET only");
    const std::string_view ticket = std::string_view(path).substr(kDownloadPath.size());
    auto download = server_.source.take_download(ticket.substr(0, ticket.find('/')));
    if (!download) {
      return refuse(http::status::not_found,
                    "this download was fetched already, or is more than a minute old; make it "
                    "anew on the page");
    }
    std::error_code cause;
    const std::uintmax_t size = std::filesystem::file_size(download->path, cause);
    file_ = std::ifstream(download->path, std::ios::binary);
    if (cause || !file_) return refuse(http::status::not_found, "the file is gone");
    place_.emplace(server_.downloads, peer_of(stream_.socket()), [this] { stream_.close(); });
    left_ = size;
    download_ = std::move(*download);
    head(http::status::ok, download_.media_type);
    keeps_alive_ = false;
    response_.keep_alive(false);
    response_.set(http::field::content_disposition,
                  "attachment; filename=\"" + download_.name + "\"");
    response_.set(http::field::accept_ranges, "none");
    response_.content_length(size);
    serializer_.emplace(response_);
    stream_.expires_after(kResponseTime);
    http::async_write_header(stream_, *serializer_,
                             [self = shared_from_this()](error_code error, std::size_t) {
                               if (!error) self->read_block();
                             });
  }

  void read_block() {
    if (left_ == 0 || server_.is_ending) return close();
    server_.reading.insert(shared_from_this());
    const bool is_queued = server_.reader.run("", [this] {
      block_.resize(static_cast<std::size_t>(std::min<std::uintmax_t>(left_, kBlockSize)));
      file_.read(block_.data(), static_cast<std::streamsize>(block_.size()));
      block_.resize(static_cast<std::size_t>(file_.gcount()));
      asio::post(server_.context, [this] { send_block(); });
    });
    if (!is_queued) server_.reading.erase(shared_from_this());
  }

  void send_block() {
    const auto self = shared_from_this();
    server_.reading.erase(self);
    // The client sees by the length that the rest is missing.
    if (block_.empty()) return stream_.close();
    left_ -= block_.size();
    stream_.expires_after(kBlockTime);
    asio::async_write(stream_, asio::buffer(block_), [self](error_code error, std::size_t) {
      if (!error) self->read_block();
    });
  }

  void send_file(const std::string& path) {
    const auto file = find_page_file(server_.config.page_folder, path);
    if (!file) {
      return refuse(http::status::not_found, path == "/"
                                                 ? "the page is not installed: no index.html in " +
                                                       server_.config.page_folder.string() +
                                                       "; give its folder with --page"
                                                 : "there is no such file");
    }
    std::error_code ignored;
    if (std::filesystem::file_size(*file, ignored) > kFileSizeMax || ignored) {
      return refuse(http::status::not_found, "the file can't be served");
    }
    std::ifstream stream(*file, std::ios::binary);
    std::string body{std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
    respond(http::status::ok, media_type(file->string()), std::move(body));
  }

  void refuse(http::status status, const std::string& why) {
    keeps_alive_ = false;
    respond(status, "text/plain; charset=utf-8", why + "\n");
  }

  /// Begins a response.
  void head(http::status status, std::string_view type) {
    const auto& request = parser_->get();
    response_ = {status, 11};
    const auto set = [&](const char* name, std::string_view value) {
      response_.set(name, beast::string_view(value.data(), value.size()));
    };
    set("Server", "rtpm-console");
    set("Content-Type", type);
    set("Cache-Control", "no-store");
    set("X-Content-Type-Options", "nosniff");
    set("X-Frame-Options", "DENY");
    set("Referrer-Policy", "no-referrer");
    set("Cross-Origin-Opener-Policy", "same-origin");
    set("Cross-Origin-Resource-Policy", "same-origin");
    set("Content-Security-Policy", content_security_policy(text_of(request[http::field::host])));
  }

  void respond(http::status status, std::string_view type, std::string body) {
    const auto& request = parser_->get();
    const bool keeps_alive = keeps_alive_ && request.keep_alive();
    head(status, type);
    response_.keep_alive(keeps_alive);
    response_.body() = std::move(body);
    response_.prepare_payload();
    if (request.method() == http::verb::head) response_.body().clear();
    stream_.expires_after(kResponseTime);
    http::async_write(stream_, response_,
                      [self = shared_from_this(), keeps_alive](error_code error, std::size_t) {
                        if (error) return;
                        if (keeps_alive && !self->server_.is_ending) return self->read();
                        self->close();
                      });
  }

  void close() {
    error_code ignored;
    stream_.socket().shutdown(tcp::socket::shutdown_both, ignored);
  }

  WebServer::Impl& server_;
  beast::tcp_stream stream_;
  SocketCount count_;
  std::optional<Place> place_{};
  std::vector<std::string> own_names_{};
  bool keeps_alive_ = true;
  beast::flat_buffer buffer_{64 * 1024};
  std::optional<http::request_parser<http::string_body>> parser_{};
  http::response<http::string_body> response_{};
  std::optional<http::response_serializer<http::string_body>> serializer_{};
  Download download_{};
  std::ifstream file_{};  ///< Used by the reader while this is in `reading`.
  std::vector<char> block_{};
  std::vector<tcp::endpoint> endpoints_{};         ///< A server of the registry's.
  std::optional<beast::tcp_stream> connecting_{};  ///< To that server.
  std::uintmax_t left_ = 0;                        ///< Bytes of the download that were not sent.
};

expected<void, SetupError> WebServer::Impl::listen() {
  const std::string place = config.address + ":" + std::to_string(config.port);
  error_code error;
  const auto address = asio::ip::make_address(config.address, error);
  if (error) {
    return setup_error("'" + config.address + "' is no address", "", "give --address 127.0.0.1");
  }
  const tcp::endpoint endpoint(address, config.port);
  acceptor.open(endpoint.protocol(), error);
  if (!error) acceptor.set_option(asio::socket_base::reuse_address(true), error);
  if (!error) acceptor.bind(endpoint, error);
  if (!error) acceptor.listen(kBacklog, error);
  if (error) {
    return setup_error("the page can't be served at " + place, error.message(),
                       "end what serves there, or give another --port");
  }
  port = acceptor.local_endpoint(error).port();
  accept();
  return {};
}

void WebServer::Impl::accept() {
  acceptor.async_accept([this](error_code error, tcp::socket socket) {
    if (is_ending || error == asio::error::operation_aborted) return;
    if (!error) {
      add_session(std::move(socket));
      return accept();
    }
    // No descriptor is left; connections that end will free some.
    retry.expires_after(kAcceptRetry);
    retry.async_wait([this](error_code aborted) {
      if (!aborted && !is_ending) accept();
    });
  });
}

void WebServer::Impl::add_session(tcp::socket socket) {
  error_code ignored;
  socket.set_option(tcp::no_delay(true), ignored);
  std::make_shared<HttpSession>(*this, std::move(socket), SocketCount(socket_count))->read();
}

void WebServer::Impl::repeat(const std::shared_ptr<asio::steady_timer>& timer, Duration period,
                             const std::shared_ptr<std::function<void()>>& work) {
  timer->expires_at(std::max(timer->expiry() + period, std::chrono::steady_clock::now()));
  timer->async_wait([this, timer, period, work](error_code error) {
    if (error || is_ending) return;
    (*work)();
    repeat(timer, period, work);
  });
}

void WebServer::Impl::end() {
  is_ending = true;
  error_code ignored;
  acceptor.close(ignored);
  retry.cancel();
  while (!sessions.empty())
    (*sessions.begin())->leave();
  for (GatewaySession* const session : gateways.sessions)
    session->drop();
  const auto timer = std::make_shared<asio::steady_timer>(context);
  const auto until = std::chrono::steady_clock::now() + kEndTime;
  const auto look = std::make_shared<std::function<void()>>();
  *look = [this, timer, until, weak = std::weak_ptr(look)] {
    if (socket_count == 0 || std::chrono::steady_clock::now() >= until) return context.stop();
    timer->expires_after(std::chrono::milliseconds{10});
    timer->async_wait([look = weak.lock()](error_code) {
      if (look) (*look)();
    });
  };
  (*look)();
}

expected<std::unique_ptr<WebServer>, SetupError> WebServer::create(WebConfig config,
                                                                   ConnectionHandler& handler,
                                                                   DownloadSource& downloads,
                                                                   const GatewayTargets& targets) {
  std::unique_ptr<WebServer> server(
      new WebServer(std::make_unique<Impl>(std::move(config), handler, downloads, targets)));
  if (auto started = server->impl_->reader.start(
          {.name = "console-send", .thread_count = 2, .queued_max = 2 * kDownloadCountMax});
      !started) {
    return unexpected{started.error()};
  }
  if (auto listening = server->impl_->listen(); !listening) return unexpected{listening.error()};
  return server;
}

WebServer::WebServer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
WebServer::~WebServer() = default;

std::string WebServer::url() const {
  std::string address = impl_->config.address;
  // Browsers can't open the wildcard address.
  if (address == "0.0.0.0") address = "127.0.0.1";
  if (address == "::") address = "::1";
  const bool is_v6 = address.find(':') != std::string::npos;
  return "http://" + (is_v6 ? "[" + address + "]" : address) + ":" + std::to_string(impl_->port) +
         "/";
}

std::uint16_t WebServer::port() const noexcept {
  return impl_->port;
}

void WebServer::run() {
  const auto keeps_running = asio::make_work_guard(impl_->context);
  impl_->context.run();
}

void WebServer::post(std::function<void()> work) {
  asio::post(impl_->context, std::move(work));
}

void WebServer::every(Duration period, std::function<void()> work) {
  const auto timer = std::make_shared<asio::steady_timer>(impl_->context);
  timer->expires_after(std::chrono::nanoseconds{0});
  impl_->repeat(timer, period, std::make_shared<std::function<void()>>(std::move(work)));
}

void WebServer::stop() {
  asio::post(impl_->context, [impl = impl_.get()] { impl->end(); });
}

}  // namespace rtpm::console
