#include <grpcpp/grpcpp.h>

#include <peer.grpc.pb.h>
#include <vector>

#include "peer.hpp"

// gRPC. Its performance guide for C++: no synchronous server where latency counts, but completion
// queues, with as many threads as queues; so a lane is a server with one queue that the lane's
// thread takes from. Callers use the synchronous stub, which reads its reply on the calling thread,
// and a channel of their own, as gRPC would else share one connection among them. Deadlines are
// set, as gRPC's guide asks of everybody: long enough for its own threads, which have no priority
// and get a CPU that real-time threads keep busy only when the kernel throttles these, once a
// second. gRPC sets TCP_NODELAY by itself.
namespace rtpm::bench {
namespace {

/// One call that the server is ready for, used again and again.
class ServedCall {
 public:
  ServedCall(::peer::Echo::AsyncService& service, grpc::ServerCompletionQueue& queue)
      : service_(service), queue_(queue) {
    wait_for_request();
  }
  /// The queue has something for it: a request, or that the answer is on its way.
  void go_on() {
    if (has_answered_) {
      wait_for_request();
      return;
    }
    answer({.work_ns = request_.work_ns()});
    has_answered_ = true;
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

class GrpcCaller final : public PeerCaller {
 public:
  explicit GrpcCaller(const std::string& address) {
    grpc::ChannelArguments arguments;
    arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
    stub_ = ::peer::Echo::NewStub(
        grpc::CreateCustomChannel(address, grpc::InsecureChannelCredentials(), arguments));
  }

 protected:
  expected<void, std::string> exchange(const PeerMessage& request, PeerMessage& reply) override {
    grpc::ClientContext context;
    context.set_deadline(
        gpr_time_add(gpr_now(GPR_CLOCK_MONOTONIC), gpr_time_from_seconds(5, GPR_TIMESPAN)));
    sent_.set_work_ns(request.work_ns);
    sent_.mutable_values()->Assign(request.values.begin(), request.values.end());
    const grpc::Status status = stub_->Call(&context, sent_, &got_);
    if (!status.ok()) return unexpected{"gRPC: " + status.error_message()};
    if (static_cast<std::size_t>(got_.values_size()) != reply.values.size()) {
      return unexpected{std::string("gRPC: the reply has another size")};
    }
    reply.work_ns = got_.work_ns();
    std::copy(got_.values().begin(), got_.values().end(), reply.values.begin());
    return {};
  }

 private:
  std::unique_ptr<::peer::Echo::Stub> stub_{};
  ::peer::Message sent_{};
  ::peer::Message got_{};
};

class GrpcPeer final : public Peer {
 public:
  expected<void, std::string> serve(const PeerLane& lane,
                                    const Announce& publish_link_report) override {
    const bool is_unix = lane.transport == "unix";
    ::peer::Echo::AsyncService service;
    grpc::ServerBuilder builder;
    int port = 0;
    builder.AddListeningPort(is_unix ? "unix:" + lane.socket_path() : "127.0.0.1:0",
                             grpc::InsecureServerCredentials(), &port);
    builder.RegisterService(&service);
    const auto queue = builder.AddCompletionQueue();
    const auto server = builder.BuildAndStart();
    if (!server) return unexpected{std::string("gRPC can't start its server")};
    std::vector<std::unique_ptr<ServedCall>> calls;
    for (int i = 0; i < lane.connection_count + 1; ++i)
      calls.push_back(std::make_unique<ServedCall>(service, *queue));
    publish_link_report(is_unix ? "unix:" + lane.socket_path()
                                : "127.0.0.1:" + std::to_string(port));
    void* tag = nullptr;
    for (bool is_well = false; queue->Next(&tag, &is_well);)
      static_cast<ServedCall*>(tag)->go_on();
    return unexpected{std::string("gRPC's server ended")};
  }

  expected<std::unique_ptr<Caller>, std::string> connect(const PeerLane&,
                                                         const std::string& address) override {
    return std::unique_ptr<Caller>(std::make_unique<GrpcCaller>(address));
  }
};

}  // namespace

std::unique_ptr<Peer> make_peer() {
  return std::make_unique<GrpcPeer>();
}

}  // namespace rtpm::bench
