#include <omniORB4/CORBA.h>

#include <cstring>
#include <mutex>
#include <peer.hh>

#include "peer.hpp"
#include "peer_port.hpp"
#include "rtpm/rt/thread.hpp"

// omniORB. Its user's guide, chapter 6: the default, a thread for each connection and one call at a
// time on each, "eliminates any thread switching in either of the address spaces"; so that stays.
// The limit of connections to one server is raised, so that callers do not wait for each other's,
// and idle connections are kept. omniORB sets TCP_NODELAY by itself.
//
// It has no RT-CORBA. An ORB has several ends, though, and a connection its own thread; so each
// lane has an end and an object of its own, and a connection's thread takes the priority of the
// object that it serves.
namespace rtpm::bench {
namespace {

std::string object_name(std::size_t lane) {
  return "lane" + std::to_string(lane);
}

class EchoServant final : public POA_peer::Echo, public PortableServer::RefCountServantBase {
 public:
  explicit EchoServant(Priority priority) : priority_(priority) {}

  peer::Message call(const peer::Message& request) override {
    // A thread serves one connection, and a connection one lane.
    thread_local const bool is_configured = take_priority();
    static_cast<void>(is_configured);
    answer({.work_ns = request.work_ns});
    return request;
  }

 private:
  [[nodiscard]] bool take_priority() const {
    // Where real-time scheduling is off, the threads around are not at SCHED_FIFO either.
    if (sched_getscheduler(0) != SCHED_FIFO) return false;
    return rt::configure_this_thread({.name = "omniorb-lane", .priority = priority_}).has_value();
  }
  Priority priority_;
};

class OmniorbCaller final : public PeerCaller {
 public:
  explicit OmniorbCaller(peer::Echo_var echo) : echo_(std::move(echo)) {}

 protected:
  expected<void, std::string> exchange(const PeerMessage& request, PeerMessage& reply) override {
    peer::Message message;
    message.work_ns = request.work_ns;
    std::memcpy(message.values, request.values.data(), sizeof message.values);
    try {
      message = echo_->call(message);
    } catch (const CORBA::Exception& exception) {
      return unexpected{std::string("omniORB: ") + exception._name()};
    }
    reply.work_ns = message.work_ns;
    std::memcpy(reply.values.data(), message.values, sizeof message.values);
    return {};
  }

 private:
  peer::Echo_var echo_;
};

class OmniorbPeer final : public Peer {
 public:
  expected<void, std::string> serve(const PeerLane& lane,
                                    const Announce& publish_link_report) override {
    return without_corba_exceptions([&]() -> expected<void, std::string> {
      // The first lane's thread starts the ORB with the ends of both.
      if (lane.index == 0) start_server(lane);
      activate(lane);
      publish_link_report(address_of(lane));
      return {};
    });
  }

  expected<std::unique_ptr<Caller>, std::string> connect(const PeerLane&,
                                                         const std::string& address) override {
    std::unique_ptr<Caller> caller;
    auto connected = without_corba_exceptions([&]() -> expected<void, std::string> {
      if (CORBA::is_nil(orb_)) start_orb({});
      const CORBA::Object_var object = orb_->string_to_object(address.c_str());
      caller = std::make_unique<OmniorbCaller>(peer::Echo::_unchecked_narrow(object));
      return {};
    });
    if (!connected) return unexpected{connected.error()};
    return caller;
  }

 private:
  using Options = std::vector<std::array<std::string, 2>>;

  template <class Body>
  static expected<void, std::string> without_corba_exceptions(const Body& body) {
    try {
      return body();
    } catch (const CORBA::Exception& exception) {
      return unexpected{std::string("omniORB: ") + exception._name()};
    }
  }

  void start_orb(Options options) {
    options.push_back({"maxGIOPConnectionPerServer", "100"});
    options.push_back({"threadPerConnectionUpperLimit", "10000"});
    options.push_back({"scanGranularity", "0"});
    options.push_back({"clientTransportRule", "* unix,tcp"});
    std::vector<std::array<const char*, 2>> texts;
    for (const auto& [key, value] : options)
      texts.push_back({key.c_str(), value.c_str()});
    texts.push_back({nullptr, nullptr});
    int argument_count = 0;
    orb_ = CORBA::ORB_init(argument_count, nullptr, "omniORB4",
                           reinterpret_cast<const char*(*)[2]>(texts.data()));
  }

  void start_server(PeerLane lane) {
    Options ends;
    for (lane.index = 0; lane.index < kPeerLaneCount; ++lane.index) {
      ports_[lane.index] = free_port();
      ends.push_back(
          {"endPoint", lane.transport == "unix"
                           ? "giop:unix:" + lane.socket_path()
                           : "giop:tcp:127.0.0.1:" + std::to_string(ports_[lane.index])});
    }
    start_orb(std::move(ends));
    const CORBA::Object_var object = orb_->resolve_initial_references("omniINSPOA");
    poa_ = PortableServer::POA::_narrow(object);
    const PortableServer::POAManager_var manager = poa_->the_POAManager();
    manager->activate();
  }

  void activate(const PeerLane& lane) {
    const PortableServer::ObjectId_var id =
        PortableServer::string_to_ObjectId(object_name(lane.index).c_str());
    const PortableServer::ServantBase_var servant = new EchoServant(lane.priority);
    poa_->activate_object_with_id(id, servant.in());
  }

  [[nodiscard]] std::string address_of(const PeerLane& lane) const {
    const std::string end = lane.transport == "unix"
                                ? "omniunix:" + lane.socket_path()
                                : ":127.0.0.1:" + std::to_string(ports_[lane.index]);
    return "corbaloc:" + end + (lane.transport == "unix" ? ":/" : "/") + object_name(lane.index);
  }

  CORBA::ORB_var orb_{};
  PortableServer::POA_var poa_{};
  std::array<std::uint16_t, kPeerLaneCount> ports_{};
};

}  // namespace

std::unique_ptr<Peer> make_peer() {
  return std::make_unique<OmniorbPeer>();
}

}  // namespace rtpm::bench
