#include <capnp/ez-rpc.h>
#include <capnp/message.h>
#include <kj/async-io.h>
#include <peer.capnp.h>

#include "peer.hpp"

// Cap'n Proto's RPC, through EzRpc, as documented: an event loop for each thread, which reads and
// answers without handing work to another thread. There is nothing to tune: it sets TCP_NODELAY by
// itself and has no pools. A connection belongs to the event loop of the thread that made it, so a
// caller connects at the first call of the thread that uses it.
namespace rtpm::bench {
namespace {

class EchoServant final : public ::Echo::Server {
 protected:
  kj::Promise<void> call(CallContext context) override {
    const auto request = context.getParams().getRequest();
    answer(request.getWorkNs());
    context.getResults(capnp::MessageSize{16, 0}).setReply(request);
    return kj::READY_NOW;
  }
};

Outcome<> serve(const PeerLane& lane, const Announce& announce) {
  const bool is_unix = lane.transport == "unix";
  const std::string end = is_unix ? "unix:" + lane.socket_path() : std::string("127.0.0.1:0");
  capnp::EzRpcServer server(kj::heap<EchoServant>(), end);
  auto& scope = server.getWaitScope();
  const auto port = server.getPort().wait(scope);
  announce(is_unix ? end : "127.0.0.1:" + std::to_string(port));
  kj::NEVER_DONE.wait(scope);
}

struct Connection {
  explicit Connection(const std::string& address)
      : client(address), echo(client.getMain<::Echo>()) {}
  capnp::EzRpcClient client;
  ::Echo::Client echo;
};

Outcome<Exchange> connect(const PeerLane&, const std::string& address) {
  return [address](const PeerMessage& request, PeerMessage& reply) -> Outcome<> {
    thread_local Connection connection(address);
    auto call = connection.echo.callRequest(capnp::MessageSize{16, 0});
    auto sent = call.initRequest();
    sent.setWorkNs(request.work_ns);
    sent.setA(request.values[0]);
    sent.setB(request.values[1]);
    sent.setC(request.values[2]);
    sent.setD(request.values[3]);
    sent.setE(request.values[4]);
    const auto response = call.send().wait(connection.client.getWaitScope());
    const auto got = response.getReply();
    reply = {got.getWorkNs(), {got.getA(), got.getB(), got.getC(), got.getD(), got.getE()}};
    return {};
  };
}

}  // namespace

const Peer kPeer{.serve = serve, .connect = connect};

}  // namespace rtpm::bench
