#include "tap_server.hpp"

#include <algorithm>
#include <utility>

#include "rtpm/introspection/catalog.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/memory.hpp"

namespace rtpm::introspection {
namespace {

/// The interval at which the rings are read, and the longest interval between items.
constexpr Duration kPeriod = std::chrono::milliseconds{5};
constexpr Duration kQuietPeriod = std::chrono::milliseconds{500};
/// An item is sent once it has this size.
constexpr std::size_t kItemByteMin = std::size_t{32} * 1024;
/// Maximum number of objects and methods in a request.
constexpr std::size_t kSelectionMax = 1024;

std::optional<rpc::TapConfig> config_of(const TapRequest& request) {
  rpc::TapConfig config{.excluded_path = std::string(kTapPath),
                        .has_payloads = request.has_payloads(),
                        .payload_byte_max = request.payload_byte_max()};
  if (request.objects() == nullptr) return config;
  std::size_t count = request.objects()->size();
  for (const TappedObject* object : *request.objects()) {
    rpc::TappedObject wanted{.path = object->path()->str()};
    if (object->methods() != nullptr) {
      count += object->methods()->size();
      wanted.methods.assign(object->methods()->begin(), object->methods()->end());
    }
    config.objects.push_back(std::move(wanted));
    if (count > kSelectionMax) return std::nullopt;
  }
  return config;
}

void refuse(rpc::TableWriter<TapBatch>& items, const std::string& why) {
  flatbuffers::FlatBufferBuilder builder;
  const auto text = builder.CreateString(why);
  TapBatchBuilder batch(builder);
  batch.add_refusal(text);
  builder.Finish(batch.Finish());
  static_cast<void>(items.write(builder));
  items.finish();
}

}  // namespace

TapServer::~TapServer() {
  is_ending_.store(true, std::memory_order_release);
  wake_.post();
  thread_.join();
}

expected<void, SetupError> TapServer::start() {
  auto thread = rt::Thread::start({.name = "rtpm-tap", .realtime = rt::RealtimeMode::kOff},
                                  [this] { run(); });
  if (!thread) return unexpected{std::move(thread.error())};
  thread_ = std::move(*thread);
  return {};
}

void TapServer::tap(const TapRequest& request, rpc::TableWriter<TapBatch> items,
                    const rpc::CallContext&) {
  const rt::AllowAllocationScope is_allowed;
  auto config = config_of(request);
  if (!config) return refuse(items, "The tap is asked for more objects and methods than 1024.");
  if (is_busy_.exchange(true, std::memory_order_acq_rel)) {
    return refuse(items, "The server's calls are tapped already, by another client: end that tap.");
  }
  {
    const std::lock_guard lock(mutex_);
    arriving_ = {std::move(*config), std::move(items)};
  }
  wake_.post();
}

std::optional<TapServer::Client> TapServer::take_client() noexcept {
  const std::lock_guard lock(mutex_);
  return std::exchange(arriving_, std::nullopt);
}

void TapServer::run() noexcept {
  while (!is_ending_.load(std::memory_order_acquire)) {
    static_cast<void>(wake_.wait_until(kNever));
    if (auto client = take_client()) {
      serve(std::move(*client));
      is_busy_.store(false, std::memory_order_release);
    }
  }
}

// Runs until the client is gone, or one of the two servers ends.
void TapServer::serve(Client client) noexcept {
  if (const auto switched = tap_->switch_on(client.config); !switched) {
    return refuse(client.items, switched.error().text());
  }
  too_large_count_ = 0;
  static_cast<void>(send(client.items, /*is_first=*/true));
  MonotonicTime quiet_end = rt::now() + kQuietPeriod;
  while (client.items.is_awaited() && tap_->is_on() &&
         !is_ending_.load(std::memory_order_acquire)) {
    static_cast<void>(wake_.wait_until(rt::now() + kPeriod));
    send_calls(client.items);
    if (rt::now() < quiet_end) continue;
    quiet_end = rt::now() + kQuietPeriod;
    static_cast<void>(send(client.items, /*is_first=*/false));
  }
  tap_->switch_off();
  client.items.finish();
  calls_ = {};
  payloads_ = {};
}

// While the client accepts no more, calls stay in the rings, which count the calls that they drop.
void TapServer::send_calls(rpc::TableWriter<TapBatch>& items) noexcept {
  if (!calls_.empty() && !send(items, /*is_first=*/false)) return;
  while (const auto call = tap_->next()) {
    collect(*call);
    const std::size_t size = calls_.size() * sizeof(TappedCall) + payloads_.size();
    if (size >= kItemByteMin && !send(items, /*is_first=*/false)) return;
  }
  if (!calls_.empty()) static_cast<void>(send(items, /*is_first=*/false));
}

void TapServer::collect(const rpc::TappedCall& call) {
  const auto add = [this](ConstBytes payload) {
    const auto* const begin = reinterpret_cast<const std::uint8_t*>(payload.data());
    payloads_.insert(payloads_.end(), begin, begin + payload.size());
  };
  add(call.request);
  add(call.reply);
  calls_.emplace_back(call.number, call.session, call.trace_id, to_ns(call.received),
                      to_ns(call.finished), call.request_size, call.reply_size, call.service - 1,
                      call.method, static_cast<std::uint16_t>(call.priority.value()),
                      static_cast<CallStatus>(call.status), static_cast<TapStage>(call.stage),
                      call.request.size() == call.request_size,
                      call.reply.size() == call.reply_size);
}

// Sends the collected calls and the losses; false if the client accepts no more for now.
bool TapServer::send(rpc::TableWriter<TapBatch>& items, bool is_first) noexcept {
  builder_.Clear();
  flatbuffers::Offset<flatbuffers::Vector<flatbuffers::Offset<flatbuffers::String>>> objects;
  if (is_first) objects = builder_.CreateVectorOfStrings(tap_->objects());
  const auto payloads = builder_.CreateVector(payloads_);
  const auto calls = builder_.CreateVectorOfStructs(calls_);
  const rpc::TapLosses losses = tap_->losses();
  TapBatchBuilder batch(builder_);
  if (is_first) batch.add_objects(objects);
  batch.add_calls(calls);
  batch.add_payloads(payloads);
  batch.add_dropped_count(losses.dropped_count + too_large_count_);
  batch.add_omitted_payload_count(losses.omitted_payload_count);
  builder_.Finish(batch.Finish());
  const auto written = items.write(builder_);
  if (!written && written.error() == rpc::StreamError::kFull) return false;
  if (!written && written.error() == rpc::StreamError::kTooLarge) {
    too_large_count_ += calls_.size();
  }
  calls_.clear();
  payloads_.clear();
  return true;
}

}  // namespace rtpm::introspection
