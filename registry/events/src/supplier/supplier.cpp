#include "rtpm/events/supplier.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <condition_variable>
#include <limits>
#include <mutex>
#include <utility>

#include "idl.hpp"
#include "rtpm/base/latest.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/host.hpp"
#include "rtpm/rt/pi_mutex.hpp"
#include "rtpm/rt/thread.hpp"
#include "rtpm/wire/clock_sync.hpp"
#include "rtpm/wire/limits.hpp"
#include "supplier/push_ledger.hpp"

namespace rtpm::events {
namespace {

// A batch with its overhead fills a frame of shared memory.
constexpr std::size_t kBatchSizeMax = 15 * 1024;
constexpr std::size_t kRequestOverheadMax = 256;
constexpr std::size_t kSequenceCountMax = 256;
constexpr std::uint64_t kAllFrames = std::numeric_limits<std::uint64_t>::max();

IntakeCounters counters_of(const SupplierCounts& counts) noexcept {
  return {counts.taken(), counts.over_quota(), counts.too_large(), counts.bad(),
          counts.no_memory()};
}

// The hub counts each received event in exactly one counter.
std::uint64_t total_of(const IntakeCounters& intake) noexcept {
  return intake.taken_count + intake.over_quota_count + intake.too_large_count + intake.bad_count +
         intake.no_memory_count;
}

// Whether a confirmed call that failed with `error` may have run.
bool may_have_run(rpc::CallError error) noexcept {
  return error == rpc::CallError::kTimeout || error == rpc::CallError::kDisconnected ||
         error == rpc::CallError::kPeerRestarted || error == rpc::CallError::kStopped;
}

/// Events have their own channel: channels have no mutual order, and a call could occupy a shared
/// one.
struct Clients {
  HubClient asking;
  HubClient pushing;
};

/// Offset of the hub's clock.
struct HubClock {
  Duration offset{0};
  std::uint32_t uncertainty_ns = 0;
};

}  // namespace

class Supplier::Impl {
  friend class Supplier;

 public:
  explicit Impl(SupplierConfig config) : config_(std::move(config)), id_(rt::random_u64()) {}
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;
  ~Impl() {
    if (!thread_.is_running()) return;
    {
      const std::lock_guard lock(ending_mutex_);
      is_ending_ = true;
    }
    ending_.notify_all();
    thread_.join();
  }

  [[nodiscard]] expected<void, SetupError> begin(rpc::Node& node, std::string target) {
    node_ = &node;
    target_ = std::move(target);
    auto clients = bind();
    if (!clients) return unexpected{std::move(clients.error())};
    clients_.emplace(std::move(*clients));
    if (std::string refusal = attend(); !refusal.empty()) return setup_error(refusal);
    const auto about = clients_->asking.about({}, {.deadline = config_.deadline});
    if (about) reserve(about->payload_size_max());
    auto thread = rt::Thread::start({.name = "rtpm-attend", .realtime = rt::RealtimeMode::kOff},
                                    [this] { keep_attending(); });
    if (!thread) return unexpected{std::move(thread.error())};
    thread_ = std::move(*thread);
    return {};
  }
  [[nodiscard]] expected<void, SetupError> begin(Hub& hub) {
    hub_ = &hub;
    reserve(hub.payload_size_max());
    for (const EventDescriptor* each : config_.types) {
      if (auto added = hub.add_type(*each); !added) return added;
    }
    is_attended_ = true;
    return {};
  }

  [[nodiscard]] expected<void, rpc::CallError> add(const EventDraft& draft) noexcept {
    const std::size_t span = event_span(draft.payload.size());
    if (span > memory_.size() * sizeof(memory_[0])) return unexpected{rpc::CallError::kTooLarge};
    if (size_ > 0 && size_ + span > kBatchSizeMax) {
      if (auto sent = flush(); !sent) return sent;
    }
    const HubClock clock = clock_.read().value_or(HubClock{});
    EventWriter writer(std::as_writable_bytes(std::span(memory_)).subspan(size_));
    const bool is_put = writer.put({.type = draft.type,
                                    .source = draft.source,
                                    .sequence = next_sequence(draft.type, draft.source),
                                    .origin = draft.origin.value_or(rt::now()) + clock.offset,
                                    .schema_id = draft.schema_id,
                                    .origin_uncertainty_ns = clock.uncertainty_ns,
                                    .priority = config_.priority,
                                    .hops_left = draft.hops.value_or(config_.hops)},
                                   draft.payload);
    if (!is_put) return unexpected{rpc::CallError::kTooLarge};
    size_ += span;
    ++gathered_count_;
    return {};
  }

  [[nodiscard]] expected<void, rpc::CallError> flush() noexcept {
    if (size_ == 0) return {};
    const ConstBytes events = std::as_bytes(std::span(memory_)).first(std::exchange(size_, 0));
    const std::uint32_t count = std::exchange(gathered_count_, 0);
    if (hub_ != nullptr) {
      hub_->push(id_, events, config_.priority);
      ledger_.note_sent(hub_->epoch(), count);
      ledger_.note_counted(hub_->epoch(), ledger_.sent_count());
      return {};
    }
    if (std::exchange(is_loss_unreported_, false)) {
      ledger_.note_failed(count);
      return unexpected{rpc::CallError::kMaybeLost};
    }
    rpc::LentMemory lent(std::as_writable_bytes(std::span(request_)));
    flatbuffers::FlatBufferBuilder builder(request_.size() * sizeof(request_[0]), &lent);
    builder.ForceVectorAlignment(events.size(), 1, 16);
    const auto bytes =
        builder.CreateVector(reinterpret_cast<const std::uint8_t*>(events.data()), events.size());
    builder.Finish(CreatePushRequest(builder, id_, bytes));
    auto pushed = send(rpc::table_bytes(builder));
    // The hub may already have counted them all.
    const std::uint64_t lost = ledger_.maybe_lost_count();
    if (!pushed && pushed.error() == rpc::CallError::kMaybeLost && note_ended_frames() &&
        ledger_.maybe_lost_count() == lost) {
      pushed = send(rpc::table_bytes(builder));
    }
    note_pushed(pushed, count, rpc::table_bytes(builder).size());
    return pushed;
  }

  rt::PiMutex mutex;  ///< Guards add() and flush().

 private:
  struct Counter {
    EventType type = 0;
    SourceId source = 0;
    std::uint64_t count = 0;
  };

  [[nodiscard]] expected<Clients, SetupError> bind() {
    auto asking = HubClient::bind(
        *node_, target_,
        {.transport = config_.transport, .deadline = config_.deadline, .warm_up = {Priority{0}}});
    if (!asking) return unexpected{std::move(asking.error())};
    auto pushing = HubClient::bind(*node_, target_,
                                   {.transport = config_.transport,
                                    .deadline = config_.deadline,
                                    .warm_up = {config_.priority},
                                    .is_private = true});
    if (!pushing) return unexpected{std::move(pushing.error())};
    return Clients{std::move(*asking), std::move(*pushing)};
  }

  void reserve(std::size_t payload_size_max) {
    const std::size_t size = std::max(kBatchSizeMax, event_span(payload_size_max));
    memory_.resize(size / sizeof(memory_[0]));
    request_.resize((size + kRequestOverheadMax) / sizeof(request_[0]));
  }

  // The next sequence number; 0 ("not counted") beyond the table's capacity.
  [[nodiscard]] std::uint64_t next_sequence(EventType type, SourceId source) noexcept {
    for (std::size_t i = 0; i < counter_count_; ++i) {
      if (counters_[i].type == type && counters_[i].source == source) return ++counters_[i].count;
    }
    if (counter_count_ == counters_.size()) return 0;
    counters_[counter_count_++] = {type, source, 1};
    return 1;
  }

  [[nodiscard]] expected<void, rpc::CallError> send(ConstBytes request) noexcept {
    return clients_->pushing.push_encoded(request, {.priority = config_.priority});
  }
  // Records a push. A push larger than a frame is a confirmed call (see Binding::send()); if it
  // fails, its arrival is unknown.
  void note_pushed(const expected<void, rpc::CallError>& pushed, std::uint32_t count,
                   std::size_t size) noexcept {
    const rpc::Binding& binding = clients_->pushing.binding();
    note_ended_frames();
    if (pushed) {
      const std::uint64_t lost = ledger_.maybe_lost_count();
      ledger_.note_sent(binding.server_epoch(), count);
      // The hub changed without a connection ending, for example in the hub's own program.
      is_loss_unreported_ = is_loss_unreported_ || ledger_.maybe_lost_count() > lost;
      return;
    }
    const bool is_confirmed =
        binding.transport() == rpc::Transport::kUdp && size > wire::kDatagramPayloadSizeMax;
    if (!is_confirmed || !may_have_run(pushed.error())) return ledger_.note_failed(count);
    ledger_.note_sent(binding.server_epoch(), count);
    ledger_.note_doubtful();
  }
  bool note_ended_frames() noexcept {
    const std::uint64_t lost = clients_->pushing.binding().lost_oneway_count();
    if (lost == lost_frames_noted_) return false;
    ledger_.note_end(lost - std::exchange(lost_frames_noted_, lost));
    return true;
  }
  // Checks whether the last frames of an idle supplier may have been lost.
  void check_pushed() noexcept {
    const std::lock_guard lock(mutex);
    if (ledger_.unconfirmed_count() == 0 || clients_->pushing.binding().check_oneways()) return;
    note_ended_frames();
    is_loss_unreported_ = true;
  }

  // Registers with the hub and reads its counters; returns why the hub refused or did not answer.
  [[nodiscard]] std::string attend() {
    AttendRequestT request;
    request.supplier = id_;
    request.name = config_.name;
    for (const EventDescriptor* each : config_.types)
      request.types.push_back(entry_of(*each));
    const auto reply =
        clients_->asking.attend(request, {.priority = 0, .deadline = config_.deadline});
    is_attended_ = reply.has_value();
    if (!reply) return std::string(rpc::to_string(reply.error()));
    const IntakeCounters intake = counters_of(*(*reply)->counts());
    intake_.write(intake);
    {
      const std::lock_guard lock(mutex);
      ledger_.note_counted(clients_->asking.binding().server_epoch(), total_of(intake));
    }
    read_clock();
    return (*reply)->refusal() == nullptr ? std::string() : refusal_of(*(*reply)->refusal());
  }

  void read_clock() {
    const auto about = clients_->asking.about({}, {.priority = 0});
    if (!about) return;
    HubClock clock;
    if (about->clock_domain() != rt::clock_domain() || about->clock_domain() == 0) {
      const auto hub = clients_->asking.binding().ping({.priority = 0});
      if (!hub) return;
      clock.offset = hub->offset;
      clock.uncertainty_ns = static_cast<std::uint32_t>(
          std::clamp<std::int64_t>(hub->uncertainty.count(), 0, kUncertaintyUnknown));
      if (hub->uncertainty == Duration::max()) clock.offset = Duration{0};
    }
    clock_.write(clock);
  }

  void keep_attending() {
    std::unique_lock lock(ending_mutex_);
    while (!ending_.wait_for(lock, config_.attend_interval, [this] { return is_ending_; })) {
      lock.unlock();
      // create() has reported refused types; here only the hub's epoch matters.
      static_cast<void>(attend());
      check_pushed();
      if (!is_attended_) bind_again();
      lock.lock();
    }
  }

  // The name may now lead to another hub.
  void bind_again() {
    auto clients = bind();
    if (!clients) return;
    {
      const std::lock_guard lock(mutex);
      const std::uint64_t lost = ledger_.maybe_lost_count();
      static_cast<void>(clients_->pushing.binding().check_oneways());
      // The connection is open but its hub does not answer.
      if (!note_ended_frames()) ledger_.note_end(kAllFrames);
      is_loss_unreported_ = is_loss_unreported_ || ledger_.maybe_lost_count() > lost;
      std::swap(*clients_, *clients);
      lost_frames_noted_ = clients_->pushing.binding().lost_oneway_count();
    }
    static_cast<void>(attend());
  }

  const SupplierConfig config_;
  const std::uint64_t id_;
  rpc::Node* node_ = nullptr;
  std::string target_{};
  std::optional<Clients> clients_{};
  Hub* hub_ = nullptr;

  struct alignas(16) Line {
    std::byte bytes[16];
  };
  std::vector<Line> memory_{};        ///< The batch.
  std::size_t size_ = 0;              ///< Size of the batch, bytes.
  std::uint32_t gathered_count_ = 0;  ///< Number of events in the batch.
  std::vector<Line> request_{};
  std::array<Counter, kSequenceCountMax> counters_{};
  std::size_t counter_count_ = 0;
  PushLedger ledger_{};
  /// The pushing binding's lost_oneway_count() as last read.
  std::uint64_t lost_frames_noted_ = 0;
  bool is_loss_unreported_ = false;  ///< The next flush() returns kMaybeLost.

  Latest<HubClock> clock_;
  Latest<IntakeCounters> intake_;
  std::atomic<bool> is_attended_{false};
  std::mutex ending_mutex_;
  std::condition_variable ending_;
  bool is_ending_ = false;
  rt::Thread thread_{};
};

Supplier::Supplier(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
Supplier::~Supplier() = default;

expected<std::unique_ptr<Supplier>, SetupError> Supplier::create(rpc::Node& node,
                                                                 const std::string& target,
                                                                 const SupplierConfig& config) {
  auto impl = std::make_unique<Impl>(config);
  if (auto begun = impl->begin(node, target); !begun) return unexpected{std::move(begun.error())};
  return std::unique_ptr<Supplier>(new Supplier(std::move(impl)));
}

expected<std::unique_ptr<Supplier>, SetupError> Supplier::create(Hub& hub,
                                                                 const SupplierConfig& config) {
  auto impl = std::make_unique<Impl>(config);
  if (auto begun = impl->begin(hub); !begun) return unexpected{std::move(begun.error())};
  return std::unique_ptr<Supplier>(new Supplier(std::move(impl)));
}

expected<void, rpc::CallError> Supplier::push(const EventDraft& event) noexcept {
  const std::lock_guard lock(impl_->mutex);
  if (auto added = impl_->add(event); !added) return added;
  return impl_->flush();
}

expected<void, rpc::CallError> Supplier::add(const EventDraft& event) noexcept {
  const std::lock_guard lock(impl_->mutex);
  return impl_->add(event);
}

expected<void, rpc::CallError> Supplier::flush() noexcept {
  const std::lock_guard lock(impl_->mutex);
  return impl_->flush();
}

SupplierCounters Supplier::counters() const noexcept {
  const std::lock_guard lock(impl_->mutex);
  const PushLedger& ledger = impl_->ledger_;
  return {ledger.sent_count(), ledger.failed_count(), ledger.unconfirmed_count(),
          ledger.maybe_lost_count()};
}

IntakeCounters Supplier::intake() const noexcept {
  return impl_->intake_.read().value_or(IntakeCounters{});
}
std::uint64_t Supplier::id() const noexcept {
  return impl_->id_;
}

}  // namespace rtpm::events
