#include "server.hpp"

#include <chrono>
#include <utility>

#include "rtpm/events/defaults.hpp"
#include "rtpm/rpc/refusal.hpp"

namespace rtpm::interop {
namespace {

using std::chrono::milliseconds;

/// Between two tries to write, or looks whether a pause is over.
constexpr auto kStep = milliseconds{1};

wire::Status status_of(Reason reason) {
  switch (reason) {
    case Reason::bad_request:
      return wire::Status::kBadRequest;
    case Reason::not_lease_holder:
      return wire::Status::kNotLeaseHolder;
    case Reason::gone:
      return wire::Status::kGone;
    case Reason::servant_failed:
      break;
  }
  return wire::Status::kServantFailed;
}

void finish_count(rpc::ReplyBuilder<Count>& reply, std::uint32_t count) {
  reply.finish(CreateCount(reply.builder(), count));
}

}  // namespace

Servant::~Servant() {
  is_ending_ = true;
  for (std::thread& thread : threads_)
    thread.join();
}

rpc::Result<void> Servant::echo_values(const Values& request, rpc::ReplyBuilder<Values>& reply,
                                       const rpc::CallContext&) {
  ValuesT values;
  request.UnPackTo(&values);
  reply.finish(Values::Pack(reply.builder(), &values));
  return {};
}

rpc::Result<void> Servant::echo_bytes(const Bytes& request, rpc::ReplyBuilder<Bytes>& reply,
                                      const rpc::CallContext&) {
  const auto bytes = reply.builder().CreateVector(request.bytes()->data(), request.bytes()->size());
  reply.finish(CreateBytes(reply.builder(), bytes));
  return {};
}

rpc::Result<void> Servant::add(const Count& request, rpc::ReplyBuilder<Count>& reply,
                               const rpc::CallContext&) {
  finish_count(reply, sum_ += request.count());
  return {};
}

rpc::Result<void> Servant::refuse(const Refusal&, const rpc::CallContext&) {
  return unexpected{rpc::Refusal::kFailed};  // dispatch() has answered before.
}

rpc::DispatchResult Servant::dispatch(std::uint16_t method_id, ConstBytes request,
                                      MutableBytes reply, const rpc::CallContext& context) {
  if (method_id == static_cast<std::uint16_t>(InteropMethodId::refuse) &&
      rpc::is_valid_table<Refusal>(request)) {
    const auto& refusal = *flatbuffers::GetRoot<Refusal>(request.data());
    const std::string text = refusal.text() == nullptr ? "" : refusal.text()->str();
    return rpc::refuse(status_of(refusal.reason()), text, reply);
  }
  return InteropServant::dispatch(method_id, request, reply, context);
}

void Servant::wait(const Pause& request, rpc::DeferredNothing reply, const rpc::CallContext&) {
  const auto until = std::chrono::steady_clock::now() + milliseconds{request.milliseconds()};
  const std::lock_guard lock(mutex_);
  threads_.emplace_back([this, until, reply = std::move(reply)]() mutable {
    while (!is_ending_ && reply.is_awaited() && std::chrono::steady_clock::now() < until)
      std::this_thread::sleep_for(kStep);
    reply.complete();
  });
}

rpc::Result<void> Servant::hold(const Pause& request, rpc::ReplyBuilder<Pausing>& reply,
                                const rpc::CallContext&) {
  std::this_thread::sleep_for(milliseconds{request.milliseconds()});
  reply.finish(CreatePausing(reply.builder(), true));
  return {};
}

rpc::Result<void> Servant::note_sent(const Note&, const rpc::CallContext&) {
  ++note_count_;
  return {};
}
rpc::Result<void> Servant::note_received(const Note&, const rpc::CallContext&) {
  ++note_count_;
  return {};
}
rpc::Result<void> Servant::note_done(const Note&, const rpc::CallContext&) {
  ++note_count_;
  return {};
}
rpc::Result<void> Servant::notes(rpc::ReplyBuilder<Notes>& reply, const rpc::CallContext&) {
  reply.finish(CreateNotes(reply.builder(), note_count_));
  return {};
}

void Servant::count_up(const Range& request, rpc::TableWriter<Item> items,
                       const rpc::CallContext&) {
  ++stream_count_;
  const std::uint32_t count = request.count();
  const std::uint32_t padding = request.padding();
  const bool fails = request.failure() != nullptr;
  const std::lock_guard lock(mutex_);
  threads_.emplace_back([this, count, padding, fails, items = std::move(items)]() mutable {
    for (std::uint32_t number = 0; count == 0 || number < count; ++number) {
      flatbuffers::FlatBufferBuilder builder;
      const std::vector<std::uint8_t> bytes(padding);
      builder.Finish(CreateItemDirect(builder, number, &bytes));
      auto written = items.write(builder);
      while (!written && written.error() == rpc::StreamError::kFull && !is_ending_) {
        std::this_thread::sleep_for(kStep);
        written = items.write(builder);
      }
      if (!written) break;
    }
    if (fails) {
      items.fail(rpc::Refusal::kFailed);
    } else {
      items.finish();
    }
    --stream_count_;
  });
}

rpc::Result<void> Servant::streams(rpc::ReplyBuilder<Count>& reply, const rpc::CallContext&) {
  finish_count(reply, stream_count_);
  return {};
}

rpc::Result<void> Servant::priority(rpc::ReplyBuilder<Priority>& reply,
                                    const rpc::CallContext& context) {
  reply.finish(
      CreatePriority(reply.builder(), static_cast<std::uint16_t>(context.priority.value())));
  return {};
}

rpc::Result<void> Servant::emit(const Emission& request, const rpc::CallContext&) {
  if (!supplier_) {
    auto created = MeasuredSupplier::create(hubs_, std::string(events::kHubPath));
    if (!created) return unexpected{rpc::Refusal::kFailed};
    supplier_.emplace(std::move(*created));
  }
  const std::string text = request.text() == nullptr ? "" : request.text()->str();
  for (std::uint32_t i = 0; i < request.count(); ++i) {
    flatbuffers::FlatBufferBuilder builder;
    builder.Finish(CreateMeasuredDirect(builder, request.first() + static_cast<std::int32_t>(i),
                                        text.c_str()));
    if (!supplier_->push(builder)) return unexpected{rpc::Refusal::kFailed};
  }
  return {};
}

}  // namespace rtpm::interop
