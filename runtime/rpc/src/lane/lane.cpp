#include "lane/lane.hpp"
#include "server/lane_table_owner.hpp"

#include <algorithm>
#include <exception>
#include <utility>

#include "rtpm/base/assert.hpp"
#include "rtpm/rt/budget.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/host.hpp"
#include "rtpm/rt/memory.hpp"
#include "rtpm/rt/priority.hpp"
#include "rtpm/transport/socket.hpp"

namespace rtpm::rpc {
namespace {

// While one source is busy the others are looked at after so many of its frames, so that no caller
// is starved by another of the same band.
constexpr std::uint32_t kStreakMax = 16;
// While the hot source is silent the others are looked at every so many turns: a look costs about
// as much as a receive.
constexpr std::uint32_t kTurnsPerLook = 8;
// A turn over shared memory takes a few nanoseconds, and a look at the sockets as long as a whole
// call. So while that is hot and nothing else comes, the looks become rarer, up to these bounds.
constexpr std::uint32_t kTurnsPerLookMax = 16384;
constexpr Duration kTimePerLookMax = std::chrono::microseconds{200};
// So many connections through memory are looked at in a turn without work, the next ones each time:
// one that calls again at once is not to wait for a look at a thousand that are silent.
constexpr std::size_t kMemoryLooksPerTurn = 8;
// One alone is looked at so often in a turn without work: together that takes about as long as the
// rest of the turn, so that a call seldom comes when nobody looks.
constexpr int kLooksAtOne = 64;
// While one has calls without end, so often and so many of the others.
constexpr Duration kTimePerMemoryLook = std::chrono::microseconds{10};
constexpr std::size_t kMemoryLooksWhenDue = 64;
// A call that took less may have the answers to others wait for it, if they came together.
constexpr Duration kQuickCall = std::chrono::microseconds{5};
// A connection that has opened no session in this time may be replaced.
constexpr Duration kSessionPatience = std::chrono::seconds{2};

// What a lane keeps for messages larger than a frame: one more room than may be held, where replies
// are written.
std::size_t bulk_size(const LaneSetup& setup) noexcept {
  constexpr std::size_t kCacheLine = 64;
  const std::size_t room =
      (setup.sessions.message_size_max + kCacheLine - 1) / kCacheLine * kCacheLine;
  return room * (setup.large_message_count_max + 1);
}

// How many calls may be unfinished: waiting, running, or deferred.
std::uint32_t call_count_max(const LaneSetup& setup) noexcept {
  const LaneConfig& config = setup.config;
  if (!ThreadPool::is_wanted(config, setup.borrows)) return setup.deferred_call_count_max;
  return setup.deferred_call_count_max + config.buffered_request_max +
         ThreadPool::static_count(config) + config.dynamic_threads + setup.lendable_thread_count;
}

std::size_t stream_size(const LaneSetup& setup, wire::Medium medium) noexcept {
  return setup.stream_count_max * wire::stream_room_size(medium);
}

wire::ServerSessionsConfig datagram_config(wire::ServerSessionsConfig config, MutableBytes bulk,
                                           MutableBytes streams) {
  config.medium = wire::Medium::kDatagram;
  config.bulk_memory = bulk;
  config.stream_memory = streams;
  return config;
}

wire::ServerSessionsConfig stream_config(wire::ServerSessionsConfig config, MutableBytes bulk,
                                         MutableBytes streams) {
  config.medium = wire::Medium::kStream;
  config.bulk_memory = bulk;
  config.stream_memory = streams;
  // Another secret, so that a session number of one medium is none of the other's.
  config.key.low = ~config.key.low;
  return config;
}

wire::ServerSessionsConfig memory_config(wire::ServerSessionsConfig config, MutableBytes bulk,
                                         MutableBytes streams) {
  config = stream_config(config, bulk, streams);
  config.frame_payload_max = static_cast<std::uint32_t>(wire::kSharedPayloadSizeMax);
  config.key.high = ~config.key.high;
  return config;
}

}  // namespace

Lane::Lane(const LaneSetup& setup, transport::UdpPort port,
           std::unique_ptr<transport::PortWaitSet> wait_set)
    : config_(setup.config),
      band_(setup.band),
      objects_(*setup.objects),
      inbound_priority_(setup.inbound_priority),
      number_(setup.sessions.lane),
      lower_(setup.lower),
      acceptor_bell_(setup.acceptor_bell),
      port_(std::move(port)),
      wait_set_(std::move(wait_set)),
      datagram_bulk_(bulk_size(setup)),
      stream_bulk_(bulk_size(setup)),
      memory_bulk_(bulk_size(setup)),
      datagram_streams_(stream_size(setup, wire::Medium::kDatagram)),
      stream_streams_(stream_size(setup, wire::Medium::kStream)),
      memory_streams_(stream_size(setup, wire::Medium::kStream)),
      datagram_sessions_(
          datagram_config(setup.sessions, datagram_bulk_.bytes(), datagram_streams_.bytes())),
      stream_sessions_(
          stream_config(setup.sessions, stream_bulk_.bytes(), stream_streams_.bytes())),
      memory_sessions_(
          memory_config(setup.sessions, memory_bulk_.bytes(), memory_streams_.bytes())),
      bell_(std::make_shared<Doorbell>(*wait_set_)),
      pending_(std::make_shared<PendingPool>(
          call_count_max(setup), setup.deferred_call_count_max, setup.sessions.message_size_max,
          setup.stream_byte_max, ThreadPool::is_wanted(setup.config, setup.borrows), bell_)),
      gate_(std::make_shared<LocalGate>(bell_, *this, setup.local_oneway_count_max,
                                        setup.sessions.message_size_max)),
      connections_(2 * std::size_t{setup.sessions.session_count_max}),
      turns_per_look_(kTurnsPerLook),
      slot_(*setup.slot) {
  const auto is_there = [](const rt::LazyMemory& memory, std::size_t size) {
    return memory.bytes().size() == size;
  };
  has_memory_ = is_there(datagram_bulk_, bulk_size(setup)) &&
                is_there(stream_bulk_, bulk_size(setup)) &&
                is_there(memory_bulk_, bulk_size(setup)) &&
                is_there(datagram_streams_, stream_size(setup, wire::Medium::kDatagram)) &&
                is_there(stream_streams_, stream_size(setup, wire::Medium::kStream)) &&
                is_there(memory_streams_, stream_size(setup, wire::Medium::kStream)) &&
                pending_->has_memory();
  show_config();
  if (lower_ != nullptr) lower_->upper_ = this;
  // A connection that is served while it stands in the list may enter it a second time.
  leftovers_.reserve(2 * connections_.size());
  memory_sources_.reserve(connections_.size());
  stream_sources_.reserve(connections_.size());
  // One more: a call that used up the turn stands at the end before its old entry goes.
  backlog_.reserve(std::size_t{call_count_max(setup)} + 1);
  if (ThreadPool::is_wanted(config_, setup.borrows)) {
    pool_.emplace(config_, call_count_max(setup));
  }
  const bool is_added = wait_set_->add_port(*port_, datagrams_, transport::SourceTag(kPort));
  RTPM_ASSERT(is_added, "a new wait set takes a socket");
  // On one CPU a spinning lane would only keep its callers from running.
  if (rt::usable_cpu_count() == 1 && (config_.wait.strategy == rt::WaitStrategy::kAdaptive ||
                                      config_.wait.strategy == rt::WaitStrategy::kPeriodic)) {
    config_.wait.strategy = rt::WaitStrategy::kBlock;
  }
  is_periodic_ = config_.wait.strategy == rt::WaitStrategy::kPeriodic;
}

void Lane::run() noexcept {
  BusyMark::show_at(&slot_.busy_since_ns.front());
  const rt::NoAllocationScope no_allocation;
  MonotonicTime spin_end = kNever;
  while (!is_stopping_.load(std::memory_order_acquire))
    step(spin_end);
  say_goodbye();
}

// Serves what is there, or waits as the lane's strategy says.
void Lane::step(MonotonicTime& spin_end) noexcept {
  if (turn()) {
    spin_end = kNever;
    after_work();
    return;
  }
  if (config_.wait.strategy == rt::WaitStrategy::kSpin) {
    // Looking at the clock each turn would take longer than the turn.
    constexpr std::uint32_t kTurnsPerGlance = 64;
    if (++glance_count_ % kTurnsPerGlance == 0 && rt::this_thread_budget().is_limited()) {
      rest_if_spent(rt::now());
    }
    return;
  }
  if (config_.wait.strategy != rt::WaitStrategy::kBlock) {
    const MonotonicTime now = rt::now();
    if (spin_end == kNever) spin_end = now + spin_time(now);
    if (now < spin_end) {
      rest_if_spent(now);
      return;
    }
  }
  if (is_periodic_ && sleep_to_next_turn()) return;
  const bool has_served = look_around(next_time());
  // A wait that ended with nothing is no reason to spin anew.
  spin_end = has_served ? kNever : MonotonicTime::min();
  if (has_served) after_work();
}

void Lane::after_work() noexcept {
  spin_estimator_.on_work(received_);
  nap_if_overdue(received_);
}

// A lane that spins blocks now and then, lest the kernel stop it and the more urgent with it.
void Lane::rest_if_spent(MonotonicTime now) noexcept {
  rt::RealtimeBudget& budget = rt::this_thread_budget();
  if (!budget.must_rest(now)) return;
  ++sample_.rest_count;
  is_unpublished_ = true;
  publish();
  if (budget.must_sleep(now)) {
    nap(now + rt::RealtimeBudget::kNap);
  } else {
    const MonotonicTime end = now + rt::RealtimeBudget::kNap;
    keep_cpu_awake(end);
    static_cast<void>(look_around(std::min(end, next_time())));
  }
}

// The same for one with so much to do that it never comes to wait.
void Lane::nap_if_overdue(MonotonicTime received) noexcept {
  rt::RealtimeBudget& budget = rt::this_thread_budget();
  if (budget.overdue(received) == Duration{0}) return;
  // A call may have run since.
  const MonotonicTime now = rt::now();
  if (!budget.must_rest(now)) return;
  const Duration rest = budget.overdue(now);
  if (rest == Duration{0}) return;
  ++sample_.rest_count;
  nap(now + rest);
}

// A call of another lane that comes meanwhile finds the CPU as quick as if this one worked on.
void Lane::keep_cpu_awake(MonotonicTime until) noexcept {
  // Waking up takes its time, through which the CPU is not to sleep either.
  constexpr Duration kLatenessMax = std::chrono::microseconds{200};
  if (keeper_ != nullptr) keeper_->keep_until(until + kLatenessMax);
}

// Sleeps without looking at anything. Others may use the lane meanwhile.
void Lane::nap(MonotonicTime until) noexcept {
  if (pool_) pool_->unlock();
  keep_cpu_awake(until);
  rt::sleep_until(until);
  if (pool_) pool_->lock_as_follower();
}

// Spinning on after a call is a waste where the next one never comes that soon. Where callers come
// at a steady pace, it is one unless they call several times in a row.
Duration Lane::spin_time(MonotonicTime now) noexcept {
  const bool does_pay = spin_estimator_.on_idle(now, config_.wait.spin);
  if (has_rhythm_) return std::min(config_.wait.spin, predictor_.patience());
  return does_pay ? config_.wait.spin : Duration{0};
}

// When the lane has something to do by itself.
MonotonicTime Lane::next_time() const noexcept {
  return std::min({datagram_sessions_.next_time(), stream_sessions_.next_time(),
                   memory_sessions_.next_time(), waiting_reply_due_, retry_time_});
}

// Sleeps until just before a caller is expected; then gives back true at once, for as long as it
// may still come. False where none is expected.
bool Lane::sleep_to_next_turn() noexcept {
  const MonotonicTime now = rt::now();
  const auto window = predictor_.next(now);
  has_rhythm_ = window.has_value();
  if (!has_rhythm_) return false;
  if (now >= window->from) return true;
  // A call that comes early ends the sleep like any other.
  if (look_around(std::min(window->from, next_time()))) return true;
  const MonotonicTime woken = rt::now();
  if (woken >= window->from) predictor_.on_woken(window->from, woken);
  return true;
}

void Lane::stop() noexcept {
  is_stopping_.store(true, std::memory_order_release);
  wait_set_->ring();
}

void Lane::close() noexcept {
  bell_->close();
  wait_set_->remove(port_->descriptor());
  port_.reset();
  while (arriving_.pop()) {
  }
  while (leaving_.pop()) {
  }
  for (Connection& connection : connections_) {
    if (!connection.stream) continue;
    connection.stream.reset();
    ++counters_.connection_lost_count;
    is_unpublished_ = true;
  }
  memory_sources_.clear();
  stream_sources_.clear();
  publish();
}

bool Lane::adopt(std::unique_ptr<transport::Connection>& stream) noexcept {
  if (!arriving_.push(stream)) return false;
  // SYNC POINT lane-arrivals: the connection is in the ring.
  has_arrivals_.store(true, std::memory_order_release);
  wait_set_->ring();
  return true;
}

std::unique_ptr<transport::Connection> Lane::take_back() noexcept {
  auto stream = leaving_.pop();
  return stream ? std::move(*stream) : nullptr;
}

// One look for work; true if there was some.
bool Lane::turn() noexcept {
  // SYNC POINT lane-arrivals
  if (has_arrivals_.load(std::memory_order_acquire)) adopt_waiting();
  const bool has_backlog = send_backlog();
  const bool has_pending = pending_->open_count() > 0 && look_at_pending();
  // What the lane sends by itself must not keep calls waiting.
  if (has_backlog || (has_pending && ++pending_streak_ == kStreakMax)) return look_at_others();
  if (has_pending) return true;
  pending_streak_ = 0;
  if (hot_ != kLocal && gate_->has_calls()) hot_ = kLocal;
  // One that blocks waits for all of its sockets at once rather than ask the last one first.
  const bool is_hot_asked = config_.wait.strategy != rt::WaitStrategy::kBlock || is_memory(hot_);
  linger();
  const bool has_served = is_hot_asked && serve_one(hot_);
  if (has_served && connection_count() == 0 && hot_ != kLocal) return true;
  // Some of what costs no syscall is looked at each turn, unless there is something anyway.
  if (!has_served || is_memory_look_due()) {
    last_memory_look_ = received_;
    if (serve_memory(has_served ? kMemoryLooksWhenDue : kMemoryLooksPerTurn)) return true;
  }
  if (!is_look_due(has_served)) return has_served;
  const bool has_found = look_around(transport::kAlready);
  turns_per_look_ = has_found || !is_memory(hot_) ? kTurnsPerLook
                                                  : std::min(2 * turns_per_look_, kTurnsPerLookMax);
  return serve_memory(kMemoryLooksPerTurn) || has_found || has_served;
}

// Serves whatever calls there are, between items of streams.
bool Lane::look_at_others() noexcept {
  pending_streak_ = 0;
  if (gate_->has_calls()) static_cast<void>(serve_one(kLocal));
  static_cast<void>(serve_memory(kMemoryLooksWhenDue));
  static_cast<void>(look_around(transport::kAlready));
  return true;
}

// Looks for a call on the only connection through memory, if it is the only one that had some.
void Lane::linger() const noexcept {
  if (memory_sources_.size() != 1 || hot_ != memory_sources_.front()) return;
  const transport::Connection& only = *connections_[hot_].stream;
  for (int look = 0; look < kLooksAtOne && !only.has_buffered(); ++look) {
  }
}

// A caller that calls again at once must not keep others of its band waiting call after call.
bool Lane::is_memory_look_due() const noexcept {
  const std::size_t others = memory_sources_.size() - (hot_ != kLocal && is_memory(hot_) ? 1 : 0);
  return others > 0 && received_ - last_memory_look_ >= kTimePerMemoryLook;
}

// Whether it is time to look at the sources that are not hot.
bool Lane::is_look_due(bool has_served) noexcept {
  if (connection_count() == 0 && hot_ != kLocal) return false;
  if (!has_served) return ++turn_count_ >= turns_per_look_;
  if (++streak_ < kStreakMax && received_ - last_look_ < kTimePerLookMax) return false;
  return !is_memory(hot_) || received_ - last_look_ >= kTimePerLookMax;
}

// Waits for any source and serves each that a poll tells of; true if one had something, or the bell
// rang.
bool Lane::look_around(MonotonicTime until) noexcept {
  streak_ = 0;
  turn_count_ = 0;
  last_look_ = received_;
  const bool may_sleep = until != transport::kAlready;
  if (has_leftovers() || (may_sleep && !announce_sleep())) until = transport::kAlready;
  // Others may use the lane while it sleeps.
  const std::size_t count = wait_set_->wait(until, ready_, pool_ ? &*pool_ : nullptr);
  if (may_sleep) end_sleep();
  if (pending_->open_count() > 0) look_at_time();
  bool has_served = serve_leftovers();
  for (std::size_t i = 0; i < count; ++i)
    serve_ready(ready_[i], has_served);
  return has_served;
}

void Lane::serve_ready(transport::SourceTag tag, bool& has_served) noexcept {
  if (tag == transport::kDoorbell) {
    // It rings once. Whoever goes to sleep after it would not hear what it was about.
    has_served = true;
    return;
  }
  const Source source = tag.kind() == kPort ? kUdp : tag.index();
  // Another thread, or an earlier frame, may have retired it in the meantime.
  if (source != kUdp && (!connections_[source].stream || tag != tag_of(source, tag.kind()))) return;
  const bool has_frame = serve_one(source);
  // Only then, as the caller waits for its reply and not for this.
  if (tag.kind() == kConnection && connections_[source].stream) {
    connections_[source].stream->on_ready();
  }
  if (!has_frame) return;
  has_served = true;
  // It may have gone in the meantime; then the datagrams are as good a guess as any.
  hot_ = source == kUdp || connections_[source].stream ? source : kUdp;
}

// Has the callers through memory ring when they call; false if one has called by now.
bool Lane::announce_sleep() noexcept {
  if (pending_->open_count() > 0) tell_cancelled(CallEnding::kLeft);
  bell_->announce_sleep();
  bool may_sleep = pending_->may_sleep() && gate_->may_sleep();
  for (const Source source : memory_sources_) {
    if (!connections_[source].stream->announce_sleep()) may_sleep = false;
  }
  return may_sleep;
}

void Lane::end_sleep() noexcept {
  bell_->end_sleep();
  for (const Source source : memory_sources_)
    connections_[source].stream->end_sleep();
}

// Looks at the next so many connections through memory, and serves one frame of each that has some.
bool Lane::serve_memory(std::size_t look_count) noexcept {
  bool has_served = false;
  std::size_t left = std::min(look_count, memory_sources_.size());
  for (; left > 0 && !memory_sources_.empty(); --left) {
    // Backwards: one that ends leaves its place to the last.
    if (next_memory_look_ == 0 || next_memory_look_ > memory_sources_.size()) {
      next_memory_look_ = memory_sources_.size();
    }
    const Source source = memory_sources_[--next_memory_look_];
    if (!connections_[source].stream->has_buffered() || !serve_one(source)) continue;
    has_served = true;
    if (connections_[source].stream) hot_ = source;
  }
  return has_served;
}

// Serves what is left of a batch of datagrams, and one frame of each connection that has some in
// its buffer.
bool Lane::serve_leftovers() noexcept {
  bool has_served = !batch_.is_empty() && serve_one(kUdp);
  const std::size_t count = leftovers_.size();
  for (std::size_t i = 0; i < count; ++i) {
    const Source source = leftovers_[i];
    connections_[source].has_leftovers = false;
    if (serve_one(source)) has_served = true;
  }
  leftovers_.erase(leftovers_.begin(), leftovers_.begin() + static_cast<std::ptrdiff_t>(count));
  return has_served;
}

bool Lane::serve_one(Source source) noexcept {
  if (source == kLocal) return serve_local();
  const bool has_served = source == kUdp ? serve_datagrams() : serve_stream(source);
  // Each time, because a lane that never rests is the one whose counters people want to see.
  publish();
  return has_served;
}

// Serves datagrams that came together, for no longer than others of the band may have to wait.
bool Lane::serve_datagrams() noexcept {
  const bool has_left = !batch_.is_empty();
  if (!has_left) {
    const auto received = port_->receive(datagrams_);
    if (!received) return false;
    batch_ = *received;
  }
  const MonotonicTime begin = received_ = rt::now();
  if (!has_left) port_->note(batch_, received_);
  is_unpublished_ = true;
  while (const auto frame = batch_.next()) {
    serve_datagram(*frame, batch_.peer(), !batch_.is_empty());
    if (batch_.is_empty()) break;
    received_ = rt::now();
    if (received_ - begin >= kTimePerLookMax) break;
  }
  flush_answers();
  return true;
}

// `has_more`: others came together with it, whose answers go together, too, but for those that
// would have to wait for a call that may take long.
void Lane::serve_datagram(ConstBytes frame, const wire::PeerAddress& peer, bool has_more) noexcept {
  wire::Verdict verdict = datagram_sessions_.on_frame(frame, peer, received_);
  verdict.request.caller_host = transport::ipv4_of(peer);
  ConstBytes answer_frame = verdict.frame;
  if (verdict.action == wire::Verdict::Action::kDispatch) {
    if (!answers_.is_empty() && !is_quick(verdict.request.header)) flush_answers();
    answer_frame = run_request(datagram_sessions_, verdict.request);
    if (has_more) note_pace(verdict.request.header);
  }
  answer(peer, answer_frame, has_more);
  end_cycle(std::max(completed_, received_));
  after_frame(verdict.credit_tag);
}

// Remembers the last method of datagrams that came together, if it was quick.
void Lane::note_pace(const wire::Header& call) noexcept {
  const bool was_quick = rt::now() - received_ < kQuickCall;
  quick_service_ = was_quick ? call.service : wire::kSessionService;
  quick_method_ = call.method;
}

// Sends a frame to a peer of the port, and what belongs behind it; later, if there will be more.
void Lane::answer(const wire::PeerAddress& peer, ConstBytes frame, bool has_more) noexcept {
  if (!answers_.is_empty() && !(peer == answers_peer_)) flush_answers();
  // One alone goes as it is. As large as can be, it may be one of several.
  const bool is_alone =
      !has_more && answers_.is_empty() && frame.size() < wire::kDatagramFrameSizeMax;
  for (; !frame.empty(); frame = datagram_sessions_.next_frame(rt::now())) {
    answers_peer_ = peer;
    if (!is_alone && answers_.add(frame)) continue;
    flush_answers();
    if (!is_alone && answers_.add(frame)) continue;
    if (!port_->send(peer, frame)) ++counters_.send_failure_count;
  }
  if (!has_more) flush_answers();
}

void Lane::flush_answers() noexcept {
  if (answers_.is_empty()) return;
  if (!port_->send_batch(answers_peer_, answers_)) ++counters_.send_failure_count;
  answers_.clear();
}

bool Lane::serve_stream(Source source) noexcept {
  Connection& connection = connections_[source];
  if (!connection.stream) return false;
  wire::ServerSessions& sessions = connection.is_memory ? memory_sessions_ : stream_sessions_;
  const auto frame = connection.stream->receive();
  if (!frame) {
    if (frame.error() == transport::IoError::kNothing) return false;
    if (frame.error() == transport::IoError::kBroken) ++counters_.broken_memory_count;
    retire(source);
    return false;
  }
  is_unpublished_ = true;
  received_ = connection.heard = rt::now();
  wire::Verdict verdict = sessions.on_frame(*frame, connection.peer, received_);
  verdict.request.caller_host =
      connection.is_memory ? kThisHost.ipv4 : transport::ipv4_of(connection.peer);
  ConstBytes answer = verdict.frame;
  if (verdict.action == wire::Verdict::Action::kDispatch) {
    answer = run_request(sessions, verdict.request);
  }
  bool is_good = verdict.action != wire::Verdict::Action::kHangUp;
  for (; is_good && !answer.empty(); answer = sessions.next_frame(rt::now())) {
    // A peer that does not take its replies is given up rather than waited for (hp-16.4-2).
    is_good = connection.stream->send(answer, transport::kAlready).has_value();
    if (!is_good) ++counters_.send_failure_count;
  }
  end_cycle(std::max(completed_, received_));
  after_frame(verdict.credit_tag);
  if (!connection.stream) return true;  // It ended as its stream's items were sent.
  if (!is_good) {
    retire(source);
  } else if (!connection.is_memory && connection.stream->has_buffered()) {
    hot_ = source;
    if (!std::exchange(connection.has_leftovers, true)) leftovers_.push_back(source);
  }
  return true;
}

void Lane::adopt_waiting() noexcept {
  // An exchange, because a plain store could be seen by others after what the ring held before it:
  // a connection that comes in between would be forgotten.
  has_arrivals_.exchange(false, std::memory_order_acq_rel);
  while (auto stream = arriving_.pop()) {
    // Half of the places are for memory, as many as there are sessions for it.
    const bool is_memory = (*stream)->is_memory();
    std::vector<Source>& sources = is_memory ? memory_sources_ : stream_sources_;
    const wire::PeerAddress host = (*stream)->host();
    const MonotonicTime now = rt::now();
    if (!make_place_for(host, is_memory, now)) {
      turn_away(*stream, now);
      continue;
    }
    const auto place =
        std::ranges::find_if(connections_, [](const Connection& c) { return !c.stream; });
    const auto source = static_cast<Source>(place - connections_.begin());
    place->stream = std::move(*stream);
    place->peer = {host.high, host.low,
                   (++place->generation << kIndexBits) | static_cast<std::uint32_t>(source)};
    place->heard = now;
    place->is_memory = is_memory;
    sources.push_back(source);
    if (!watch(source)) {
      sources.pop_back();
      give_back(place->stream);
      continue;
    }
    ++counters_.connection_count;
    is_unpublished_ = true;
  }
}

// Whether the host may have one more connection, for which the one that was silent longest may have
// to go: of its own, once it has its share.
bool Lane::make_place_for(const wire::PeerAddress& host, bool is_memory,
                          MonotonicTime now) noexcept {
  const std::vector<Source>& sources = is_memory ? memory_sources_ : stream_sources_;
  const auto count_max = static_cast<std::uint32_t>(connections_.size() / 2);
  const std::uint32_t share = wire::share_of_one_host(count_max);
  if (sources.size() < share) return true;
  const auto is_own = [&](Source source) {
    return wire::is_same_host(connections_[source].peer, host);
  };
  const bool has_share = std::cmp_greater_equal(std::ranges::count_if(sources, is_own), share);
  if (!has_share && sources.size() < count_max) return true;
  const wire::ServerSessions& sessions = is_memory ? memory_sessions_ : stream_sessions_;
  std::optional<Source> longest;
  for (const Source source : sources) {
    const Connection& each = connections_[source];
    if ((has_share && !is_own(source)) || now - each.heard < kSessionPatience) continue;
    if (longest && each.heard >= connections_[*longest].heard) continue;
    // hp-5.5-1: a client that still uses its session is heard oftener.
    const bool may_go =
        now - each.heard >= wire::kSessionIdleMin || !sessions.has_session(each.peer);
    if (may_go) longest = source;
  }
  if (longest) retire(*longest);
  return longest.has_value();
}

// The lane is full. Over TCP the first frame came with the connection, so that its client can be
// told; else it sees that the connection ends.
void Lane::turn_away(std::unique_ptr<transport::Connection>& stream, MonotonicTime now) noexcept {
  wire::ServerSessions& sessions = stream->is_memory() ? memory_sessions_ : stream_sessions_;
  if (const auto frame = stream->receive()) {
    const ConstBytes refusal = sessions.turn_away(*frame, now);
    if (!refusal.empty()) static_cast<void>(stream->send(refusal, transport::kAlready));
  }
  give_back(stream);
  ++counters_.connection_refused_count;
  is_unpublished_ = true;
  publish();
}

transport::SourceTag Lane::tag_of(Source source, transport::SourceKind kind) const noexcept {
  return transport::SourceTag(kind, static_cast<std::uint32_t>(source),
                              connections_[source].generation);
}

// Has the next wait heed the source; false if the system refuses.
bool Lane::watch(Source source) noexcept {
  const transport::Connection& stream = *connections_[source].stream;
  const int event = stream.event();
  if (!wait_set_->add(stream.descriptor(), tag_of(source, kConnection),
                      transport::Trigger::kLevel)) {
    return false;
  }
  if (event < 0 ||
      wait_set_->add(event, tag_of(source, kConnectionEvent), transport::Trigger::kEdge)) {
    return true;
  }
  wait_set_->remove(stream.descriptor());
  return false;
}

void Lane::unwatch(Source source) noexcept {
  const transport::Connection& stream = *connections_[source].stream;
  wait_set_->remove(stream.descriptor());
  if (const int event = stream.event(); event >= 0) wait_set_->remove(event);
}

void Lane::retire(Source source) noexcept {
  Connection& connection = connections_[source];
  // Later the place is tried again: the acceptor takes connections back as they come.
  unwatch(source);
  (connection.is_memory ? memory_sessions_ : stream_sessions_).forget(connection.peer);
  // At once: later, another call may have the place of one that was told of.
  tell_cancelled(CallEnding::kLeft);
  std::vector<Source>& sources = connection.is_memory ? memory_sources_ : stream_sources_;
  *std::ranges::find(sources, source) = sources.back();
  sources.pop_back();
  give_back(connection.stream);
  ++counters_.connection_lost_count;
  is_unpublished_ = true;
  if (hot_ == source) hot_ = kUdp;
}

void Lane::give_back(std::unique_ptr<transport::Connection>& stream) noexcept {
  if (!leaving_.push(stream)) {
    // The acceptor is far behind. Freeing here breaks the rule against it, once, and no memory.
    const rt::AllowAllocationScope is_allowed;
    stream.reset();
  }
  acceptor_bell_->ring();
}

// What of the lane stays as it is, for others to see.
void Lane::show_config() noexcept {
  const std::size_t size = std::min(config_.name.size(), slot_.name.size() - 1);
  std::copy_n(config_.name.begin(), size, slot_.name.begin());
  slot_.band_low = static_cast<std::uint16_t>(band_.low.value());
  slot_.band_high = static_cast<std::uint16_t>(band_.high.value());
  slot_.priority = static_cast<std::uint16_t>(config_.priority.value());
  slot_.wait = static_cast<std::uint8_t>(config_.wait.strategy);
  slot_.schedule = static_cast<std::uint8_t>(config_.schedule);
}

// A frame was dealt with. `end`: when its answer was written, or when it was taken.
void Lane::end_cycle(MonotonicTime end) noexcept {
  ++sample_.cycle_count;
  sample_.last_cycle_end_ns = to_ns(end);
  sample_.longest_cycle_ns =
      std::max(sample_.longest_cycle_ns, std::int64_t{(end - received_).count()});
}

void Lane::publish() noexcept {
  if (!is_unpublished_) return;
  is_unpublished_ = false;
  counters_.frames = datagram_sessions_.counters();
  counters_.frames.add(stream_sessions_.counters());
  counters_.frames.add(memory_sessions_.counters());
  sample_.counters = counters_;
  sample_.counters.late_count += counters_.frames.expired_count - silent_stream_count_;
  sample_.queued_count = pool_ ? pool_->queued_count() : 0;
  sample_.open_call_count = pending_->open_count();
  sample_.open_connection_count = connection_count();
  slot_.sample.write(sample_);
}

}  // namespace rtpm::rpc
