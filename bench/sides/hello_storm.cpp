#include "sides/hello_storm.hpp"

#include <algorithm>
#include <array>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/host.hpp"
#include "rtpm/wire/sealed.hpp"
#include "settings.hpp"
#include "sides/raw_socket.hpp"

namespace rtpm::bench {
namespace {

constexpr int kAddressCount = 16;
constexpr Duration kInterval{1'000'000'000 / kHellosPerSecond};

/// One address of the attacker.
struct Source {
  RawSocket socket;
  wire::Cookie cookie{};
  bool has_cookie = false;
  std::uint32_t number = 0;
};

class HelloStorm {
 public:
  explicit HelloStorm(std::vector<Source> sources) : sources_(std::move(sources)) {}

  void send_next() {
    Source& source = sources_[next_++ % sources_.size()];
    take_answers(source);
    wire::Hello hello{.features = wire::kFeatureSealed,
                      .client_epoch = 1 + next_ % sources_.size(),
                      .channel = 1,
                      .message_size_max = 1320};
    if (source.has_cookie) hello.cookie = source.cookie;
    const std::size_t size = source.has_cookie ? wire::SealedHello::kSize : wire::Hello::kSize;
    wire::Header header;
    header.kind = wire::FrameKind::kHello;
    header.priority = kHighPriority;
    header.call_id = ++source.number;
    header.payload_size = header.message_size = static_cast<std::uint32_t>(size);
    wire::encode(header, frame_.data());
    wire::encode(hello, MutableBytes(frame_).subspan(wire::kHeaderSize));
    for (std::size_t i = wire::kHeaderSize + wire::Hello::kSize; i < frame_.size(); i += 8)
      store_le(frame_.data() + i, rt::random_u64());
    source.socket.send(ConstBytes(frame_).first(wire::kHeaderSize + size));
    // Each cookie for one handshake.
    source.has_cookie = false;
  }

 private:
  static void take_answers(Source& source) {
    std::array<std::byte, 256> answer{};
    for (ssize_t got = source.socket.receive(answer, MSG_DONTWAIT); got > 0;
         got = source.socket.receive(answer, MSG_DONTWAIT)) {
      const ConstBytes bytes = ConstBytes(answer).first(static_cast<std::size_t>(got));
      if (bytes.size() < wire::kHeaderSize) continue;
      const auto cookie = wire::decode_sealed_cookie(bytes.subspan(wire::kHeaderSize));
      if (!cookie) continue;
      source.cookie = cookie->cookie;
      source.has_cookie = true;
    }
  }

  std::vector<Source> sources_;
  std::size_t next_ = 0;
  std::array<std::byte, wire::kHeaderSize + wire::SealedHello::kSize> frame_{};
};

}  // namespace

Outcome<Call> make_hello_storm(std::uint16_t port) {
  std::vector<Source> sources;
  for (int i = 0; i < kAddressCount; ++i) {
    Source source{.socket = RawSocket::open(SOCK_DGRAM)};
    const std::string address = "127.0.0." + std::to_string(2 + i);
    if (!source.socket.bind(address) || !source.socket.connect(address_of("127.0.0.1", port))) {
      return failure("the sender of HELLOs can't be at " + address);
    }
    sources.push_back(std::move(source));
  }
  return paced_as_hellos(
      [storm = std::make_shared<HelloStorm>(std::move(sources))](Duration) -> Outcome<> {
        storm->send_next();
        return {};
      });
}

Call paced_as_hellos(Call call) {
  return [call = std::move(call), due = std::make_shared<MonotonicTime>()](Duration work) {
    *due = std::max(*due + kInterval, rt::now() - kInterval);
    rt::sleep_until(*due);
    return call(work);
  };
}

}  // namespace rtpm::bench
