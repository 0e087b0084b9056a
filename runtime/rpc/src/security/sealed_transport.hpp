#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>

#include "rtpm/sealed/client.hpp"
#include "rtpm/transport/client_transport.hpp"
#include "security/node_keys.hpp"
#include "security/server_address.hpp"

namespace rtpm::rpc {

/// Opens the transport that the address names. Nothing on it is sealed, whatever key the address
/// has.
/// @realtime set-up only
/// @errors   as those of rtpm/transport
[[nodiscard]] expected<std::unique_ptr<transport::ClientTransport>, SetupError>
open_plain_transport(const ServerAddress& address, NodeKeys& keys, Priority priority,
                     MonotonicTime deadline);

/// A path to a known server on which only sealed frames go: a transport around another one. It
/// seals frames as they are sent and opens them as they come; handshakes go on inside. To its
/// channel the session is a plain one. In the child of a fork it fails, and leaves the parent's
/// sessions alone.
/// @threads  one at a time
/// @realtime as the transport within, and 1 µs a frame; allocates at its opening and in renew().
///           A handshake's work, 200 µs, is done by the thread that sends or receives: when a
///           session opens, after an unsealed hint, and once a day for new keys
class SealedTransport final : public transport::ClientTransport {
 public:
  /// @param address  of a server with a key; outlives this
  /// @realtime set-up only
  /// @errors   as the transport within; no key of this program's own, no memory for keys
  [[nodiscard]] static expected<std::unique_ptr<SealedTransport>, SetupError> open(
      const ServerAddress& address, NodeKeys& keys, Priority priority, MonotonicTime deadline);

  [[nodiscard]] expected<void, transport::IoError> send(ConstBytes frame) noexcept override;
  [[nodiscard]] expected<void, transport::IoError> send_batch(
      const transport::DatagramBatch& batch) noexcept override;
  void accept_batches() noexcept override { within_->accept_batches(); }
  [[nodiscard]] expected<MutableBytes, transport::IoError> receive() noexcept override;
  [[nodiscard]] bool has_buffered() const noexcept override {
    return kept_count_ > 0 || within_->has_buffered();
  }
  void wait(MonotonicTime until) noexcept override;
  [[nodiscard]] expected<MutableBytes, transport::IoError> await(
      MonotonicTime until) noexcept override;
  [[nodiscard]] int descriptor() const noexcept override { return within_->descriptor(); }
  [[nodiscard]] wire::Medium medium() const noexcept override { return within_->medium(); }
  [[nodiscard]] std::optional<std::uint32_t> unread_count() const noexcept override {
    return within_->unread_count();
  }
  void check_peer() noexcept override { within_->check_peer(); }
  [[nodiscard]] bool is_on_host() const noexcept override { return within_->is_on_host(); }

  /// Whether the channel should go on with new keys: renew(), then open a session anew.
  [[nodiscard]] bool wants_renewal() const noexcept { return wants_renewal_; }
  /// Shakes hands, over TCP on one more connection, unless that is done already. The channel must
  /// have no open call.
  /// @return whether a session waits, to which the channel moves without a frame when it opens one;
  ///         false if it goes on with the old one
  /// @realtime set-up work, once a day: two round trips and more, 100 ms at most
  [[nodiscard]] bool renew() noexcept;

  /// Why there is no session, as far as the peer said; that is not authenticated. Empty if no more
  /// is known than the channel knows.
  /// @realtime set-up only
  [[nodiscard]] SetupError explain() const;

 private:
  /// Frames beyond this are as good as lost on the way.
  static constexpr std::size_t kKeptMax = wire::kCallWindow;
  static constexpr std::size_t kKeptSizeMax = wire::kHeaderSize + wire::Welcome::kSize;

  SealedTransport(const ServerAddress& address, NodeKeys& keys,
                  std::unique_ptr<transport::ClientTransport> within,
                  std::shared_ptr<const OwnKey> own, Secret<sealed::SealedClient> client,
                  Priority priority) noexcept;
  [[nodiscard]] bool is_here() const noexcept { return client_.is_here(); }
  [[nodiscard]] sealed::SealedClient& client() const noexcept { return *client_; }

  [[nodiscard]] expected<void, transport::IoError> perform(sealed::SealedClient::Step step,
                                                           transport::ClientTransport& over,
                                                           MonotonicTime now) noexcept;
  [[nodiscard]] expected<MutableBytes, transport::IoError> open_frame(
      expected<MutableBytes, transport::IoError> frame) noexcept;
  void keep(ConstBytes frame) noexcept;
  [[nodiscard]] MutableBytes take_kept() noexcept;
  void look_at_keys(MonotonicTime now) noexcept;
  void move(MonotonicTime now) noexcept;
  [[nodiscard]] bool renew_now() noexcept;

  const ServerAddress& address_;
  NodeKeys& keys_;
  std::unique_ptr<transport::ClientTransport> within_;
  std::unique_ptr<transport::ClientTransport> next_within_;  ///< Carries a stream's next session.
  std::shared_ptr<const OwnKey> own_;
  Secret<sealed::SealedClient> client_;
  Priority priority_;
  std::unique_ptr<transport::ClientTransport> former_;  ///< Carries a stream's last session.
  MonotonicTime former_until_{};
  bool wants_renewal_ = false;
  MonotonicTime next_renewal_{};  ///< The next one in the background,
  MonotonicTime next_wait_{};     ///< and the next for which a call waits.
  MonotonicTime due_since_ = kNever;
  transport::DatagramBatch batch_;
  /// Frames for the channel that came of its own sending.
  std::array<std::array<std::byte, kKeptSizeMax>, kKeptMax> kept_{};
  std::array<std::size_t, kKeptMax> kept_sizes_{};
  std::size_t kept_first_ = 0;
  std::size_t kept_count_ = 0;
  alignas(16) std::array<std::byte, kKeptSizeMax> taken_{};
};

}  // namespace rtpm::rpc
