#include <omniORB4/CORBA.h>

#include <array>
#include <cstring>
#include <peer.hh>
#include <utility>

#include "peer.hpp"
#include "sides/raw_socket.hpp"

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

/// Runs `body` and turns CORBA's exceptions into errors, for Peer::guard.
Outcome<> guard_corba(const std::function<Outcome<>()>& body) {
  try {
    return body();
  } catch (const CORBA::Exception& exception) {
    return failure(std::string("CORBA's ") + exception._name());
  }
}

/// Starts this process's ORB with these options and ones that keep every connection.
CORBA::ORB_var start_orb(std::vector<std::pair<std::string, std::string>> options) {
  options.emplace_back("threadPerConnectionUpperLimit", "10000");
  options.emplace_back("scanGranularity", "0");
  std::vector<std::array<const char*, 2>> texts;
  for (const auto& [key, value] : options)
    texts.push_back({key.c_str(), value.c_str()});
  texts.push_back({nullptr, nullptr});
  int argument_count = 0;
  return CORBA::ORB_init(argument_count, nullptr, "omniORB4",
                         reinterpret_cast<const char*(*)[2]>(texts.data()));
}

/// The object adapter of that name, with its manager active.
PortableServer::POA_var activate_adapter(CORBA::ORB_ptr orb, const char* name) {
  const CORBA::Object_var object = orb->resolve_initial_references(name);
  const PortableServer::POA_var adapter = PortableServer::POA::_narrow(object);
  const PortableServer::POAManager_var manager = adapter->the_POAManager();
  manager->activate();
  return adapter;
}

class EchoServant final : public POA_peer::Echo, public PortableServer::RefCountServantBase {
 public:
  explicit EchoServant(Priority priority) : priority_(priority) {}

  peer::Message call(const peer::Message& request) override {
    // A thread serves one connection, and a connection one lane.
    thread_local const bool is_configured = take_priority();
    static_cast<void>(is_configured);
    answer(request.work_ns);
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

/// A port that is not in use.
std::uint16_t free_port() {
  const RawSocket socket = RawSocket::open(SOCK_STREAM);
  static_cast<void>(socket.bind("127.0.0.1"));
  return socket.port();
}

struct Server {
  PortableServer::POA_var adapter{};
  std::array<std::string, kPeerLaneCount> addresses{};
};

/// Starts the ORB with the ends of both lanes.
Server start_server(PeerLane lane) {
  Server server;
  std::vector<std::pair<std::string, std::string>> ends;
  for (lane.index = 0; lane.index < kPeerLaneCount; ++lane.index) {
    const bool is_unix = lane.transport == "unix";
    const std::string port = "127.0.0.1:" + std::to_string(free_port());
    ends.emplace_back("endPoint", is_unix ? "giop:unix:" + lane.socket_path() : "giop:tcp:" + port);
    server.addresses[lane.index] =
        is_unix ? "omniunix:" + lane.socket_path() + ":/" : ":" + port + "/";
  }
  static const CORBA::ORB_var kOrb = start_orb(std::move(ends));
  server.adapter = activate_adapter(kOrb, "omniINSPOA");
  return server;
}

Outcome<> serve(const PeerLane& lane, const Announce& announce) {
  // The first lane's thread starts it; the second lane's begins when the first has announced.
  static Server server = start_server(lane);
  const std::string name = "lane" + std::to_string(lane.index);
  const PortableServer::ObjectId_var id = PortableServer::string_to_ObjectId(name.c_str());
  const PortableServer::ServantBase_var servant = new EchoServant(lane.priority);
  server.adapter->activate_object_with_id(id, servant.in());
  announce("corbaloc:" + server.addresses[lane.index] + name);
  return {};
}

Outcome<Exchange> connect(const PeerLane&, const std::string& address) {
  static const CORBA::ORB_var kOrb =
      start_orb({{"maxGIOPConnectionPerServer", "100"}, {"clientTransportRule", "* unix,tcp"}});
  const CORBA::Object_var object = kOrb->string_to_object(address.c_str());
  const peer::Echo_var echo = peer::Echo::_unchecked_narrow(object);
  return [echo](const PeerMessage& request, PeerMessage& reply) -> Outcome<> {
    static_assert(sizeof(peer::Message) == sizeof(PeerMessage));
    peer::Message message;
    std::memcpy(static_cast<void*>(&message), &request, sizeof message);
    message = echo->call(message);
    std::memcpy(static_cast<void*>(&reply), &message, sizeof message);
    return {};
  };
}

}  // namespace

const Peer kPeer{.serve = serve, .connect = connect, .guard = guard_corba};

}  // namespace rtpm::bench
