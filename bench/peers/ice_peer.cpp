#include <Ice/Ice.h>
#include <peer_ice.h>

#include <vector>

#include "peer.hpp"

// ZeroC Ice. Its manual's chapters on thread pools and on connections: one thread in the server's
// pool is the default, and enough for one caller at a time; connections need no heartbeats; Ice
// sets TCP_NODELAY by itself. Ice.ThreadPool.Server.ThreadPriority would set a nice value only, so
// each lane has a communicator of its own, with its own pools: the threads inherit the lane's
// scheduling. Ice has no transport of one host, and its UDP has no replies.
namespace rtpm::bench {
namespace {

Ice::CommunicatorHolder make_communicator() {
  Ice::InitializationData data;
  data.properties = Ice::createProperties();
  data.properties->setProperty("Ice.ThreadPool.Server.Size", "1");
  data.properties->setProperty("Ice.ThreadPool.Client.Size", "1");
  data.properties->setProperty("Ice.ACM.Client.Close", "0");
  data.properties->setProperty("Ice.ACM.Server.Close", "0");
  data.properties->setProperty("Ice.Default.InvocationTimeout", "1000");
  return Ice::CommunicatorHolder(data);
}

class EchoServant final : public ::peer::Echo {
 public:
  ::peer::Message call(::peer::Message request, const Ice::Current&) override {
    answer({.work_ns = static_cast<std::uint64_t>(request.workNs)});
    return request;
  }
};

class IceCaller final : public PeerCaller {
 public:
  explicit IceCaller(const std::string& address)
      : echo_(Ice::uncheckedCast<::peer::EchoPrx>(communicator_->stringToProxy(address))) {}

 protected:
  expected<void, std::string> exchange(const PeerMessage& request, PeerMessage& reply) override {
    const auto& v = request.values;
    const ::peer::Message got =
        echo_->call({static_cast<std::int64_t>(request.work_ns), v[0], v[1], v[2], v[3], v[4]});
    reply.work_ns = static_cast<std::uint64_t>(got.workNs);
    reply.values = {got.a, got.b, got.c, got.d, got.e};
    return {};
  }

 private:
  Ice::CommunicatorHolder communicator_ = make_communicator();
  std::shared_ptr<::peer::EchoPrx> echo_;
};

class IcePeer final : public Peer {
 public:
  expected<void, std::string> serve(const PeerLane&, const Announce& publish_link_report) override {
    // It serves until the process ends.
    auto& communicator = *new Ice::CommunicatorHolder(make_communicator());
    const auto adapter = communicator->createObjectAdapterWithEndpoints("lane", "tcp -h 127.0.0.1");
    const auto proxy = adapter->add(std::make_shared<EchoServant>(), Ice::stringToIdentity("echo"));
    adapter->activate();
    publish_link_report(proxy->ice_toString());
    return {};
  }

  expected<std::unique_ptr<Caller>, std::string> connect(const PeerLane&,
                                                         const std::string& address) override {
    return std::unique_ptr<Caller>(std::make_unique<IceCaller>(address));
  }
};

}  // namespace

std::unique_ptr<Peer> make_peer() {
  return std::make_unique<IcePeer>();
}

}  // namespace rtpm::bench
