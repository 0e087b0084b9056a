#include "media/datagram_port.hpp"

#include "rtpm/rt/clock.hpp"

namespace rtpm::rpc {
namespace {

// Other answers may wait for a call that took less than this.
constexpr Duration kQuickCall = std::chrono::microseconds{5};

}  // namespace

std::optional<MonotonicTime> DatagramPort::receive() noexcept {
  if (!batch_.is_empty()) return rt::now();
  const auto received = port_->receive(buffer_);
  if (!received) return std::nullopt;
  batch_ = *received;
  const MonotonicTime now = rt::now();
  port_->note(batch_, now);
  return now;
}

void DatagramPort::begin_call(Lead& lead, const wire::Header& call) noexcept {
  const bool is_quick = call.service == quick_service_ && call.method == quick_method_;
  if (!is_quick) flush(lead);
}

void DatagramPort::end_call(const wire::Header& call, MonotonicTime received) noexcept {
  const bool was_quick = rt::now() - received < kQuickCall;
  quick_service_ = was_quick ? call.service : wire::kSessionService;
  quick_method_ = call.method;
}

void DatagramPort::send(Lead& lead, wire::ServerSessions& sessions, const wire::PeerAddress& peer,
                        ConstBytes frame, bool has_more) noexcept {
  if (!answers_.is_empty() && !(peer == answers_peer_)) flush(lead);
  // A single datagram is sent as it is. One of maximum size may be part of a sequence.
  const std::size_t size_max =
      wire::kDatagramFrameSizeMax - (seals_ == nullptr ? 0 : wire::kSealedTrailerSize);
  const bool is_alone = !has_more && answers_.is_empty() && frame.size() < size_max;
  for (; !frame.empty(); frame = sessions.next_frame(rt::now())) {
    const ConstBytes out = seals_ == nullptr ? frame : seals_->seal(frame);
    if (out.empty()) continue;
    answers_peer_ = peer;
    if (!is_alone && answers_.add(out)) continue;
    flush(lead);
    if (!is_alone && answers_.add(out)) continue;
    send_alone(lead, peer, out);
  }
  if (!has_more) flush(lead);
}

void DatagramPort::send_alone(Lead& lead, const wire::PeerAddress& peer,
                              ConstBytes frame) noexcept {
  if (!port_->send(peer, frame)) ++report_.counters(lead).send_failure_count;
}

void DatagramPort::flush(Lead& lead) noexcept {
  if (answers_.is_empty()) return;
  if (!port_->send_batch(answers_peer_, answers_)) ++report_.counters(lead).send_failure_count;
  answers_.clear();
}

}  // namespace rtpm::rpc
