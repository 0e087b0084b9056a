#include "rtpm/sealed/handshake_job.hpp"

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
    state_ = State::kWritten;
  }
}

}  // namespace rtpm::sealed
