#include "rtpm/sealed/handshake_job.hpp"

#include "rtpm/sealed/key_log.hpp"

#include <string_view>
#include <utility>

namespace rtpm::sealed {

void HandshakeJob::run() noexcept {
  if (state_ == State::kReading) {
    responder_.emplace(suite_, identity_->key.clone(), identity_->preshared.clone(), prologue_);
    std::array<std::byte, wire::kMessage1PayloadSize> payload{};
    client_.reset();
    const auto read = responder_->read_message_1(
        ConstBytes(frame_).last(wire::SealedHello::kMessageSize), payload);
    if (read) client_ = *read;
    former_ = load_le<std::uint64_t>(payload.data());
    state_ = State::kRead;
  } else if (state_ == State::kWriting) {
    std::array<std::byte, wire::SealedWelcome::kInnerSize> inner{};
    wire::encode(granted_, inner);
    is_written_ =
        responder_->write_message_2(identity_->random.draw_key(), inner, message_2_).has_value();
    if (is_written_) {
      if (auto keys = responder_->keys()) keys_.emplace(std::move(*keys));
    }
    responder_.reset();
    state_ = State::kWritten;
  }
}

std::optional<std::string> HandshakeJob::key_log_line() const {
  const bool is_new = granted_.former != wire::FormerSession::kAlive;
  if (state_ != State::kWritten || !keys_ || !is_new) return std::nullopt;
  return sealed::key_log_line(granted_.session, keys_->suite, keys_->receive, keys_->send);
}

}  // namespace rtpm::sealed
