#include <lcm/lcm.h>

#include <cstring>
#include <utility>

#include "topics.hpp"

// LCM: a request and a reply channel for each caller. It has one transport between programs, UDP
// multicast, here with a time-to-live of 0, which stays within the host. Lost messages are not
// repeated, and only the receive buffer can be tuned. Each lane, caller and consumer has an
// instance of its own, with its own receiving thread, which so has the lane's priority.
// Its events have no broker: the kernel takes each datagram to every consumer's instance.
namespace rtpm::bench {
namespace {

struct Lcm {
  static constexpr const char* kName = "LCM";
  static constexpr const char* kRemedy =
      "it needs an interface with multicast. Remedy: ip link set lo multicast on && ip route add "
      "224.0.0.0/4 dev lo";

  struct Context {
    Context(const PeerLane&, TopicRole) {}
    bool wait(Duration patience) const {
      if (patience == Duration::max()) return lcm_handle(lcm) == 0;
      const auto ms = std::chrono::duration_cast<std::chrono::milliseconds>(patience);
      return lcm_handle_timeout(lcm, static_cast<int>(ms.count())) > 0;
    }
    lcm_t* lcm = lcm_create("udpm://239.255.76.97:7697?ttl=0&recv_buf_size=1048576");
  };

  /// A channel's handler leaves one sample, which is taken before the next is handled.
  template <class Sample>
  struct Reader {
    Reader(const Context& context, const std::string& topic, int) : lcm(context.lcm) {
      if (lcm != nullptr) lcm_subscribe(lcm, topic.c_str(), handle, this);
    }
    static void handle(const lcm_recv_buf_t* buffer, const char*, void* user) {
      auto& reader = *static_cast<Reader*>(user);
      reader.is_new = buffer->data_size == sizeof(Sample);
      if (reader.is_new) std::memcpy(&reader.sample, buffer->data, sizeof(Sample));
    }
    [[nodiscard]] bool is_well() const { return lcm != nullptr; }
    [[nodiscard]] bool take(Sample& to) {
      to = sample;
      return std::exchange(is_new, false);
    }
    lcm_t* lcm;
    Sample sample{};
    bool is_new = false;
  };

  template <class Sample>
  struct Writer {
    Writer(const Context& context, std::string topic, int)
        : lcm(context.lcm), channel(std::move(topic)) {}
    [[nodiscard]] bool is_well() const { return lcm != nullptr; }
    bool write(const Sample& sample) const {
      return lcm_publish(lcm, channel.c_str(), &sample, sizeof sample) == 0;
    }
    lcm_t* lcm;
    std::string channel;
  };
};

}  // namespace

const Peer kPeer = kTopicPeer<Lcm>;

}  // namespace rtpm::bench
