#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "exchange/exchange.hpp"
#include "filter/catalog.hpp"
#include "hub/disconnects.hpp"
#include "hub/intake.hpp"
#include "hub/multicast_outlet.hpp"
#include "hub/outlet.hpp"
#include "hub/ring_outlet.hpp"
#include "idl.hpp"
#include "link/interest_set.hpp"
#include "link/link.hpp"
#include "link/repetition_guard.hpp"
#include "rtpm/events/hub.hpp"
#include "rtpm/rt/pi_mutex.hpp"
#include "rtpm/rt/thread.hpp"
#include "rtpm/transport/wait_set.hpp"

namespace rtpm::events {

/// The hub: an exchange under a lock, called by lanes, with a thread for its timeouts.
class HubImpl final : public Hub, public HubServant, private LinkHost {
 public:
  /// `ring` and `multicast` may be null.
  HubImpl(const HubConfig& config, std::unique_ptr<transport::WaitSet> wait_set,
          std::unique_ptr<RingOutlet> ring, std::unique_ptr<MulticastOutlet> multicast);
  ~HubImpl() override;
  [[nodiscard]] expected<void, SetupError> start(const HubConfig& config);

  rpc::Servant& servant() noexcept override { return *this; }
  std::uint64_t epoch() const noexcept override { return epoch_; }
  void push(std::uint64_t supplier, ConstBytes events, Priority priority) noexcept override;
  expected<void, SetupError> add_type(const EventDescriptor& descriptor) override;
  std::uint32_t payload_size_max() const noexcept override {
    return exchange_.store().payload_size_max();
  }
  expected<void, SetupError> link(rpc::Node& node, const std::string& target,
                                  const LinkConfig& config) override;
  std::vector<LinkStatus> links() const override;
  IntakeCounters intake() const noexcept override;
  std::size_t subscription_count() const noexcept override;
  std::vector<Disconnect> disconnects(std::uint64_t after) const override {
    return disconnects_.after(after);
  }
  DisconnectCounters disconnect_counters() const noexcept override {
    return disconnects_.counters();
  }

  rpc::Result<HubFacts> about(const rpc::CallContext& context) override;
  rpc::Result<void> push(const PushRequest& request, const rpc::CallContext& context) override;
  void subscribe(const SubscribeRequest& request, rpc::TableWriter<Batch> items,
                 const rpc::CallContext& context) override;
  rpc::Result<void> change(const ChangeRequest& request, rpc::ReplyBuilder<ChangeReply>& reply,
                           const rpc::CallContext& context) override;
  rpc::Result<void> control(const Control& request, const rpc::CallContext& context) override;
  rpc::Result<void> attend(const AttendRequest& request, rpc::ReplyBuilder<AttendReply>& reply,
                           const rpc::CallContext& context) override;
  rpc::Result<void> types(rpc::ReplyBuilder<TypesReply>& reply,
                          const rpc::CallContext& context) override;
  rpc::Result<void> report(rpc::ReplyBuilder<ReportReply>& reply,
                           const rpc::CallContext& context) override;
  rpc::Result<void> multicast(rpc::ReplyBuilder<MulticastReply>& reply,
                              const rpc::CallContext& context) override;
  rpc::Result<void> note(const Progress& progress, const rpc::CallContext& context) override;
  rpc::Result<void> repair(const RepairWish& missing, rpc::ReplyBuilder<RepairReply>& reply,
                           const rpc::CallContext& context) override;

 private:
  using Types = flatbuffers::Vector<flatbuffers::Offset<TypeEntry>>;

  /// The interest of a subscription, and the hub that requested it.
  struct InterestSet {
    std::vector<Match> matches{};
    std::uint64_t linking_hub = 0;
  };
  /// Counters of a link's events.
  struct LinkIntake {
    QuotaMeter meter{};
    std::uint64_t taken_count = 0;
    std::uint64_t repeated_count = 0;
    std::uint64_t refused_count = 0;
    std::uint64_t report_count = 0;
  };

  /// Constructed before the lock is taken, so that it is destroyed after the lock is released.
  class WakeAfter {
   public:
    explicit WakeAfter(HubImpl& hub) noexcept : hub_(hub) {}
    WakeAfter(const WakeAfter&) = delete;
    WakeAfter& operator=(const WakeAfter&) = delete;
    ~WakeAfter();

   private:
    HubImpl& hub_;
  };

  [[nodiscard]] HubFacts facts() const noexcept;
  /// Requires types_mutex_.
  [[nodiscard]] expected<void, SetupError> add_types(const Types* types);
  [[nodiscard]] static std::string refusal_of(const FilterNode& filter, const Types* types,
                                              bool is_broadcast, const rpc::Caller* caller);
  [[nodiscard]] expected<Exchange::Prepared, SetupError> prepare(const FilterNode& filter,
                                                                 const DeliveryEntry& delivery,
                                                                 const Types* types,
                                                                 bool is_broadcast = false);
  void refuse(rpc::TableWriter<Batch>& items, std::string_view why) noexcept;
  [[nodiscard]] std::optional<SubscriptionNumber> find(std::uint64_t id) const noexcept;

  // Require mutex_.
  void take(Intake::Supplier& supplier, const EventView& event, MonotonicTime now) noexcept;
  void pump_ready(MonotonicTime now) noexcept;
  void pump(SubscriptionNumber number, MonotonicTime now) noexcept;
  void end(Outlet& outlet, DisconnectReason reason) noexcept;
  [[nodiscard]] MonotonicTime next_time() const noexcept;
  [[nodiscard]] bool receives_multicast(SubscriptionNumber number) const noexcept {
    return multicast_ && multicast_->has_slot(number);
  }
  /// How far a consumer is behind.
  [[nodiscard]] Duration lag_of(SubscriptionNumber number, MonotonicTime now) noexcept;
  void ring_if_needed(MonotonicTime now) noexcept;
  void retry_backlogs(bool is_sweep, MonotonicTime now) noexcept;

  void run() noexcept;
  void reap_dead() noexcept;

  std::uint64_t host_epoch() const noexcept override { return epoch_; }
  std::vector<Match> interest_set_without(std::uint64_t peer) const override;
  void take_linked(std::size_t link, const EventView& event) noexcept override;
  void publish_link_report(std::size_t link, const LinkReport& report) noexcept override;
  void add_interest_set(std::uint64_t id, std::vector<Match> matches, std::uint64_t hub);
  void change_interest_set(std::uint64_t id, std::vector<Match> matches);
  void remove_interest_set(std::uint64_t id);
  void notify_links();
  [[nodiscard]] std::vector<std::uint64_t> linking_subscriptions() const;

  const std::uint64_t epoch_;
  const std::uint64_t clock_domain_;

  mutable rt::PiMutex types_mutex_;
  TypeCatalog types_{};

  const std::unique_ptr<RingOutlet> ring_;  ///< Null if there is none. Written with mutex_ held.
  /// Null if there is none. Written with mutex_ held.
  const std::unique_ptr<MulticastOutlet> multicast_;
  Broadcasts broadcasts_;  ///< Combines ring and multicast; used if there is a multicast.
  /// Guards all members below; held for at most kEventsPerTurn events.
  mutable rt::PiMutex mutex_;
  Exchange exchange_;
  std::vector<Outlet> outlets_;  ///< Indexed by the subscription's number.
  Intake intake_;
  IntakeCounters intake_counters_{};
  std::array<LinkIntake, kLinkCountMax> link_intakes_{};
  std::unique_ptr<RepetitionGuard> guard_{};  ///< Null if there are no links.
  ItemBuilder builder_{};
  bool has_backlog_ = false;
  bool has_dead_ = false;
  MonotonicTime sleeping_until_ = kNever;

  std::atomic<std::uint32_t> wake_bits_{0};  ///< Wake bits for readers of the ring.
  Disconnects disconnects_{};
  std::unique_ptr<transport::WaitSet> wait_set_;
  std::atomic<bool> is_stopping_{false};
  rt::Thread thread_{};

  /// Guards interest_sets_, which is keyed by the subscription's id; never held together with
  /// mutex_.
  mutable rt::PiMutex interest_mutex_;
  std::map<std::uint64_t, InterestSet> interest_sets_{};
  mutable rt::PiMutex links_mutex_;
  std::vector<std::unique_ptr<Link>> links_{};  ///< Destroyed first.
};

}  // namespace rtpm::events
