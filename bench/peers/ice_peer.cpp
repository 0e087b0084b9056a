#include <Ice/Ice.h>
#include <peer_ice.h>

#include "peer.hpp"

// ZeroC Ice. Its manual's chapters on thread pools and on connections: one thread in the server's
// pool is the default, and enough for one caller at a time; connections need no heartbeats; Ice
// sets TCP_NODELAY by itself. Ice.ThreadPool.Server.ThreadPriority would set a nice value only, so
// each lane has a communicator of its own, with its own pools: the threads inherit the lane's
// scheduling. Ice has no transport of one host, and its UDP has no replies.
namespace rtpm::bench {
namespace {

Ice::CommunicatorPtr make_communicator() {
  Ice::InitializationData data;
  data.properties = Ice::createProperties();
  data.properties->setProperty("Ice.ThreadPool.Server.Size", "1");
  data.properties->setProperty("Ice.ThreadPool.Client.Size", "1");
  data.properties->setProperty("Ice.ACM.Client.Close", "0");
  data.properties->setProperty("Ice.ACM.Server.Close", "0");
  data.properties->setProperty("Ice.Default.InvocationTimeout", "1000");
  // It lives until the process ends.
  return *new Ice::CommunicatorPtr(Ice::initialize(data));
}

class EchoServant final : public ::peer::Echo {
 public:
  ::peer::Message call(::peer::Message request, const Ice::Current&) override {
    answer(static_cast<std::uint64_t>(request.workNs));
    return request;
  }
};

Outcome<> serve(const PeerLane&, const Announce& announce) {
  const auto adapter =
      make_communicator()->createObjectAdapterWithEndpoints("lane", "tcp -h 127.0.0.1");
  const auto proxy = adapter->add(std::make_shared<EchoServant>(), Ice::stringToIdentity("echo"));
  adapter->activate();
  announce(proxy->ice_toString());
  return {};
}

Outcome<Exchange> connect(const PeerLane&, const std::string& address) {
  const auto proxy = make_communicator()->stringToProxy(address);
  return [echo = Ice::uncheckedCast<::peer::EchoPrx>(proxy)](const PeerMessage& request,
                                                             PeerMessage& reply) -> Outcome<> {
    const auto& v = request.values;
    const ::peer::Message got =
        echo->call({static_cast<std::int64_t>(request.work_ns), v[0], v[1], v[2], v[3], v[4]});
    reply = {static_cast<std::uint64_t>(got.workNs), {got.a, got.b, got.c, got.d, got.e}};
    return {};
  };
}

}  // namespace

const Peer kPeer{.serve = serve, .connect = connect};

}  // namespace rtpm::bench
