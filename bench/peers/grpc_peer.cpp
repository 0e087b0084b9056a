#include <grpcpp/grpcpp.h>

#include <peer.grpc.pb.h>

#include "peer.hpp"

// gRPC. Its performance guide for C++ recommends completion queues instead of a synchronous server
// where latency counts, with as many threads as queues; so a lane is a server with one queue that
// the lane's thread takes from. Callers use the synchronous stub, which reads its reply on the
// calling thread, and a channel of their own, as gRPC would otherwise share one connection among
// them. Deadlines are set, as gRPC's guide asks: long enough for its own threads, which have no
// priority and get a CPU that real-time threads keep busy only when the kernel throttles these,
// once a second. gRPC sets TCP_NODELAY by itself.
namespace rtpm::bench {
namespace {

/// One call that the server is ready for, used again and again.
class ServedCall {
 public:
  ServedCall(::peer::Echo::AsyncService& service, grpc::ServerCompletionQueue& queue)
      : service_(service), queue_(queue) {
    wait_for_request();
  }
  /// The queue has an event for it: a request, or that the answer is on its way.
  void go_on() {
    if (std::exchange(has_answered_, true)) return wait_for_request();
    answer(request_.work_ns());
    writer_->Finish(request_, grpc::Status::OK, this);
  }

 private:
  void wait_for_request() {
    has_answered_ = false;
    writer_.reset();
    context_ = std::make_unique<grpc::ServerContext>();
    writer_ = std::make_unique<grpc::ServerAsyncResponseWriter<::peer::Message>>(context_.get());
    service_.RequestCall(context_.get(), &request_, writer_.get(), &queue_, &queue_, this);
  }

  ::peer::Echo::AsyncService& service_;
  grpc::ServerCompletionQueue& queue_;
  ::peer::Message request_{};
  bool has_answered_ = false;
  std::unique_ptr<grpc::ServerContext> context_{};
  std::unique_ptr<grpc::ServerAsyncResponseWriter<::peer::Message>> writer_{};
};

Outcome<> serve(const PeerLane& lane, const Announce& announce) {
  const bool is_unix = lane.transport == "unix";
  const std::string end = is_unix ? "unix:" + lane.socket_path() : std::string("127.0.0.1:0");
  ::peer::Echo::AsyncService service;
  grpc::ServerBuilder builder;
  int port = 0;
  builder.AddListeningPort(end, grpc::InsecureServerCredentials(), &port);
  builder.RegisterService(&service);
  const auto queue = builder.AddCompletionQueue();
  const auto server = builder.BuildAndStart();
  if (!server) return failure_of("gRPC", "start");
  std::vector<std::unique_ptr<ServedCall>> calls;
  for (int i = 0; i < lane.connection_count + 1; ++i)
    calls.push_back(std::make_unique<ServedCall>(service, *queue));
  announce(is_unix ? end : "127.0.0.1:" + std::to_string(port));
  void* tag = nullptr;
  for (bool is_well = false; queue->Next(&tag, &is_well);)
    static_cast<ServedCall*>(tag)->go_on();
  return failure_of("gRPC", "server");
}

struct GrpcCaller {
  explicit GrpcCaller(const std::string& address) {
    grpc::ChannelArguments arguments;
    arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
    stub = ::peer::Echo::NewStub(
        grpc::CreateCustomChannel(address, grpc::InsecureChannelCredentials(), arguments));
  }

  [[nodiscard]] Outcome<> exchange(const PeerMessage& request, PeerMessage& reply) {
    grpc::ClientContext context;
    context.set_deadline(
        gpr_time_add(gpr_now(GPR_CLOCK_MONOTONIC), gpr_time_from_seconds(5, GPR_TIMESPAN)));
    sent.set_work_ns(request.work_ns);
    sent.mutable_values()->Assign(request.values.begin(), request.values.end());
    const grpc::Status status = stub->Call(&context, sent, &got);
    if (!status.ok()) return failure_of("gRPC", "call", status.error_message().c_str());
    if (static_cast<std::size_t>(got.values_size()) != reply.values.size()) {
      return failure("gRPC: the reply has another size");
    }
    reply.work_ns = got.work_ns();
    std::copy(got.values().begin(), got.values().end(), reply.values.begin());
    return {};
  }

  std::unique_ptr<::peer::Echo::Stub> stub{};
  ::peer::Message sent{};
  ::peer::Message got{};
};

Outcome<Exchange> connect(const PeerLane&, const std::string& address) {
  return [caller = std::make_shared<GrpcCaller>(address)](const PeerMessage& request,
                                                          PeerMessage& reply) {
    return caller->exchange(request, reply);
  };
}

}  // namespace

const Peer kPeer{.serve = serve, .connect = connect};

}  // namespace rtpm::bench
