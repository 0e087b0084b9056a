#include <omniEvents/CosEventChannelAdmin.hh>
#include <omniEvents/CosEventComm.hh>
#include <omniEvents/CosLifeCycle.hh>

#include <cstring>

#include "corba.hpp"
#include "peer.hpp"

// omniEvents: CORBA's event service, push at both ends. Its README names one option for latency:
// CyclePeriod_ns, the time between two transfers of the received events, 0.1 s unless the channel's
// creator sets another. For the ORB see omniorb_peer.cpp. All consumers are objects of one ORB, as
// usual with CORBA; it may open a connection for each.
namespace rtpm::bench {
namespace {

/// A channel that transfers more often would hardly leave time on its CPU for other threads.
constexpr CORBA::ULong kCyclePeriodNs = 20'000;
using Octets = CORBA::OctetSeq;

class Consumer final : public POA_CosEventComm::PushConsumer,
                       public PortableServer::RefCountServantBase {
 public:
  explicit Consumer(const Note& note) : note_(note) {}
  void push(const CORBA::Any& event) override {
    const Octets* octets = nullptr;
    if (event >>= octets) note_(octets->get_buffer(), octets->length());
  }
  void disconnect_push_consumer() override {}

 private:
  const Note& note_;
};

BrokerProgram broker_program(const PeerLane& lane) {
  const std::uint16_t port = free_port();
  return {.command = {RTPM_BROKER, "-f", "-p", std::to_string(port), "-l", lane.folder, "-t",
                      "/dev/null", "-ORBmaxGIOPConnectionPerServer", "300",
                      "-ORBthreadPerConnectionUpperLimit", "10000", "-ORBscanGranularity", "0"},
          .address = "corbaloc::127.0.0.1:" + std::to_string(port) + "/omniEvents",
          .port = port};
}

CosEventChannelAdmin::EventChannel_var make_channel(const std::string& address) {
  static const CORBA::ORB_var kOrb = start_orb({{"endPoint", "giop:tcp:127.0.0.1:"}});
  activate_adapter(kOrb, "RootPOA");
  const CORBA::Object_var object = kOrb->string_to_object(address.c_str());
  const CosLifeCycle::GenericFactory_var factory = CosLifeCycle::GenericFactory::_narrow(object);
  CosLifeCycle::Key key;
  key.length(1);
  key[0].id = CORBA::string_dup("EventChannel");
  key[0].kind = CORBA::string_dup("object interface");
  CosLifeCycle::Criteria criteria;
  criteria.length(1);
  criteria[0].name = CORBA::string_dup("CyclePeriod_ns");
  criteria[0].value <<= kCyclePeriodNs;
  const CORBA::Object_var channel = factory->create_object(key, criteria);
  return CosEventChannelAdmin::EventChannel::_narrow(channel);
}

const CosEventChannelAdmin::EventChannel_var& channel_of(const std::string& address) {
  static const CosEventChannelAdmin::EventChannel_var kChannel = make_channel(address);
  return kChannel;
}

expected<Push, std::string> connect_supplier(const PeerLane&, const std::string& address) {
  const CosEventChannelAdmin::SupplierAdmin_var admin = channel_of(address)->for_suppliers();
  const CosEventChannelAdmin::ProxyPushConsumer_var proxy = admin->obtain_push_consumer();
  proxy->connect_push_supplier(CosEventComm::PushSupplier::_nil());
  return [proxy](const EventStamp& stamp) -> Outcome {
    Octets octets;
    octets.length(sizeof stamp);
    std::memcpy(octets.get_buffer(), &stamp, sizeof stamp);
    CORBA::Any event;
    event <<= octets;
    proxy->push(event);
    return {};
  };
}

expected<Consume, std::string> connect_consumer(const PeerLane&, const std::string& address,
                                                Note& note) {
  const CosEventChannelAdmin::ConsumerAdmin_var admin = channel_of(address)->for_consumers();
  const CosEventChannelAdmin::ProxyPushSupplier_var proxy = admin->obtain_push_supplier();
  const CosEventComm::PushConsumer_var consumer = (new Consumer(note))->_this();
  proxy->connect_push_consumer(consumer);
  return Consume();
}

}  // namespace

const Peer kPeer{.broker_program = broker_program,
                 .connect_supplier = connect_supplier,
                 .connect_consumer = connect_consumer,
                 .guard = guard_corba};

}  // namespace rtpm::bench
