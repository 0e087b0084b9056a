#include "rtpm/capture/call_recorder.hpp"

#include <atomic>
#include <chrono>
#include <introspection.rtpm.events.hpp>
#include <introspection.rtpm.hpp>
#include <map>
#include <mutex>
#include <span>
#include <utility>

#include "flatbuffer_channel.hpp"
#include "rtpm/base/assert.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/dynamic/remote_object.hpp"
#include "rtpm/introspection/catalog.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/pi_mutex.hpp"
#include "rtpm/rt/thread.hpp"
#include "rtpm/wire/clock_sync.hpp"
#include "rtpm/wire/url.hpp"

namespace rtpm::capture {
namespace {

using introspection::TapBatch;
using introspection::TapClient;
using introspection::TappedCall;
using introspection::TapStage;
using TapStream = rpc::TableStream<TapBatch>;

constexpr Duration kLookInterval = std::chrono::milliseconds{100};
/// A server reads its rings every 5 ms.
constexpr Duration kRestTime = std::chrono::milliseconds{30};
constexpr Duration kNoteInterval = std::chrono::seconds{1};
/// A payload with its enclosing table must fit a message of the recorder.
constexpr std::size_t kTableByteMax = 1024;

/// Times of a call, converted to the recording's clock.
struct CallTimes {
  std::uint64_t received_ns = 0;
  std::uint64_t finished_ns = 0;
  std::uint64_t log_ns = 0;
};

/// The channels of an object's calls.
/// @threads  one
class CallChannels {
 public:
  CallChannels(recording::Recorder& recorder, recording::Recorder::Track& track, std::string path,
               std::unique_ptr<dynamic::RemoteObject> object) noexcept
      : recorder_(recorder), track_(track), path_(std::move(path)), object_(std::move(object)) {}

  /// Adds the channel for the outcomes of calls.
  /// @errors  an error of the file
  [[nodiscard]] expected<void, SetupError> open();
  /// Records a call from the tap. Returns the number of payloads that did not match their schema.
  int record(const TappedCall& call, ConstBytes request, ConstBytes reply, const CallTimes& times);

 private:
  enum class Part : std::uint8_t { kRequest, kResponse };
  [[nodiscard]] const schema::Method* method_of(std::uint16_t id) const noexcept;
  /// Finds or adds the channel for a method's request or response; nullopt if the file has no
  /// channel left.
  [[nodiscard]] std::optional<std::uint16_t> channel_of(const schema::Method& method, Part part);
  /// Records a payload; false if it does not match its schema.
  bool record_payload(const schema::Method& method, Part part, ConstBytes payload,
                      recording::Message message);
  void record_end(const TappedCall& call, const schema::Method* method, const CallTimes& times);

  recording::Recorder& recorder_;
  recording::Recorder::Track& track_;
  std::string path_;
  std::unique_ptr<dynamic::RemoteObject> object_;
  std::uint16_t record_channel_ = 0;
  std::map<std::pair<std::uint16_t, Part>, std::uint16_t> channels_{};
  flatbuffers::FlatBufferBuilder builder_{};
};

std::vector<std::byte> empty_table() {
  flatbuffers::FlatBufferBuilder builder;
  const auto begin = builder.StartTable();
  builder.Finish(flatbuffers::Offset<flatbuffers::Table>(builder.EndTable(begin)));
  const ConstBytes bytes = rpc::table_bytes(builder);
  return {bytes.begin(), bytes.end()};
}

expected<void, SetupError> CallChannels::open() {
  const events::EventDescriptor& type = introspection::CallRecordEvent::kDescriptor;
  std::string error;
  const auto dynamic = schema::Dynamic::make_for_event(std::string(type.schema), type.name, error);
  if (!dynamic) return setup_error("the schema of " + std::string(type.name), error);
  const auto number =
      add_flatbuffer_channel(recorder_, *dynamic, std::string(type.name), path_ + "/calls",
                             {{"rtpm.kind", "calls"},
                              {"rtpm.object", path_},
                              {"rtpm.interface", object_->dynamic().service().name}});
  if (!number) return unexpected{number.error()};
  record_channel_ = *number;
  return {};
}

const schema::Method* CallChannels::method_of(std::uint16_t id) const noexcept {
  for (const schema::Method& method : object_->dynamic().service().methods) {
    if (method.id == id) return &method;
  }
  return nullptr;
}

std::optional<std::uint16_t> CallChannels::channel_of(const schema::Method& method, Part part) {
  if (const auto known = channels_.find({method.id, part}); known != channels_.end()) {
    return known->second;
  }
  schema::Dynamic& dynamic = object_->dynamic();
  const schema::Payload& payload = part == Part::kRequest ? method.request : method.reply;
  const char* const name = part == Part::kRequest ? "request" : "response";
  const auto number =
      add_flatbuffer_channel(recorder_, dynamic, dynamic.model().objects[payload.table].name,
                             path_ + "/" + method.name + "/" + name,
                             {{"rtpm.kind", "call"},
                              {"rtpm.part", name},
                              {"rtpm.object", path_},
                              {"rtpm.interface", dynamic.service().name},
                              {"rtpm.method", method.name},
                              {"rtpm.method_id", std::to_string(method.id)}});
  if (!number) return std::nullopt;
  channels_[{method.id, part}] = *number;
  return *number;
}

bool CallChannels::record_payload(const schema::Method& method, Part part, ConstBytes payload,
                                  recording::Message message) {
  const schema::Payload& type = part == Part::kRequest ? method.request : method.reply;
  const auto table = type.kind == schema::PayloadKind::kEmpty
                         ? std::optional(empty_table())
                         : object_->dynamic().as_table(type, payload);
  if (!table) return false;
  const auto channel = channel_of(method, part);
  if (!channel) return true;
  message.channel_id = *channel;
  message.data = *table;
  static_cast<void>(track_.put(message));
  return true;
}

int CallChannels::record(const TappedCall& call, ConstBytes request, ConstBytes reply,
                         const CallTimes& times) {
  const schema::Method* const method = method_of(call.method());
  const TapStage stage = call.stage();
  const bool is_end = stage == TapStage::Whole || stage == TapStage::Ended;
  int unreadable_count = 0;
  recording::Message message{.sequence = static_cast<std::uint32_t>(call.number()),
                             .log_time_ns = times.log_ns};
  if (method != nullptr && call.has_request() &&
      (stage == TapStage::Whole || stage == TapStage::Begun)) {
    message.publish_time_ns = times.received_ns;
    if (!record_payload(*method, Part::kRequest, request, message)) ++unreadable_count;
  }
  // The end of a stream has no content.
  const bool has_response = call.has_reply() && call.status() == introspection::CallStatus::ok &&
                            (stage == TapStage::Item || is_end) &&
                            !(method != nullptr && method->is_stream && is_end);
  if (method != nullptr && has_response) {
    message.publish_time_ns = times.finished_ns;
    if (!record_payload(*method, Part::kResponse, reply, message)) ++unreadable_count;
  }
  if (is_end) record_end(call, method, times);
  return unreadable_count;
}

void CallChannels::record_end(const TappedCall& call, const schema::Method* method,
                              const CallTimes& times) {
  builder_.Clear();
  const auto name = method == nullptr ? 0 : builder_.CreateString(method->name);
  builder_.Finish(introspection::CreateCallRecord(
      builder_, call.number(), name, call.method(), call.status(), call.priority(), call.session(),
      call.trace_id(), call.finished_ns() - call.received_ns(), call.request_size(),
      call.reply_size()));
  static_cast<void>(track_.put({.channel_id = record_channel_,
                                .sequence = static_cast<std::uint32_t>(call.number()),
                                .log_time_ns = times.log_ns,
                                .publish_time_ns = times.finished_ns,
                                .data = rpc::table_bytes(builder_)}));
}

/// Binds the tap of the server, or explains why it can't.
expected<TapClient, SetupError> bind_tap(rpc::Node& node, const std::string& server) {
  const std::string url = server + "/" + std::string(introspection::kTapPath);
  const auto tried = rpc::Binding::bind(node, url, TapClient::interface());
  if (!tried && tried.error().cause == rpc::CallError::kNoSuchObject) {
    return setup_error(
        server + " has no tap", "",
        "let its program serve its catalog by rtpm::introspection::Catalog::serve()");
  }
  return TapClient::bind(node, url);
}

std::string text(const flatbuffers::String* string) {
  return string == nullptr ? std::string() : string->str();
}

}  // namespace

struct CallRecorder::Impl {
  Impl(recording::Recorder& its_recorder, Duration its_deadline)
      : recorder(its_recorder), track(its_recorder.add_track()), deadline(its_deadline) {}

  [[nodiscard]] expected<void, SetupError> open(rpc::Node& node,
                                                const std::vector<std::string>& urls);
  [[nodiscard]] expected<void, SetupError> begin(introspection::TapRequestT request);
  void run();
  void take_rest();
  void take(const TapBatch& batch);
  void take_call(const TappedCall& call, ConstBytes& payloads);
  void learn_clock();
  void note_losses();
  [[nodiscard]] std::uint64_t log_time(std::int64_t server_time_ns) const {
    return recorder.log_time_ns(time_from_ns(server_time_ns) - offset);
  }

  recording::Recorder& recorder;
  recording::Recorder::Track& track;
  Duration deadline;
  std::string server{};
  std::optional<TapClient> client{};
  std::optional<TapStream> stream{};
  std::map<std::string, std::unique_ptr<CallChannels>> objects{};
  std::vector<CallChannels*> by_number{};  ///< Indexed by the server's object numbers.
  Duration offset{};                       ///< The server's clock minus this host's.
  mutable rt::PiMutex mutex{};
  CallRecorderStatus status{};        ///< Guarded by the mutex.
  CallRecorderStatus noted_status{};  ///< The status last written to the file.
  std::atomic<bool> is_stopping{false};
  rt::Thread thread{};
};

expected<void, SetupError> CallRecorder::Impl::open(rpc::Node& node,
                                                    const std::vector<std::string>& urls) {
  introspection::TapRequestT request;
  const std::size_t payload_byte_max = recorder.message_byte_max() - kTableByteMax;
  request.payload_byte_max = static_cast<std::uint32_t>(payload_byte_max);
  for (const std::string& url : urls) {
    const auto parts = wire::parse_url(url);
    if (!parts) return setup_error("'" + url + "' is no URL", "", "write rtpm://host:port/path");
    server = "rtpm://" + parts->authority();
    auto object = dynamic::RemoteObject::open(node, url);
    if (!object) return unexpected{std::move(object.error())};
    auto& channels = objects[parts->path];
    channels = std::make_unique<CallChannels>(recorder, track, parts->path, std::move(*object));
    if (auto opened = channels->open(); !opened) return opened;
    auto wanted = std::make_unique<introspection::TappedObjectT>();
    wanted->path = parts->path;
    request.objects.push_back(std::move(wanted));
  }
  auto bound = bind_tap(node, server);
  if (!bound) return unexpected{std::move(bound.error())};
  client.emplace(std::move(*bound));
  learn_clock();
  return begin(std::move(request));
}

// Waits for the first item, which tells whether the tap is on.
expected<void, SetupError> CallRecorder::Impl::begin(introspection::TapRequestT request) {
  auto opened = client->tap(request);
  if (!opened) return setup_error("the tap of " + server, opened.error());
  stream.emplace(std::move(*opened));
  const auto first = stream->next(rt::now() + deadline);
  if (!first) return setup_error("the tap of " + server, first.error());
  if (*first == nullptr) return setup_error("the tap of " + server + " ended at once");
  if ((*first)->refusal() != nullptr) {
    return setup_error("the tap of " + server, printable(text((*first)->refusal())));
  }
  if ((*first)->objects() == nullptr)
    return setup_error("the tap of " + server + " has no objects");
  for (const flatbuffers::String* path : *(*first)->objects()) {
    const auto found = objects.find(text(path));
    by_number.push_back(found == objects.end() ? nullptr : found->second.get());
  }
  auto started = rt::Thread::start({.name = "rtpm-calls", .realtime = rt::RealtimeMode::kOff},
                                   [this] { run(); });
  if (!started) return unexpected{std::move(started.error())};
  thread = std::move(*started);
  return {};
}

void CallRecorder::Impl::run() {
  MonotonicTime note_time = rt::now() + kNoteInterval;
  while (!is_stopping.load(std::memory_order_acquire)) {
    const auto item = stream->next(rt::now() + kLookInterval);
    if (item && *item != nullptr) {
      take(**item);
    } else if (item || item.error() != rpc::CallError::kTimeout || !stream->is_open()) {
      const std::lock_guard lock(mutex);
      status.problem = server + ": the tap ended: " +
                       (item ? "the server stops" : std::string(to_string(item.error())));
      break;
    }
    if (rt::now() < note_time) continue;
    note_time = rt::now() + kNoteInterval;
    learn_clock();
    note_losses();
  }
  take_rest();
  note_losses();
}

// Receives the batches that the server sends until it has read its rings again.
void CallRecorder::Impl::take_rest() {
  const MonotonicTime end = rt::now() + kRestTime;
  while (true) {
    const auto item = stream->next(end);
    if (!item || *item == nullptr) break;
    take(**item);
  }
}

void CallRecorder::Impl::take(const TapBatch& batch) {
  ConstBytes payloads;
  if (batch.payloads() != nullptr) {
    payloads = std::as_bytes(std::span(batch.payloads()->data(), batch.payloads()->size()));
  }
  if (batch.calls() != nullptr) {
    for (const TappedCall* call : *batch.calls())
      take_call(*call, payloads);
  }
  const std::lock_guard lock(mutex);
  status.dropped_count = batch.dropped_count();
  status.omitted_payload_count = batch.omitted_payload_count();
}

// Takes the call's payloads from the front of `payloads`.
void CallRecorder::Impl::take_call(const TappedCall& call, ConstBytes& payloads) {
  const auto take_front = [&](bool is_there, std::uint32_t size) {
    const ConstBytes front =
        payloads.first(is_there ? std::min<std::size_t>(size, payloads.size()) : 0);
    payloads = payloads.subspan(front.size());
    return front;
  };
  const ConstBytes request = take_front(call.has_request(), call.request_size());
  const ConstBytes reply = take_front(call.has_reply(), call.reply_size());
  CallChannels* const object =
      call.object() < by_number.size() ? by_number[call.object()] : nullptr;
  if (object == nullptr) return;
  const CallTimes times{.received_ns = log_time(call.received_ns()),
                        .finished_ns = log_time(call.finished_ns()),
                        .log_ns = recorder.log_time_ns(rt::now())};
  const int unreadable_count = object->record(call, request, reply, times);
  const bool is_end = call.stage() == TapStage::Whole || call.stage() == TapStage::Ended;
  const std::lock_guard lock(mutex);
  status.call_count += is_end ? 1 : 0;
  status.unreadable_count += static_cast<std::uint64_t>(unreadable_count);
}

void CallRecorder::Impl::learn_clock() {
  const auto clock = client->binding().ping({.deadline = deadline});
  if (clock && clock->uncertainty < Duration::max()) offset = clock->offset;
}

// Writes the counts into the file if they have changed.
void CallRecorder::Impl::note_losses() {
  CallRecorderStatus now;
  {
    const std::lock_guard lock(mutex);
    now = status;
  }
  if (now.dropped_count == noted_status.dropped_count &&
      now.omitted_payload_count == noted_status.omitted_payload_count &&
      now.unreadable_count == noted_status.unreadable_count) {
    return;
  }
  const auto written = recorder.write(recording::Metadata{
      .name = "rtpm.calls",
      .values = {{"server", server},
                 {"dropped", std::to_string(now.dropped_count)},
                 {"omitted_payloads", std::to_string(now.omitted_payload_count)},
                 {"unreadable_payloads", std::to_string(now.unreadable_count)}}});
  // The recorder's status tells when the file is full.
  if (written) noted_status = now;
}

CallRecorder::CallRecorder(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}

CallRecorder::~CallRecorder() {
  stop();
}

void CallRecorder::stop() noexcept {
  impl_->is_stopping.store(true, std::memory_order_release);
  impl_->thread.join();
  if (impl_->stream) impl_->stream->cancel();
}

expected<std::unique_ptr<CallRecorder>, SetupError> CallRecorder::open(
    recording::Recorder& recorder, rpc::Node& node, const std::vector<std::string>& urls,
    Duration deadline) {
  auto impl = std::make_unique<Impl>(recorder, deadline);
  if (auto opened = impl->open(node, urls); !opened) return unexpected{std::move(opened.error())};
  return std::unique_ptr<CallRecorder>(new CallRecorder(std::move(impl)));
}

CallRecorderStatus CallRecorder::status() const {
  const std::lock_guard lock(impl_->mutex);
  return impl_->status;
}

}  // namespace rtpm::capture
