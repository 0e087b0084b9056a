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

/// Opens the transport that the address names, without sealing, even if the address has a key.
/// @realtime set-up only
/// @errors   as in rtpm/transport
[[nodiscard]] expected<std::unique_ptr<transport::ClientTransport>, SetupError>
open_plain_transport(const ServerAddress& address, NodeKeys& keys, Priority priority,
                     MonotonicTime deadline);

/// A transport that seals another one, for a known server. Seals frames as they are sent, opens
/// them as they arrive, and handles handshakes; its channel sees a plain session. In the child of a
/// fork it fails, and leaves the parent's sessions alone.
/// @threads  one at a time
/// @realtime like the inner transport, plus 1 µs per frame; allocates when opened and in renew(). A
///           handshake takes 200 µs on the thread that sends or receives: when a session opens,
///           after an unsealed hint, and once a day for new keys
class SealedTransport final : public transport::ClientTransport {
 public:
  /// @param address  of a server with a key; must outlive this
  /// @realtime set-up only
  /// @errors   those of the inner transport; this program has no key; no memory for keys
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
  [[nodiscard]] bool announce_sleep() noexcept override {
    return kept_count_ == 0 && is_here() && !client().has_ended() && within_->announce_sleep();
  }
  void end_sleep() noexcept override { within_->end_sleep(); }
  [[nodiscard]] expected<MutableBytes, transport::IoError> await(
      MonotonicTime until) noexcept override;
  [[nodiscard]] int descriptor() const noexcept override { return within_->descriptor(); }
  [[nodiscard]] wire::Medium medium() const noexcept override { return within_->medium(); }
  [[nodiscard]] std::optional<std::uint32_t> unread_count() const noexcept override {
    return within_->unread_count();
  }
  void check_peer() noexcept override { within_->check_peer(); }
  [[nodiscard]] bool is_on_host() const noexcept override { return within_->is_on_host(); }

  /// Whether the channel should switch to new keys: call renew(), then open a new session.
  [[nodiscard]] bool wants_renewal() const noexcept { return wants_renewal_; }
  /// Performs the handshake, over TCP on an additional connection, unless it is already done. The
  /// channel must have no open call.
  /// @return whether a new session is ready, to which the channel moves without a frame when it
  ///         opens one; false if the old one continues
  /// @realtime set-up work, once a day: at least two round trips, at most 100 ms
  [[nodiscard]] bool renew() noexcept;

  /// Why there is no session, as the peer reported it; this is not authenticated. Empty if the
  /// channel already knows everything.
  /// @realtime set-up only
  [[nodiscard]] SetupError explain() const;

 private:
  /// One frame for each call that may share a channel; further frames count as lost.
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
  MonotonicTime next_renewal_{};  ///< When to retry renewal in the background.
  MonotonicTime next_wait_{};     ///< When a call next waits for renewal.
  MonotonicTime due_since_ = kNever;
  transport::DatagramBatch batch_;
  /// Frames that the sealed client made for the channel, such as a REFUSE when the channel sends in
  /// a session that is gone.
  std::array<std::array<std::byte, kKeptSizeMax>, kKeptMax> kept_{};
  std::array<std::size_t, kKeptMax> kept_sizes_{};
  std::size_t kept_first_ = 0;
  std::size_t kept_count_ = 0;
  alignas(16) std::array<std::byte, kKeptSizeMax> taken_{};
};

}  // namespace rtpm::rpc
