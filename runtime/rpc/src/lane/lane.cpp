#include "lane/lane.hpp"

#include <algorithm>
#include <span>
#include <utility>

#include "execution/pooled_execution.hpp"
#include "rtpm/base/assert.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/transport/socket.hpp"

namespace rtpm::rpc {
namespace {

// How many shared-memory connections an idle turn polls, in rotation: a caller that calls again at
// once should not wait for a poll of a thousand silent ones.
constexpr std::size_t kMemoryLooksPerTurn = 8;
// How many of the other connections are polled each time they are due while one has endless calls.
constexpr std::size_t kMemoryLooksWhenDue = 64;
// How long an ending lane waits for running methods before it tells their callers that it stops.
constexpr Duration kStopPatience = std::chrono::seconds{1};

bool has_thread_pool(const LaneSetup& setup) noexcept {
  return ThreadPool::is_wanted(setup.config(), setup.server->borrows);
}

// How many calls may be unfinished: waiting, running, or deferred.
std::uint32_t call_count_max(const LaneSetup& setup) noexcept {
  const LaneConfig& config = setup.config();
  const std::uint32_t deferred = setup.server->deferred_call_count_max;
  if (!has_thread_pool(setup)) return deferred;
  return deferred + config.buffered_request_max + ThreadPool::static_count(config) +
         config.dynamic_threads + setup.lendable_thread_count;
}

// The host's number, as CallerHost defines it.
std::uint64_t host_number(const wire::PeerAddress& host) noexcept {
  return host.high != 0 ? host.high : transport::SocketAddress::of(host).ipv4();
}

}  // namespace

Lane::Lane(const LaneSetup& setup, std::vector<transport::UdpPort> ports,
           std::unique_ptr<transport::WaitSet> wait_set)
    : config_(setup.config()),
      band_(setup.band()),
      wait_set_(std::move(wait_set)),
      doorbell_(std::make_shared<Doorbell>(*wait_set_)),
      report_(*setup.slot, config_, band_),
      tap_(has_thread_pool(setup)),
      media_(setup, std::move(ports), *wait_set_, report_),
      calls_(std::make_shared<PendingPool>(
                 call_count_max(setup), setup.server->deferred_call_count_max,
                 setup.server->message_size_max, setup.server->stream_byte_max,
                 has_thread_pool(setup), doorbell_),
             call_count_max(setup), media_, report_, *doorbell_, tap_),
      gate_(std::make_shared<LocalGate>(doorbell_, *this, setup.server->local_oneway_count_max,
                                        setup.server->message_size_max)),
      rights_(setup, media_.all(), media_.connections(), media_.seals()),
      dispatch_(*setup.objects, setup.server->inbound_priority, config_.priority, *this, tap_,
                rights_, setup.refusals),
      idling_(config_.wait) {
  const LaneParts parts{*this,  config_, is_stopping_, *setup.slot, dispatch_,
                        calls_, report_, idling_,      *wait_set_};
  for (std::uint32_t i = 0; i < media_.ports().size(); ++i) {
    DatagramPort& port = *media_.ports()[i];
    const bool is_added =
        wait_set_->add_port(port.socket(), port.buffer(), SourceTag(kPortKind, i));
    RTPM_ASSERT(is_added, "a new wait set takes a port");
  }
  if (has_thread_pool(setup)) {
    auto pooled = std::make_unique<PooledExecution>(parts, setup.number, setup.lower,
                                                    call_count_max(setup), *setup.acceptor_bell);
    thread_pool_ = pooled.get();
    execution_ = std::move(pooled);
  } else {
    execution_ = std::make_unique<SoloExecution>(parts);
  }
  calls_.share(execution_->lock());
}

expected<void, SetupError> Lane::start(rt::RealtimeMode realtime, rt::CpuKeeper* keeper) {
  if (!rights_.prepare()) {
    return setup_error("lane '" + config_.name + "' has no memory for what its callers may do",
                       system_error(ENOMEM), "raise the limit of the process (ulimit -v)");
  }
  return execution_->start(realtime, keeper);
}

void Lane::stop() noexcept {
  is_stopping_.store(true, std::memory_order_release);
  wait_set_->ring();
}

void Lane::close() noexcept {
  Lead lead;
  doorbell_->close();
  for (const auto& port : media_.ports())
    wait_set_->remove(port->socket().descriptor());
  media_.close(lead);
  calls_.publish(lead);
}

void Lane::serve(Lead& lead) noexcept {
  while (!is_stopping_.load(std::memory_order_acquire)) {
    step(lead);
    if (execution_->yields_lead(lead)) return;
  }
  end(lead);
}

// Serves a source that has work; otherwise polls or sleeps.
void Lane::step(Lead& lead) noexcept {
  bool has_served = turn(lead);
  if (has_served) {
    idling_.on_work(received_);
  } else {
    const MonotonicTime now = rt::now();
    attention_.on_idle(now);
    const Idling::Next next = idling_.on_idle(now);
    if (next.polls) return obey(lead, pause_while_polling(rt::this_thread_budget(), now));
    has_served = look(lead, std::min(next.until, calls_.next_time()));
    idling_.on_woken(next, rt::now(), has_served);
    if (has_served) idling_.on_work(received_);
  }
  if (has_served) obey(lead, pause_after_work(rt::this_thread_budget(), received_, rt::now));
}

// Polls the sources for calls, the most likely ones first; true if there was work.
bool Lane::turn(Lead& lead) noexcept {
  while (auto stream = media_.handover().take_arrival())
    calls_.admit(lead, std::move(stream));
  if (Seals* const seals = media_.seals()) serve_seals(lead, *seals);
  const bool has_backlog = calls_.serve_backlog(lead);
  const bool has_open = calls_.serve_ready(lead);
  // Frames that the lane sends on its own must not delay calls.
  if (has_backlog || (has_open && attention_.on_own_work())) {
    attention_.on_turn();
    if (gate_->has_calls()) static_cast<void>(serve_source(lead, kGateSource));
    static_cast<void>(serve_memory(lead, kMemoryLooksWhenDue));
    static_cast<void>(look(lead, transport::kAlready));
    return true;
  }
  if (has_open) return true;
  attention_.on_turn();
  if (gate_->has_calls()) attention_.set_hot(kGateSource);
  const SourceTag hot = attention_.hot();
  const bool is_memory_hot = media_.connections().is_memory(hot);
  // A blocking lane waits for all of its sockets at once instead of polling the last one first.
  const bool is_asked = is_memory_hot || !idling_.is_blocking();
  const bool has_served = is_asked && serve_source(lead, hot);
  if (has_served && media_.has_one_source() && hot != kGateSource) return true;
  if (!has_served || attention_.is_memory_look_due(received_)) {
    attention_.on_memory_look(received_);
    if (serve_memory(lead, has_served ? kMemoryLooksWhenDue : kMemoryLooksPerTurn)) return true;
  }
  const bool is_alone = media_.has_one_source() && hot != kGateSource;
  const bool is_look_due = has_served ? attention_.is_look_due(received_, is_memory_hot)
                                      : !idling_.is_blocking() && attention_.is_idle_look_due();
  if (is_alone || !is_look_due) return has_served;
  const bool has_found = look(lead, transport::kAlready);
  attention_.on_looked(has_found, is_memory_hot);
  return serve_memory(lead, kMemoryLooksPerTurn) || has_found || has_served;
}

// Advances handshakes, and ends sessions that the grants no longer allow.
void Lane::serve_seals(Lead& lead, Seals& seals) noexcept {
  if (seals.link().take_sweep()) rights_.sweep();
  const MonotonicTime now = rt::now();
  seals.begin_turn(now);
  while (const auto event = seals.next_event(media_.connections(), now)) {
    const bool is_good =
        event->frame.empty() || media_.send_as_is(lead, event->slot, event->peer, event->frame);
    if (event->slot != nullptr && (event->ends_connection || !is_good)) {
      calls_.retire(lead, *event->slot);
    }
    calls_.take_cancelled(lead, CallEnding::kLeft);
  }
  if (!seals.take_progress()) return;
  report_.mark(lead);
  calls_.publish(lead);
}

// Polls the system, or waits for it, and serves each source that it reports. True if one had work,
// or the doorbell rang.
bool Lane::look(Lead& lead, MonotonicTime until) noexcept {
  Connections& connections = media_.connections();
  attention_.on_look();
  const bool may_sleep = until != transport::kAlready;
  if (may_sleep && calls_.has_any()) calls_.take_cancelled(lead, CallEnding::kLeft);
  // Announce first, then check: if a caller saw the lane awake, this check sees its call.
  if (may_sleep) doorbell_->announce_sleep();
  const bool has_none = !may_sleep || (connections.announce_sleep() && calls_.pool()->may_sleep() &&
                                       gate_->may_sleep());
  const bool has_leftovers = connections.has_leftovers() || media_.has_leftover_datagrams();
  if (has_leftovers || !has_none) until = transport::kAlready;
  transport::WaitLock* const held = until == transport::kAlready ? nullptr : execution_->lock();
  const std::size_t count = wait_set_->wait(until, ready_, held);
  if (may_sleep) {
    doorbell_->end_sleep();
    connections.end_sleep();
  }
  if (calls_.has_any()) calls_.on_time(lead, rt::now());
  bool has_served = serve_leftover_datagrams(lead);
  for (Slot* const slot : connections.take_leftovers()) {
    if (slot->stream && serve_source(lead, connections.tag_of(*slot))) has_served = true;
  }
  for (const SourceTag source : std::span(ready_).first(count)) {
    if (serve_ready(lead, source)) has_served = true;
  }
  return has_served;
}

// Serves a source that the system has reported.
bool Lane::serve_ready(Lead& lead, SourceTag source) noexcept {
  // The doorbell rings only once; sleeping now would miss its reason.
  if (source == transport::kDoorbell) return true;
  const bool has_served = serve_source(lead, source);
  // Another thread, or the frame itself, may have ended the connection.
  Slot* const slot = media_.connections().find(source);
  if (slot == nullptr && source.kind() != kPortKind) return has_served;
  // After the reply, as the caller does not wait for this.
  if (source.kind() == kConnectionKind) slot->stream->on_ready();
  if (has_served) {
    attention_.set_hot(slot == nullptr ? source : media_.connections().tag_of(*slot));
  }
  return has_served;
}

// Polls the next `look_count` shared-memory connections, and serves one frame from each that has
// one.
bool Lane::serve_memory(Lead& lead, std::size_t look_count) noexcept {
  Connections& connections = media_.connections();
  bool has_served = false;
  while (Slot* const slot = connections.next_with_frame(look_count)) {
    const SourceTag source = connections.tag_of(*slot);
    if (!serve_source(lead, source)) continue;
    has_served = true;
    attention_.set_hot(source);
  }
  return has_served;
}

// Serves a frame of the source, or a batch of datagrams; false if there is none.
bool Lane::serve_source(Lead& lead, SourceTag source) noexcept {
  bool has_served = false;
  if (source == kGateSource) {
    has_served = serve_gate(lead);
  } else if (source.kind() == kPortKind) {
    has_served = serve_datagrams(lead, *media_.ports()[source.index()]);
  } else if (Slot* const slot = media_.connections().find(source)) {
    has_served = serve_connection(lead, *slot);
  } else if (attention_.hot() == source) {
    attention_.set_hot(kPortSource);
  }
  // Every time: the counters of a lane that never rests are the most interesting ones.
  calls_.publish(lead);
  return has_served;
}

bool Lane::serve_gate(Lead& lead) noexcept {
  const std::uint32_t refused_count = gate_->take_refused_count();
  LocalChannel* call = gate_->take_next();
  if (call == nullptr && refused_count == 0) return false;
  report_.counters(lead).overload_count += refused_count;
  if (call != nullptr) {
    received_ = rt::now();
    execution_->accept(lead, *call);
  }
  // One per turn, as for any source, unless calls are only queued.
  while (execution_->only_orders() && (call = gate_->take_next()) != nullptr)
    execution_->accept(lead, *call);
  return true;
}

bool Lane::serve_leftover_datagrams(Lead& lead) noexcept {
  bool has_served = false;
  const auto ports = media_.ports();
  for (std::uint32_t i = 0; i < ports.size(); ++i) {
    if (!ports[i]->has_leftovers()) continue;
    if (serve_source(lead, SourceTag(kPortKind, i))) has_served = true;
  }
  return has_served;
}

// Serves a batch of datagrams, at most as long as others of the band may have to wait.
bool Lane::serve_datagrams(Lead& lead, DatagramPort& port) noexcept {
  const auto begin = port.receive();
  if (!begin) return false;
  received_ = *begin;
  while (const auto frame = port.next()) {
    const wire::PeerAddress& peer = port.peer();
    wire::ServerSessions& sessions = media_.datagrams();
    wire::Verdict verdict = media_.on_datagram(*frame, peer, received_);
    verdict.request.caller_host = host_number(port.socket().host_of(peer));
    ConstBytes answer = verdict.frame;
    const bool has_more = port.has_leftovers();
    if (verdict.action == wire::Verdict::Action::kDispatch) {
      port.begin_call(lead, verdict.request.header);
      answer = execution_->accept(lead, sessions, verdict.request);
      if (has_more) port.end_call(verdict.request.header, received_);
    }
    port.send(lead, sessions, peer, answer, has_more);
    report_.end_cycle(lead, received_);
    calls_.on_frame(lead, verdict.credit_tag);
    if (!has_more) break;
    received_ = rt::now();
    if (received_ - *begin >= Attention::kLookIntervalMax) break;
  }
  port.flush(lead);
  return true;
}

bool Lane::serve_connection(Lead& lead, Slot& slot) noexcept {
  const auto frame = slot.stream->receive();
  if (!frame) {
    if (frame.error() == transport::IoError::kNothing) return false;
    if (frame.error() == transport::IoError::kBroken) {
      ++report_.counters(lead).broken_memory_count;
    }
    calls_.retire(lead, slot);
    return false;
  }
  received_ = slot.heard = rt::now();
  const SourceTag source = media_.connections().tag_of(slot);
  wire::ServerSessions& sessions = media_.sessions_of(slot);
  wire::Verdict verdict = media_.on_frame(slot, *frame, received_);
  verdict.request.caller_host = slot.is_from_this_host ? kThisHost.number : host_number(slot.peer);
  ConstBytes answer = verdict.frame;
  if (verdict.action == wire::Verdict::Action::kDispatch) {
    answer = execution_->accept(lead, sessions, verdict.request);
  }
  const bool is_good =
      verdict.action != wire::Verdict::Action::kHangUp && media_.send(lead, sessions, slot, answer);
  report_.end_cycle(lead, received_);
  calls_.on_frame(lead, verdict.credit_tag);
  // It may have ended while its stream's items were sent.
  if (media_.connections().find(source) == nullptr) return true;
  if (!is_good) {
    calls_.retire(lead, slot);
  } else if (!slot.is_memory && slot.stream->has_buffered()) {
    attention_.set_hot(source);
    media_.connections().note_leftovers(slot);
  }
  return true;
}

void Lane::obey(Lead& lead, const Pause& pause) noexcept {
  if (pause.kind == Pause::Kind::kNone) return;
  ++report_.sample(lead).pause_count;
  calls_.publish(lead);
  if (pause.kind == Pause::Kind::kSleep) return execution_->sleep(lead, pause.until);
  execution_->keep_cpu_awake(pause.until);
  static_cast<void>(look(lead, std::min(pause.until, calls_.next_time())));
}

// Tells waiting calls that the lane stops, and gives running ones some time.
void Lane::end(Lead& lead) noexcept {
  gate_->close();
  execution_->refuse_waiting(lead);
  const MonotonicTime end = rt::now() + kStopPatience;
  while (execution_->is_running(lead) && rt::now() < end) {
    static_cast<void>(turn(lead));
    static_cast<void>(look(lead, std::min(end, rt::now() + std::chrono::milliseconds{1})));
    static_cast<void>(execution_->yields_lead(lead));
  }
  calls_.end(lead);
  execution_->end(lead);
}

}  // namespace rtpm::rpc
