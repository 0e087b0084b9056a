#include "attacker.hpp"

#include <algorithm>

#include "rtpm/wire/sealed.hpp"
#include "sim_server.hpp"

namespace rtpm::sim {
namespace {

constexpr std::size_t kRecordedMax = 64;
constexpr std::size_t kAtKind = 3;
constexpr std::size_t kAtFlags = 6;
constexpr std::size_t kAtStatus = 26;
constexpr std::size_t kAtPayloadSize = 28;
constexpr std::size_t kAtMessageSize = 36;
constexpr std::size_t kAtFeatures = wire::kHeaderSize + 4;
constexpr std::size_t kCookieSize = wire::kHeaderSize + wire::SealedCookie::kSize;
constexpr std::size_t kAtSuites = wire::kHeaderSize + 48;

/// A header like `like`, but of this kind and with this many bytes behind it.
Bytes frame_like(ConstBytes like, wire::FrameKind kind, wire::Status status, std::size_t size) {
  Bytes frame(wire::kHeaderSize + size);
  std::ranges::copy(like.first(wire::kHeaderSize), frame.begin());
  frame[kAtKind] = static_cast<std::byte>(kind);
  store_le<std::uint16_t>(frame.data() + kAtFlags, 0);
  store_le(frame.data() + kAtStatus, static_cast<std::uint16_t>(status));
  store_le(frame.data() + kAtPayloadSize, static_cast<std::uint32_t>(size));
  store_le(frame.data() + kAtMessageSize, static_cast<std::uint32_t>(size));
  store_le<std::uint32_t>(frame.data() + 32, 1U << 16);  // The first fragment, of one.
  store_le<std::uint32_t>(frame.data() + 44, 0);
  return frame;
}

}  // namespace

bool Attacker::on_datagram(std::uint32_t from_port, std::uint32_t to_port, ConstBytes frame) {
  if (frame.size() < wire::kHeaderSize) return true;
  if (random_.chance(200)) record(from_port, to_port, frame);
  if (random_.chance(30)) replay();
  if (random_.chance(30)) change(from_port, to_port, frame);
  if (random_.chance(30)) forge(from_port, to_port, frame);
  if (random_.chance(100) && strip(from_port, to_port, frame)) return false;
  if (!random_.chance(20)) return true;
  hold(from_port, to_port, frame);
  return false;
}

void Attacker::hold(std::uint32_t from_port, std::uint32_t to_port, ConstBytes frame) {
  ++held_count_;
  const Duration longest{random_.chance(500) ? 20'000'000 : 10'000'000'000};
  scheduler_.after(random_.between(Duration{1'000'000}, longest),
                   [this, from_port, to_port, held = Bytes(frame.begin(), frame.end())] {
                     network_.deliver(from_port, to_port, held);
                   });
}

// Lets the sides believe that the other one has no sealed sessions, or only the weaker suite.
bool Attacker::strip(std::uint32_t from_port, std::uint32_t to_port, ConstBytes frame) {
  const auto kind = static_cast<wire::FrameKind>(frame[kAtKind]);
  Bytes stripped(frame.begin(), frame.end());
  const auto cut = [&](std::size_t size) {
    stripped.resize(wire::kHeaderSize + size);
    store_le(stripped.data() + kAtPayloadSize, static_cast<std::uint32_t>(size));
    store_le(stripped.data() + kAtMessageSize, static_cast<std::uint32_t>(size));
  };
  if (kind == wire::FrameKind::kHello && frame.size() >= wire::kHeaderSize + wire::Hello::kSize) {
    if (random_.chance(500)) cut(wire::Hello::kSize);
    store_le<std::uint32_t>(stripped.data() + kAtFeatures, random_.chance(500) ? 1 : 0);
  } else if (kind == wire::FrameKind::kCookie && frame.size() == kCookieSize) {
    if (random_.chance(500)) {
      cut(sizeof(wire::Cookie));
    } else {
      store_le<std::uint32_t>(stripped.data() + kAtSuites, random_.chance(500) ? 1 : 0);
    }
  } else if (kind == wire::FrameKind::kWelcome) {
    cut(wire::Welcome::kSize);
  } else {
    return false;
  }
  if (std::ranges::equal(stripped, frame)) return false;
  ++stripped_count_;
  scheduler_.after(Duration{30'000}, [this, from_port, to_port, frame = std::move(stripped)] {
    network_.deliver(from_port, to_port, frame);
  });
  return true;
}

void Attacker::record(std::uint32_t from_port, std::uint32_t to_port, ConstBytes frame) {
  Recorded recorded{from_port, to_port, Bytes(frame.begin(), frame.end())};
  if (recorded_.size() < kRecordedMax) {
    recorded_.push_back(std::move(recorded));
  } else {
    recorded_[random_.between(std::size_t{0}, kRecordedMax - 1)] = std::move(recorded);
  }
}

// The copy arrives at any later time, sometimes at its sender, or from another address.
void Attacker::replay() {
  if (recorded_.empty()) return;
  const Recorded& recorded = recorded_[random_.between(std::size_t{0}, recorded_.size() - 1)];
  std::uint32_t from = recorded.from_port;
  std::uint32_t to = recorded.to_port;
  if (random_.chance(50)) std::swap(from, to);
  if (random_.chance(50)) from = static_cast<std::uint32_t>(random_.between(10'001, 10'005));
  send(from, to, recorded.frame);
}

void Attacker::change(std::uint32_t from_port, std::uint32_t to_port, ConstBytes frame) {
  Bytes changed(frame.begin(), frame.end());
  const std::size_t bit = random_.between(std::size_t{0}, 8 * changed.size() - 1);
  changed[bit / 8] ^= std::byte{1} << (bit % 8);
  send(from_port, to_port, std::move(changed));
}

void Attacker::forge(std::uint32_t from_port, std::uint32_t to_port, ConstBytes frame) {
  using wire::FrameKind;
  using wire::Status;
  const bool is_to_client = from_port == kServerPort;
  switch (random_.between(0, 5)) {
    case 0:
      // The answer of a server that does not know the session.
      send(is_to_client ? from_port : to_port, is_to_client ? to_port : from_port,
           frame_like(frame, FrameKind::kRefuse, Status::kUnknownSession, 0));
      return;
    case 1:
      send(from_port, to_port, frame_like(frame, FrameKind::kClose, Status::kOk, 0));
      return;
    case 2:
      send(kServerPort, is_to_client ? to_port : from_port,
           frame_like(frame, FrameKind::kCookie, Status::kOk, random_.chance(500) ? 16 : 56));
      return;
    case 3:
      send(kServerPort, is_to_client ? to_port : from_port,
           frame_like(frame, FrameKind::kWelcome, Status::kOk, random_.chance(500) ? 48 : 112));
      return;
    case 4:
      send(from_port, to_port,
           frame_like(frame, is_to_client ? FrameKind::kReply : FrameKind::kCall, Status::kOk, 16));
      return;
    default:
      send(
          from_port, to_port,
          frame_like(frame, is_to_client ? FrameKind::kReply : FrameKind::kCancel, Status::kOk, 0));
      return;
  }
}

void Attacker::send(std::uint32_t from_port, std::uint32_t to_port, Bytes frame) {
  ++forged_count_;
  const Duration delay = random_.chance(200)
                             ? random_.between(Duration{0}, Duration{60'000'000'000})
                             : random_.between(Duration{0}, Duration{5'000'000});
  scheduler_.after(delay, [this, from_port, to_port, frame = std::move(frame)] {
    network_.deliver(from_port, to_port, frame);
  });
}

}  // namespace rtpm::sim
