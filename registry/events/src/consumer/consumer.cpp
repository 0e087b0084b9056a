#include "rtpm/events/consumer.hpp"

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <filesystem>
#include <utility>

#include "consumer/consumer_impl.hpp"
#include "rtpm/base/assert.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/host.hpp"
#include "rtpm/wire/limits.hpp"

namespace rtpm::events {
namespace {

using namespace std::chrono_literals;

// How long one poll of the stream waits, which bounds how fast stopping is. A stream must be polled
// at least every second.
constexpr Duration kPollMax = 100ms;
// Pause between attempts to resubscribe; a hub usually restarts within a second.
constexpr Duration kRetryFirst = 20ms;
constexpr Duration kRetryMax = 500ms;
// How often the hub is told of this consumer's progress.
constexpr Duration kNoteInterval = 1s;
// Items in flight with kKeepLatest: each one delays the newest event.
constexpr std::uint32_t kLatestWindow = 2;

// Why a stream ended.
std::string in_words(rpc::CallError error, std::uint32_t miss_count_max) {
  const std::string count = std::to_string(miss_count_max) + " signs of life";
  if (error == rpc::CallError::kExpired) {
    return "The hub dropped the subscription, as it missed " + count +
           " of this consumer: its thread did not run, its handler took too long, or the network "
           "was gone.";
  }
  if (error == rpc::CallError::kTimeout) {
    return "The consumer missed " + count + " of the hub: it is stopped, or the network is gone.";
  }
  return std::string(rpc::to_string(error));
}

// The number of this process; 0 if the system does not tell.
std::uint32_t own_process() {
  std::error_code error;
  const std::string text = std::filesystem::read_symlink("/proc/self", error).string();
  std::uint32_t number = 0;
  std::from_chars(text.data(), text.data() + text.size(), number);
  return number;
}

constexpr std::size_t kEventSizeMax = std::size_t{16} * 1024 * 1024;

}  // namespace

Consumer::Impl::Impl(rpc::Node& node, std::string target, ConsumerConfig config,
                     EventHandler& handler)
    : node_(node),
      target_(std::move(target)),
      handler_(handler),
      taker_([this](std::span<const EventView> group) { hand_over(group); }),
      assembler_(kEventSizeMax),
      config_(std::move(config)) {}

Consumer::Impl::~Impl() {
  RTPM_ASSERT(!is_in_handler(),
              "a consumer is not destroyed in its own handler; let it unsubscribe there");
  unsubscribe();
}

expected<void, SetupError> Consumer::Impl::begin() {
  auto thread = rt::Thread::start({.name = "ev-" + config_.name,
                                   .priority = config_.priority,
                                   .cpus = config_.cpus,
                                   .realtime = config_.realtime},
                                  [this] { run(); });
  if (!thread) return unexpected{std::move(thread.error())};
  thread_ = std::move(*thread);
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return has_begun_; });
  if (begin_error_) return unexpected{std::move(*begin_error_)};
  return {};
}

void Consumer::Impl::report_begin(std::optional<SetupError> error) {
  {
    const std::lock_guard lock(mutex_);
    has_begun_ = true;
    begin_error_ = std::move(error);
  }
  changed_.notify_all();
}

void Consumer::Impl::run() {
  own_thread_ = std::this_thread::get_id();
  auto session = open();
  if (!session) return report_begin(std::move(session.error()));
  report_begin(std::nullopt);
  notify(NoticeKind::kSubscribed, "");
  std::string why;
  while (!is_stopping_) {
    why = read(**session);
    if (is_stopping_) break;
    notify(NoticeKind::kInterrupted, why);
    if (!resubscribe(**session)) return;
  }
  subscription_id_ = 0;
  notify(NoticeKind::kEnded, "It was unsubscribed.");
}

// Retries until subscribed again; false if refused or stopped.
bool Consumer::Impl::resubscribe(Session& session) {
  subscription_id_ = 0;
  assembler_.clear();
  const MonotonicTime lost = last_heard_;
  const std::uint64_t epoch = last_epoch_;
  // Frees the lost stream's slot for the new stream.
  session.stream.cancel();
  for (Duration pause = kRetryFirst; sleep_unless_stopping(pause);
       pause = std::min(2 * pause, kRetryMax)) {
    auto opened = open();
    if (opened) {
      std::swap(session, **opened);
      {
        const std::lock_guard lock(mutex_);
        ++counters_.resubscription_count;
      }
      if (is_suspended_) static_cast<void>(control(Action::Suspend));
      notify(NoticeKind::kResubscribed, "", rt::now() - lost, epoch != last_epoch_);
      return true;
    }
    if (opened.error().is_final) {
      notify(NoticeKind::kEnded, opened.error().text());
      return false;
    }
  }
  notify(NoticeKind::kEnded, "It was unsubscribed.");
  return false;
}

bool Consumer::Impl::sleep_unless_stopping(Duration span) {
  std::unique_lock lock(mutex_);
  return !changed_.wait_for(lock, span, [this] { return is_stopping_.load(); });
}

SubscribeRequestT Consumer::Impl::request() const {
  const std::lock_guard lock(mutex_);
  SubscribeRequestT request;
  request.name = config_.name;
  request.program = rt::program_name();
  request.process = own_process();
  request.filter = entry_of(config_.filter);
  request.delivery = entry_of(config_.delivery);
  request.linking_hub = config_.linking_hub;
  for (const EventDescriptor* each : config_.types)
    request.types.push_back(entry_of(*each));
  return request;
}

Consumer::Impl::Opened Consumer::Impl::open() {
  const auto failed = [](rpc::CallError error) {
    return setup_error("The hub does not serve this consumer", error);
  };
  auto client = HubClient::bind(node_, target_,
                                {.transport = config_.transport,
                                 .deadline = config_.deadline,
                                 .warm_up = {config_.priority}});
  if (!client) return unexpected{std::move(client.error())};
  DeliveryPolicy delivery;
  {
    const std::lock_guard lock(mutex_);
    delivery = config_.delivery;
  }
  const bool is_latest = delivery.when_full == QueuePolicy::kKeepLatest;
  rpc::StreamOptions options;
  options.call.priority = config_.priority;
  options.miss_count_max = config_.miss_count_max;
  // A consumer reads continuously: a silent one is dead.
  options.pause_max = config_.miss_count_max * wire::kStreamAskIntervalMax;
  if (is_latest) options.window = kLatestWindow;
  std::shared_ptr<CommonReader> reader;
  auto ring = open_ring(*client, reader);
  auto multicast = ring ? nullptr : open_multicast(*client, reader);
  SubscribeRequestT subscribe_request = request();
  if (ring) subscribe_request.ring = ring->id();
  if (multicast) subscribe_request.multicast = multicast->id();
  auto stream = client->subscribe(subscribe_request, options);
  if (!stream) return failed(stream.error());
  const auto first = stream->next(rt::now() + config_.deadline);
  if (!first) return failed(first.error());
  if (*first != nullptr && (*first)->refusal() != nullptr) {
    // With ring or multicast, the hub may just have restarted.
    return unexpected{Failure{{refusal_of(*(*first)->refusal())},
                              /*is_final=*/ring == nullptr && multicast == nullptr}};
  }
  if (*first == nullptr || (*first)->welcome() == nullptr) {
    return setup_error("The hub does not welcome its consumers", "it is of another release");
  }
  const Welcome welcome = *(*first)->welcome();
  {
    const std::lock_guard lock(mutex_);
    earlier_losses_ = counters_.losses;
    hub_losses_ = {};
    own_losses_ = {};
    control_client_ = std::make_shared<HubClient>(std::move(*client));
  }
  if (ring) {
    ring->begin(welcome.ring_place(), welcome.subscription(), welcome.ring_position(), delivery);
  }
  if (multicast) {
    multicast->begin(control_client_, welcome.subscription(), welcome.ring_position(), delivery,
                     config_.priority);
  }
  reads_ring_ = ring != nullptr;
  receives_multicast_ = multicast != nullptr;
  std::unique_ptr<BroadcastSession> broadcast = std::move(ring);
  if (multicast) broadcast = std::move(multicast);
  auto session = std::make_unique<Session>(Session{control_client_, std::move(*stream), *first,
                                                   std::move(broadcast), std::move(reader)});
  subscription_id_ = welcome.subscription();
  last_heard_ = rt::now();
  next_note_ = last_heard_ + kNoteInterval;
  last_epoch_ = welcome.epoch();
  return session;
}

std::shared_ptr<CommonReader> Consumer::Impl::reader_of(
    std::uint64_t broadcast, const std::string& interface,
    const CommonReader::MakeSource& make) const {
  if (config_.has_own_thread || node_.config().wait.strategy == rt::WaitStrategy::kSpin) {
    return nullptr;
  }
  return CommonReader::of(
      {&node_, broadcast, interface, config_.priority, config_.cpus, config_.realtime}, make);
}

std::unique_ptr<RingSession> Consumer::Impl::open_ring(HubClient& client,
                                                       std::shared_ptr<CommonReader>& reader) {
  if (!config_.shared_ring) return nullptr;
  const auto about = client.about({}, {.priority = 0, .deadline = config_.deadline});
  if (!about || about->ring() == 0 || about->clock_domain() != rt::clock_domain()) return nullptr;
  auto ring = RingSession::open(about->ring(), rt::now() + config_.deadline);
  if (ring) reader = reader_of(ring->id(), {}, [&] { return ring->source(); });
  return ring;
}

std::unique_ptr<MulticastSession> Consumer::Impl::open_multicast(
    HubClient& client, std::shared_ptr<CommonReader>& reader) {
  if (!config_.multicast) return nullptr;
  const auto facts = MulticastSession::ask(client, config_.multicast_interface, config_.deadline);
  if (!facts) return nullptr;
  reader = reader_of(facts->id, config_.multicast_interface,
                     [&] { return MulticastFeed::open(facts->group); });
  if (!reader) return MulticastSession::open(*facts);
  // Ring and multicast have different ids.
  return std::make_unique<MulticastSession>(
      facts->id, std::static_pointer_cast<MulticastFeed>(reader->source()));
}

void Consumer::Impl::note_progress(Session& session) {
  const MonotonicTime now = rt::now();
  if (now < next_note_) return;
  next_note_ = now + kNoteInterval;
  Progress progress;
  {
    const std::lock_guard lock(mutex_);
    const Duration lag = std::exchange(lag_, Duration{0});
    progress = {subscription_id_, counters_.event_count, lag.count(), involuntary(own_losses_)};
  }
  // An older hub has no such method; its report then lacks these counts.
  static_cast<void>(session.client->note(progress, {.priority = 0}));
}

std::optional<std::string> Consumer::Impl::poll_stream(Session& session, MonotonicTime until) {
  note_progress(session);
  const auto batch = session.stream.next(until);
  if (batch) {
    last_heard_ = rt::now();
    if (*batch == nullptr) return "The hub ended the subscription.";
    if ((*batch)->refusal() != nullptr) return refusal_of(*(*batch)->refusal());
    take(**batch);
    return std::nullopt;
  }
  if (batch.error() == rpc::CallError::kOverload) return std::string(kQueueWasFull);
  if (!session.stream.is_open()) return in_words(batch.error(), config_.miss_count_max);
  if (batch.error() != rpc::CallError::kTimeout) {
    const std::lock_guard lock(mutex_);
    ++counters_.broken_count;
  }
  return std::nullopt;
}

// Reads until the stream ends; returns why.
std::string Consumer::Impl::read(Session& session) {
  if (const Batch* const first = std::exchange(session.first, nullptr)) take(*first);
  if (session.broadcast) return read_broadcast(session);
  while (!is_stopping_) {
    if (auto why = poll_stream(session, rt::now() + kPollMax)) return std::move(*why);
  }
  return {};
}

void Consumer::Impl::take(const Batch& batch) {
  if (batch.losses() != nullptr) {
    hub_losses_ = losses_of(*batch.losses());
    update_losses();
  }
  const auto* events = batch.events();
  if (events == nullptr) return;
  const ConstBytes bytes = std::as_bytes(std::span(events->data(), events->size()));
  const auto hand = [this](std::span<const EventView> group) { hand_over(group); };
  const Part* const part = batch.part();
  const bool is_sound = part == nullptr
                            ? assembler_.take(bytes, hand)
                            : assembler_.take_part(bytes, part->offset(), part->size(), hand);
  if (is_sound) return;
  const std::lock_guard lock(mutex_);
  ++counters_.broken_count;
}

void Consumer::Impl::update_losses() {
  {
    const std::lock_guard lock(mutex_);
    counters_.losses = earlier_losses_;
    counters_.losses.add(hub_losses_);
    counters_.losses.add(own_losses_);
  }
  notify(NoticeKind::kLosses, "");
}

void Consumer::Impl::hand_over(std::span<const EventView> events) {
  if (is_stopping_) return;
  const EventHeader& newest = events.back().header;
  // Only a reader of the ring has the hub's clock. In a stream, the interval's end delays an event.
  const Duration in_ring = reads_ring_ ? rt::now() - newest.hub_sent : Duration{0};
  {
    const std::lock_guard lock(mutex_);
    const Duration at_hub = newest.hub_sent - newest.hub_received - config_.delivery.interval;
    if (!newest.is_replayed) lag_ = std::max(lag_, reads_ring_ ? in_ring : at_hub);
    counters_.event_count += events.size();
    ++counters_.delivery_count;
  }
  try {
    handler_.on_events(events);
    return;
  } catch (...) {
    const std::lock_guard lock(mutex_);
    ++counters_.handler_failure_count;
  }
  notify(NoticeKind::kHandlerFailed, "The handler threw an exception.");
}

void Consumer::Impl::notify(NoticeKind kind, std::string_view text, Duration gap,
                            bool has_hub_restarted) {
  Notice notice{kind, text, {}, gap, has_hub_restarted, last_epoch_};
  {
    const std::lock_guard lock(mutex_);
    notice.losses = counters_.losses;
  }
  try {
    handler_.on_notice(notice);
  } catch (...) {
    const std::lock_guard lock(mutex_);
    ++counters_.handler_failure_count;
  }
}

expected<void, SetupError> Consumer::Impl::change(const Filter& filter,
                                                  const DeliveryPolicy& delivery) {
  ChangeRequestT request;
  std::shared_ptr<HubClient> client;
  {
    const std::lock_guard lock(mutex_);
    for (const EventDescriptor* each : config_.types)
      request.types.push_back(entry_of(*each));
    client = control_client_;
  }
  request.subscription = subscription_id_;
  request.filter = entry_of(filter);
  request.delivery = entry_of(delivery);
  const auto reply = client->change(request, {.priority = 0});
  if (!reply) {
    return setup_error("The subscription was not changed", reply.error());
  }
  if ((*reply)->refusal() != nullptr) return setup_error(refusal_of(*(*reply)->refusal()));
  {
    const std::lock_guard lock(mutex_);
    config_.filter = filter;
    config_.delivery = delivery;
    has_new_policy_ = true;
  }
  wake_own_thread();
  return {};
}

expected<void, rpc::CallError> Consumer::Impl::control(Action action) {
  std::shared_ptr<HubClient> client;
  {
    const std::lock_guard lock(mutex_);
    client = control_client_;
    is_suspended_ = action == Action::Suspend;
  }
  return client->control(Control(subscription_id_, action), {.priority = 0});
}

bool Consumer::Impl::is_in_handler() const noexcept {
  const auto me = std::this_thread::get_id();
  return own_thread_.load() == me || common_thread_.load() == me;
}

void Consumer::Impl::unsubscribe() {
  {
    const std::lock_guard lock(mutex_);
    is_stopping_ = true;
  }
  changed_.notify_all();
  if (is_in_handler()) return;
  // Wakes its thread from its poll.
  if (is_subscribed()) static_cast<void>(control(Action::End));
  wake_own_thread();
  const std::lock_guard lock(join_mutex_);
  if (thread_.is_running()) thread_.join();
}

Consumer::Consumer(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
Consumer::~Consumer() = default;

expected<std::unique_ptr<Consumer>, SetupError> Consumer::create(rpc::Node& node,
                                                                 const std::string& target,
                                                                 ConsumerConfig config,
                                                                 EventHandler& handler) {
  if (config.miss_count_max < rpc::kMissCountMin || config.miss_count_max > rpc::kMissCountMax) {
    return setup_error("miss_count_max of consumer '" + config.name + "' is " +
                           std::to_string(config.miss_count_max),
                       "",
                       "choose " + std::to_string(rpc::kMissCountMin) + " to " +
                           std::to_string(rpc::kMissCountMax));
  }
  auto impl = std::make_unique<Impl>(node, target, std::move(config), handler);
  if (auto begun = impl->begin(); !begun) return unexpected{std::move(begun.error())};
  return std::unique_ptr<Consumer>(new Consumer(std::move(impl)));
}

expected<void, SetupError> Consumer::change(const Filter& filter, const DeliveryPolicy& delivery) {
  return impl_->change(filter, delivery);
}
expected<void, rpc::CallError> Consumer::suspend() {
  return impl_->control(Action::Suspend);
}
expected<void, rpc::CallError> Consumer::resume() {
  return impl_->control(Action::Resume);
}
void Consumer::unsubscribe() {
  impl_->unsubscribe();
}
bool Consumer::is_subscribed() const noexcept {
  return impl_->is_subscribed();
}
bool Consumer::receives_multicast() const noexcept {
  return impl_->receives_multicast_;
}
bool Consumer::reads_ring() const noexcept {
  return impl_->reads_ring_;
}
ConsumerCounters Consumer::counters() const {
  const std::lock_guard lock(impl_->mutex_);
  return impl_->counters_;
}

}  // namespace rtpm::events
