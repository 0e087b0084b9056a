#include "rtpm/names/servant.hpp"

#include <algorithm>
#include <array>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "model/idl.hpp"
#include "model/name.hpp"
#include "model/query.hpp"
#include "rtpm/access/grants.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/host.hpp"
#include "rtpm/rt/log.hpp"
#include "rtpm/rt/memory.hpp"
#include "rtpm/rt/pi_mutex.hpp"
#include "rtpm/wire/limits.hpp"
#include "servant/entries.hpp"
#include "servant/watches.hpp"
#include "servant/write_queue.hpp"

namespace rtpm::names {
namespace {

/// Converts requests to the store's types.
template <class Request>
Claim claim_of(const Request& request, rpc::CallerHost caller) {
  return {.name = view_of(request.name()),
          .url = view_of(request.url()),
          .interface = view_of(request.interface()),
          .owner = owner_of(*request.owner()),
          .lease = duration_of(request.lease_ns()),
          .holder_revision = request.holder_revision(),
          .allows_takeover = request.allow_takeover(),
          .host = caller.number};
}

bool is_limit(Outcome outcome) noexcept {
  return outcome == Outcome::kFull || outcome == Outcome::kOwnerFull ||
         outcome == Outcome::kHostFull || outcome == Outcome::kHostOwnersFull ||
         outcome == Outcome::kOwnerPropertiesFull || outcome == Outcome::kPropertiesFull;
}

bool is_of_storage(Outcome outcome) noexcept {
  return outcome == Outcome::kReadOnly || outcome == Outcome::kStorageFull ||
         outcome == Outcome::kNotStored || outcome == Outcome::kStoreUnreachable;
}

/// Allows one sentence per second. Returns a suffix that counts the suppressed ones; nullopt if
/// this sentence is suppressed.
std::optional<std::string> admit(LogLimit& limit, MonotonicTime now) {
  if (!limit.admit(now)) return std::nullopt;
  const std::uint64_t count = limit.take_all_suppressed();
  return count == 0 ? "" : " (and " + std::to_string(count) + " more before)";
}

// Upper bounds of FlatBuffers' overhead, so that a page is known to fit before it is written: a
// text has length, terminator and padding; a table has a vtable offset, fields and padding; the
// vector has one offset per entry.
constexpr std::size_t kTextOverheadMax = 4 + 1 + 3;
constexpr std::size_t kEntryOverheadMax = 3 * kTextOverheadMax + (4 + 3 * 4 + 2 * 8 + 16) + 4;
constexpr std::size_t kPageOverheadMax = 112;
// The builder's scratch space at the other end of the memory.
constexpr std::size_t kScratchSizeMax = 128;
constexpr std::size_t kPageSizeMax = wire::kDatagramPayloadSizeMax - kScratchSizeMax;

template <class T>
std::size_t entry_size_max(const T& record) {
  return record.name.size() + record.url.size() + record.interface.size() + kEntryOverheadMax;
}

constexpr std::size_t kEntrySizeMax =
    kNameSizeMax + kUrlSizeMax + kInterfaceSizeMax + kEntryOverheadMax;
static_assert(kPageOverheadMax + kEntrySizeMax <= kPageSizeMax,
              "a page holds at least one entry, else list() would not end");

/// Limits of a reply to find(): entries, and bytes after which no further entry is added.
constexpr std::size_t kFoundCountMax = 1000;
constexpr std::size_t kFoundSizeMax = std::size_t{256} * 1024;

/// Upper bound of names per page.
constexpr std::size_t kPageCountMax = kPageSizeMax / kEntryOverheadMax;

/// Whether the generated id belongs to a method that changes names.
bool is_change(std::uint16_t method_id) noexcept {
  switch (method_id) {
    case 1:  // bind
    case 2:  // rebind
    case 3:  // renew
    case 6:  // unbind
    case 8:  // offer
      return true;
    default:
      return false;
  }
}

/// When a change that the storage has not made is answered with kStoreUnreachable: while the caller
/// still waits.
MonotonicTime answer_by(const rpc::CallContext& context) {
  if (context.deadline == kNever) return context.received + std::chrono::seconds{5};
  return context.deadline - (context.deadline - context.received) / 8;
}

/// All methods allocate, because the lane of a registry is not real-time. See make_servant().
class RegistryServant final : public NamesServant, private Storage::Follower {
 public:
  RegistryServant(RegistryConfig config, StoredContent content)
      : storage_(std::move(config.storage)),
        place_(std::move(content.place)),
        policy_(std::move(config.policy)),
        store_(config.limits, content.first_revision, storage_.get()),
        watches_(mutex_, store_, *storage_,
                 content.identity != 0 ? content.identity : rt::random_u64()),
        report_(std::move(config.report)) {
    store_.restore(std::move(content.names), rt::now());
    store_.restore_lapsed(std::move(content.lapsed));
    for (const std::string& fault : content.faults)
      report_(fault);
  }
  RegistryServant(const RegistryServant&) = delete;
  RegistryServant& operator=(const RegistryServant&) = delete;
  ~RegistryServant() override {
    storage_->stop();
    queue_.stop();
  }

  /// Starts to receive the changes of a storage that reports them. As such a storage waits, changes
  /// run on separate threads.
  expected<void, SetupError> start() {
    if (auto followed = storage_->follow(*this); !followed) return followed;
    return storage_->reports_changes() ? queue_.start() : expected<void, SetupError>();
  }

  rpc::DispatchResult dispatch(std::uint16_t method_id, ConstBytes request, MutableBytes reply,
                               const rpc::CallContext& context) override {
    const rt::AllowAllocationScope not_real_time;
    if (!queue_.is_running() || context.deferral == nullptr || !is_change(method_id)) {
      return NamesServant::dispatch(method_id, request, reply, context);
    }
    const std::uint64_t host = context.caller.number;
    if (!queue_.reserve(host)) return {wire::Status::kOverload, 0};
    rpc::DeferredReply deferred = context.deferral->defer();
    if (!deferred) {
      queue_.release(host);
      return {wire::Status::kOverload, 0};
    }
    const auto later = std::make_shared<rpc::DeferredReply>(std::move(deferred));
    rpc::CallContext kept = context;
    kept.deferral = nullptr;
    const auto identity = context.identity == nullptr ? nullptr : context.identity->keep();
    kept.identity = identity.get();
    queue_.add(host, [this, later, method_id, kept, identity,
                      bytes = std::vector<std::byte>(request.begin(), request.end())] {
      if (!later->is_awaited() || rt::now() >= kept.deadline) return;
      const auto done = NamesServant::dispatch(method_id, bytes, later->buffer(), kept);
      later->complete(done.status, done.reply_size);
    });
    return {};
  }

  rpc::Result<void> bind(const BindRequest& request, rpc::ReplyBuilder<BindReply>& reply,
                         const rpc::CallContext& context) override {
    return bind(claim_of(request, context.caller), /*replaces=*/false, reply, context);
  }
  rpc::Result<void> rebind(const BindRequest& request, rpc::ReplyBuilder<BindReply>& reply,
                           const rpc::CallContext& context) override {
    return bind(claim_of(request, context.caller), /*replaces=*/true, reply, context);
  }

  rpc::Result<Answer> renew(const RenewRequest& request, const rpc::CallContext& context) override {
    const std::lock_guard lock(mutex_);
    const Owner owner = owner_of(*request.owner());
    if (!allows(context, Operation::kRenew, view_of(request.name()), owner)) {
      return names::answer_of(Outcome::kDenied);
    }
    return answer_of(store_.renew(view_of(request.name()), owner, duration_of(request.lease_ns()),
                                  rt::now(), answer_by(context)));
  }

  rpc::Result<void> offer(const OfferRequest& request, rpc::ReplyBuilder<BindReply>& reply,
                          const rpc::CallContext& context) override {
    Claim claim = claim_of(request, context.caller);
    const auto properties = properties_of(request.properties());
    if (!properties) return unexpected{rpc::Refusal::kBadRequest};
    claim.properties = *properties;
    claim.is_permanent = request.is_permanent();
    return bind(claim, request.replaces(), reply, context);
  }

  rpc::Result<void> resolve(const ResolveRequest& request, rpc::ReplyBuilder<ResolveReply>& reply,
                            const rpc::CallContext& context) override {
    return look_up(request, reply, context, EntryDetail::kHost);
  }
  rpc::Result<void> describe(const ResolveRequest& request, rpc::ReplyBuilder<ResolveReply>& reply,
                             const rpc::CallContext& context) override {
    return look_up(request, reply, context, EntryDetail::kAll);
  }

  rpc::Result<void> find(const FindRequest& request, rpc::ReplyBuilder<FindReply>& reply,
                         const rpc::CallContext& context) override {
    const std::lock_guard lock(mutex_);
    const MonotonicTime now = rt::now();
    const QueryTexts texts{view_of(request.interface()), view_of(request.predicate()),
                           view_of(request.preference())};
    const std::size_t limit = request.limit() == 0
                                  ? kFoundCountMax
                                  : std::min<std::size_t>(request.limit(), kFoundCountMax);
    const auto found =
        allows(context, Operation::kList, {})
            ? names::find(store_.index(now), texts, limit, rt::random_u64(), context.identity)
            : expected<Found, QueryError>(unexpected{QueryError{Outcome::kDenied}});
    flatbuffers::FlatBufferBuilder& builder = reply.builder();
    if (!found) {
      const QueryError& error = found.error();
      const Answer answer = names::answer_of(error.outcome);
      const auto why = builder.CreateString(error.error.what);
      reply.finish(CreateFindReply(builder, &answer, 0, 0,
                                   static_cast<std::uint32_t>(error.error.offset), why));
      return {};
    }
    std::vector<flatbuffers::Offset<Entry>> entries;
    for (const Record* record : found->records) {
      if (builder.GetSize() > kFoundSizeMax) break;
      entries.push_back(
          write_entry(builder, *record, now, context.caller.number, EntryDetail::kAll));
    }
    const Answer answer = names::answer_of(Outcome::kDone);
    const auto list = builder.CreateVector(entries);
    flatbuffers::Offset<flatbuffers::String> note{};
    if (!found->note.empty()) note = builder.CreateString(found->note);
    reply.finish(CreateFindReply(builder, &answer, list,
                                 static_cast<std::uint32_t>(found->accepted_count), 0, 0, note,
                                 ns_of(storage_->stale_for(now))));
    return {};
  }

  void watch(const WatchRequest& request, rpc::TableWriter<WatchItem> items,
             const rpc::CallContext& context) override {
    const std::lock_guard lock(mutex_);
    if (!allows(context, Operation::kList, view_of(request.directory()))) {
      return refuse_watch(items, Outcome::kDenied);
    }
    watches_.add(request, std::move(items), context.caller.number,
                 context.identity == nullptr ? nullptr : context.identity->keep());
  }

  rpc::Result<void> list(const ListRequest& request, rpc::ReplyBuilder<ListReply>& reply,
                         const rpc::CallContext& context) override {
    const std::lock_guard lock(mutex_);
    const MonotonicTime now = rt::now();
    const std::string_view directory = view_of(request.directory());
    const auto page = allows(context, Operation::kList, directory)
                          ? list_shown(directory, view_of(request.after()), now, context.identity)
                          : expected<Page, Refusal>(unexpected{denied()});
    flatbuffers::FlatBufferBuilder& builder = reply.builder();
    if (!page) {
      const Answer answer = names::answer_of(page.error().outcome, page.error().component);
      reply.finish(CreateListReply(builder, &answer, 0, true, ns_of(storage_->stale_for(now))));
      return {};
    }
    std::size_t size_max = kPageOverheadMax;
    std::vector<flatbuffers::Offset<Entry>> entries;
    for (const Record* record : page->records) {
      size_max += entry_size_max(*record);
      if (size_max > kPageSizeMax) break;
      entries.push_back(
          write_entry(builder, *record, now, context.caller.number, EntryDetail::kBrief));
    }
    const bool is_last = page->is_last && entries.size() == page->records.size();
    const Answer answer = names::answer_of(Outcome::kDone);
    reply.finish(CreateListReply(builder, &answer, builder.CreateVector(entries), is_last,
                                 ns_of(storage_->stale_for(now))));
    return {};
  }

  rpc::Result<void> lapsed(const ListRequest& request, rpc::ReplyBuilder<LapsedReply>& reply,
                           const rpc::CallContext& context) override {
    const std::lock_guard lock(mutex_);
    flatbuffers::FlatBufferBuilder& builder = reply.builder();
    const std::string directory(view_of(request.directory()));
    if (!allows(context, Operation::kList, directory)) {
      const Answer answer = names::answer_of(Outcome::kDenied);
      reply.finish(CreateLapsedReply(builder, &answer, 0, true));
      return {};
    }
    const MonotonicTime now = rt::now();
    const auto& all = store_.lapsed(now).all();
    std::size_t size_max = kPageOverheadMax;
    std::vector<flatbuffers::Offset<LapsedEntry>> entries;
    auto each = all.upper_bound(view_of(request.after()));
    for (; each != all.end(); ++each) {
      const LapsedRecord& record = each->second;
      const bool is_below =
          directory.empty() || record.name == directory || record.name.starts_with(directory + "/");
      if (!is_below || !may_see(context.identity, record.name)) continue;
      size_max += entry_size_max(record);
      if (size_max > kPageSizeMax) break;
      const auto name = builder.CreateString(record.name);
      const auto url = builder.CreateString(record.url);
      const auto interface = builder.CreateString(record.interface);
      entries.push_back(CreateLapsedEntry(builder, name, url, interface, record.revision,
                                          ns_of(now - record.ended),
                                          is_other_host(record.host, context.caller.number)));
    }
    const Answer answer = names::answer_of(Outcome::kDone);
    reply.finish(
        CreateLapsedReply(builder, &answer, builder.CreateVector(entries), each == all.end()));
    return {};
  }

  rpc::Result<Answer> unbind(const UnbindRequest& request,
                             const rpc::CallContext& context) override {
    const std::lock_guard lock(mutex_);
    const Owner owner = owner_of(*request.owner());
    if (!allows(context, Operation::kUnbind, view_of(request.name()), owner)) {
      return names::answer_of(Outcome::kDenied);
    }
    const auto unbound = store_.unbind(view_of(request.name()), owner, rt::now(),
                                       request.holder_revision(), answer_by(context));
    watches_.wake();
    return answer_of(unbound);
  }

  rpc::Result<void> report(rpc::ReplyBuilder<Report>& reply,
                           const rpc::CallContext& context) override {
    const std::lock_guard lock(mutex_);
    if (!allows(context, Operation::kReport, {})) return unexpected{rpc::Refusal::kNotAllowed};
    flatbuffers::FlatBufferBuilder& builder = reply.builder();
    std::vector<flatbuffers::Offset<OutcomeCount>> refused;
    for (std::size_t code = 0; code < refused_counts_.size(); ++code) {
      if (refused_counts_[code] == 0) continue;
      refused.push_back(
          CreateOutcomeCount(builder, static_cast<OutcomeCode>(code), refused_counts_[code]));
    }
    std::vector<flatbuffers::Offset<HostUse>> hosts;
    for (const Usage::HostUse& use : store_.usage().hosts(kReportedHostMax)) {
      const auto host = builder.CreateString(to_string(rpc::CallerHost{use.host}));
      hosts.push_back(CreateHostUse(builder, host, static_cast<std::uint32_t>(use.name_count),
                                    static_cast<std::uint32_t>(use.owner_count)));
    }
    const auto refused_list = builder.CreateVector(refused);
    const auto host_list = builder.CreateVector(hosts);
    flatbuffers::Offset<flatbuffers::String> place{};
    flatbuffers::Offset<flatbuffers::String> trouble{};
    if (!place_.empty()) {
      place = builder.CreateString(place_);
      const std::string& words =
          store_.storage_trouble().empty() ? trouble_ : store_.storage_trouble();
      trouble = builder.CreateString(words.substr(0, kReportedTroubleMax));
    }
    reply.finish(
        CreateReport(builder, static_cast<std::uint32_t>(store_.size()),
                     static_cast<std::uint32_t>(store_.usage().owner_count()), takeover_count_,
                     refused_list, host_list, static_cast<std::uint32_t>(watches_.count()),
                     watches_.cut_off_count(), place, ns_of(storage_->stale_for(rt::now())),
                     trouble, static_cast<std::uint32_t>(queue_.count()), queue_.overload_count()));
    return {};
  }

 private:
  rpc::Result<void> look_up(const ResolveRequest& request, rpc::ReplyBuilder<ResolveReply>& reply,
                            const rpc::CallContext& context, EntryDetail detail) {
    const std::lock_guard lock(mutex_);
    const MonotonicTime now = rt::now();
    auto record = allows(context, Operation::kResolve, view_of(request.name()))
                      ? store_.resolve(view_of(request.name()), now)
                      : expected<const Record*, Refusal>(unexpected{denied()});
    // A name that the caller may not see does not exist for the caller.
    if (!may_see(context.identity, view_of(request.name())))
      record = unexpected{Refusal{Outcome::kNotFound}};
    flatbuffers::FlatBufferBuilder& builder = reply.builder();
    flatbuffers::Offset<Entry> entry;
    Answer answer = names::answer_of(Outcome::kDone);
    if (record) {
      entry = write_entry(builder, **record, now, context.caller.number, detail);
    } else {
      answer = names::answer_of(record.error().outcome, record.error().component);
    }
    reply.finish(CreateResolveReply(builder, &answer, entry, ns_of(storage_->stale_for(now))));
    return {};
  }

  /// The page's records that the caller may see; if there are none, those of the next page that has
  /// some.
  expected<Page, Refusal> list_shown(std::string_view directory, std::string_view after,
                                     MonotonicTime now, const rpc::Caller* identity) {
    auto page = store_.list(directory, after, kPageCountMax, now);
    while (page && identity != nullptr && !page->records.empty()) {
      const std::string last = page->records.back()->name;
      std::erase_if(page->records,
                    [&](const Record* each) { return !may_see(identity, each->name); });
      if (page->is_last || !page->records.empty()) break;
      page = store_.list(directory, last, kPageCountMax, now);
    }
    return page;
  }

  /// Must fit a datagram together with all outcomes.
  static constexpr std::size_t kReportedHostMax = 8;
  static constexpr std::size_t kReportedTroubleMax = 300;

  rpc::Result<void> bind(const Claim& claim, bool replaces, rpc::ReplyBuilder<BindReply>& reply,
                         const rpc::CallContext& context) {
    std::optional<std::string> sentence;
    {
      const std::lock_guard lock(mutex_);
      const MonotonicTime by = answer_by(context);
      const auto bound = !allows(context, Operation::kBind, claim.name, claim.owner)
                             ? expected<Bound, Refusal>(unexpected{denied()})
                         : replaces ? store_.rebind(claim, rt::now(), by)
                                    : store_.bind(claim, rt::now(), by);
      const MonotonicTime now = rt::now();
      if (!bound) {
        sentence = note_refusal(claim, bound.error(), now, context.identity);
        write_refusal(bound.error(), reply, now);
      } else {
        watches_.wake();
        if (bound->taken_from) sentence = note_takeover(claim, *bound->taken_from, now);
        const Answer answer = names::answer_of(Outcome::kDone);
        reply.finish(CreateBindReply(reply.builder(), &answer, 0, 0, 0, ns_of(bound->lease),
                                     bound->revision));
      }
    }
    if (sentence) report_(*sentence);
    return {};
  }

  /// Answers requests whose only result is success or a refusal.
  [[nodiscard]] Answer answer_of(const expected<void, Refusal>& result) {
    if (result) return names::answer_of(Outcome::kDone);
    if (is_of_storage(result.error().outcome)) report_trouble(rt::now());
    return names::answer_of(result.error().outcome, result.error().component);
  }

  static void write_refusal(const Refusal& refusal, rpc::ReplyBuilder<BindReply>& reply,
                            MonotonicTime now) {
    flatbuffers::FlatBufferBuilder& builder = reply.builder();
    const Record* const holder = refusal.holder.get();
    flatbuffers::Offset<flatbuffers::String> url;
    if (holder != nullptr) url = builder.CreateString(holder->url);
    const Answer answer = names::answer_of(refusal.outcome, refusal.component);
    reply.finish(CreateBindReply(builder, &answer, url,
                                 holder == nullptr ? 0 : ns_of(lease_left(*holder, now)),
                                 holder == nullptr ? 0 : holder->revision));
  }

  std::optional<std::string> note_refusal(const Claim& claim, const Refusal& refusal,
                                          MonotonicTime now, const rpc::Caller* identity) {
    ++refused_counts_[static_cast<std::size_t>(refusal.outcome)];
    if (is_of_storage(refusal.outcome)) report_trouble(now);
    const bool is_denied = refusal.outcome == Outcome::kDenied && identity != nullptr;
    if (!is_limit(refusal.outcome) && !is_denied) return std::nullopt;
    const auto more = admit(limit_log_, now);
    if (!more) return std::nullopt;
    if (is_denied) {
      return "refused a bind of " + quoted(claim.name) +
             ", which takes the role administer. To allow it, add to the authorized file: " +
             access::missing_line(identity->subject(), Role::kAdminister, printable(claim.name)) +
             *more;
    }
    return "refused a bind from " + to_string(rpc::CallerHost{claim.host}) + ": " +
           outcome_text(refusal.outcome, claim.name, refusal.component) + *more;
  }

  std::optional<std::string> note_takeover(const Claim& claim, const Record& former,
                                           MonotonicTime now) {
    ++takeover_count_;
    const auto more = admit(takeover_log_, now);
    if (!more) return std::nullopt;
    return "the name " + quoted(claim.name) + " was taken from " + quoted(former.url) +
           ", bound from " + to_string(rpc::CallerHost{former.host}) + ", by " + quoted(claim.url) +
           " from " + to_string(rpc::CallerHost{claim.host}) + *more;
  }

  [[nodiscard]] bool allows(const rpc::CallContext& context, Operation operation,
                            std::string_view name, Owner owner = {}) const {
    return policy_->allows({context.caller, context.session, owner, context.identity}, operation,
                           name);
  }
  [[nodiscard]] static Refusal denied() { return {Outcome::kDenied}; }

  void report_trouble(MonotonicTime now) {
    if (const auto more = admit(storage_log_, now)) report_(store_.storage_trouble() + *more);
  }

  // ---- Storage::Follower

  void lock() override { mutex_.lock(); }
  void unlock() override { mutex_.unlock(); }
  void on_changes(std::vector<ReportedChange> changes) override {
    const std::lock_guard lock(mutex_);
    store_.take(std::move(changes), rt::now());
    watches_.wake();
  }
  void on_restart(std::vector<StoredName> names, std::uint64_t revision,
                  bool is_replaced) override {
    const std::lock_guard lock(mutex_);
    store_.take_all(std::move(names), revision, rt::now());
    // The same revision now means another change, even for a watch that resumes at another
    // registry.
    if (is_replaced) watches_.begin_history(rt::random_u64());
    watches_.wake();
  }
  void on_trouble(const std::string& sentence) override {
    {
      const std::lock_guard lock(mutex_);
      trouble_ = sentence;
      if (!trouble_log_.admit(rt::now())) return;
    }
    report_(sentence);
  }

  rt::PiMutex mutex_;
  const std::unique_ptr<Storage> storage_;
  const std::string place_;  ///< The storage's location, if it is shared.
  const std::unique_ptr<const Policy> policy_;
  Store store_;
  Watches watches_;
  const RegistryReport report_;
  std::string trouble_{};  ///< The storage's last trouble, in words; empty if there is none.
  LogLimit trouble_log_{{.burst = 4}};
  WriteQueue queue_{};
  std::array<std::uint64_t, static_cast<std::size_t>(OutcomeCode::MAX) + 1> refused_counts_{};
  std::uint64_t takeover_count_ = 0;
  LogLimit limit_log_{{.burst = 2}};
  LogLimit takeover_log_{{.burst = 2}};
  LogLimit storage_log_{{.burst = 2}};
};

}  // namespace

std::unique_ptr<rpc::Servant> make_servant(Limits limits, RegistryReport report) {
  // An in-memory registry can't fail.
  return std::move(*make_registry({.limits = limits, .report = std::move(report)}));
}

expected<std::unique_ptr<rpc::Servant>, SetupError> make_registry(RegistryConfig config) {
  if (!config.storage) config.storage = std::make_unique<Storage>();
  if (!config.policy) config.policy = std::make_unique<const GrantPolicy>();
  if (!config.report) {
    config.report = [](std::string_view sentence) { rt::print_error("rtpm-names", sentence); };
  }
  auto content = config.storage->load();
  if (!content) return unexpected{std::move(content.error())};
  auto registry = std::make_unique<RegistryServant>(std::move(config), std::move(*content));
  if (auto started = registry->start(); !started) return unexpected{std::move(started.error())};
  return registry;
}

}  // namespace rtpm::names
