#include <omniORB4/CORBA.h>
#include <omniEvents/CosEventChannelAdmin.hh>
#include <omniEvents/CosEventComm.hh>
#include <omniEvents/CosLifeCycle.hh>

#include <cstring>
#include <span>
#include <vector>

#include "peer.hpp"
#include "peer_port.hpp"
#include "rtpm/rt/clock.hpp"

// omniEvents: CORBA's event service, push at both ends. Its README has one thing to tune for
// latency: CyclePeriod_ns, the time between two transfers of the events that came in, 0.1 s unless
// the channel's creator says otherwise. For the ORB see omniorb_peer.cpp. All consumers are objects
// of one ORB, as it is with CORBA; it may open a connection for each.
namespace rtpm::bench {
namespace {

/// A channel that transfers more often would hardly let anything else on its CPU.
constexpr CORBA::ULong kCyclePeriodNs = 20'000;
using Octets = CORBA::OctetSeq;

class Consumer final : public POA_CosEventComm::PushConsumer,
                       public PortableServer::RefCountServantBase {
 public:
  Consumer(std::size_t number, EventBoard& board) : number_(number), board_(board) {}
  void push(const CORBA::Any& event) override {
    const Octets* octets = nullptr;
    if (!(event >>= octets)) return;
    board_.note(number_, std::as_bytes(std::span(octets->get_buffer(), octets->length())),
                rt::now());
  }
  void disconnect_push_consumer() override {}

 private:
  std::size_t number_;
  EventBoard& board_;
};

template <class Body>
expected<void, std::string> without_corba_exceptions(const Body& body) {
  try {
    body();
    return {};
  } catch (const CORBA::Exception& exception) {
    return unexpected{std::string("omniEvents: ") + exception._name()};
  }
}

class OmnieventsSide final : public PeerEventSide {
 public:
  [[nodiscard]] expected<void, std::string> begin(const std::string& factory, int consumer_count,
                                                  EventBoard& board) {
    return without_corba_exceptions([&] {
      start_orb();
      const auto channel = make_channel(factory);
      const CosEventChannelAdmin::ConsumerAdmin_var consumer_admin = channel->for_consumers();
      for (int i = 0; i < consumer_count; ++i) {
        const CosEventChannelAdmin::ProxyPushSupplier_var proxy =
            consumer_admin->obtain_push_supplier();
        auto* const consumer = new Consumer(static_cast<std::size_t>(i), board);
        const CosEventComm::PushConsumer_var reference = consumer->_this();
        proxy->connect_push_consumer(reference);
      }
      const CosEventChannelAdmin::SupplierAdmin_var supplier_admin = channel->for_suppliers();
      supplier_ = supplier_admin->obtain_push_consumer();
      supplier_->connect_push_supplier(CosEventComm::PushSupplier::_nil());
    });
  }

  expected<void, std::string> push(const EventStamp& stamp) override {
    return without_corba_exceptions([&] {
      Octets octets;
      octets.length(sizeof stamp);
      std::memcpy(octets.get_buffer(), &stamp, sizeof stamp);
      CORBA::Any event;
      event <<= octets;
      supplier_->push(event);
    });
  }

 private:
  void start_orb() {
    const char* options[][2] = {{"endPoint", "giop:tcp:127.0.0.1:"},
                                {"threadPerConnectionUpperLimit", "10000"},
                                {"scanGranularity", "0"},
                                {nullptr, nullptr}};
    int argument_count = 0;
    orb_ = CORBA::ORB_init(argument_count, nullptr, "omniORB4", options);
    const CORBA::Object_var object = orb_->resolve_initial_references("RootPOA");
    const PortableServer::POA_var poa = PortableServer::POA::_narrow(object);
    const PortableServer::POAManager_var manager = poa->the_POAManager();
    manager->activate();
  }

  [[nodiscard]] CosEventChannelAdmin::EventChannel_var make_channel(const std::string& address) {
    const CORBA::Object_var object = orb_->string_to_object(address.c_str());
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

  CORBA::ORB_var orb_{};
  CosEventChannelAdmin::ProxyPushConsumer_var supplier_{};
};

class OmnieventsPeer final : public Peer {
 public:
  std::optional<BrokerProgram> broker_program(const PeerLane& lane) override {
    const std::uint16_t port = free_port();
    return BrokerProgram{
        .command = {RTPM_OMNIEVENTS, "-f", "-p", std::to_string(port), "-l", lane.folder, "-t",
                    "/dev/null", "-ORBmaxGIOPConnectionPerServer", "300",
                    "-ORBthreadPerConnectionUpperLimit", "10000", "-ORBscanGranularity", "0"},
        .address = "corbaloc::127.0.0.1:" + std::to_string(port) + "/omniEvents",
        .port = port};
  }

  expected<std::unique_ptr<EventSide>, std::string> connect_events(const PeerLane&,
                                                                   const std::string& address,
                                                                   int consumer_count,
                                                                   EventBoard& board) override {
    return begin_side<OmnieventsSide>(address, consumer_count, board);
  }
};

}  // namespace

std::unique_ptr<Peer> make_peer() {
  return std::make_unique<OmnieventsPeer>();
}

}  // namespace rtpm::bench
