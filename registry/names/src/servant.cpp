#include "rtpm/names/servant.hpp"

#include <algorithm>
#include <array>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "entries.hpp"
#include "idl.hpp"
#include "name.hpp"
#include "query.hpp"
#include "replica.hpp"
#include "rtpm/access/grants.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/host.hpp"
#include "rtpm/rt/log.hpp"
#include "rtpm/rt/memory.hpp"
#include "rtpm/rt/pi_mutex.hpp"
#include "rtpm/wire/limits.hpp"
#include "shared_writer.hpp"
#include "watches.hpp"
#include "write_queue.hpp"

namespace rtpm::names {
namespace {

/// Conversion of requests to the store's types.
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

/// Allows one sentence per second. Returns its suffix, which counts the suppressed ones;
/// nullopt if this sentence is suppressed.
std::optional<std::string> admit(LogLimit& limit, MonotonicTime now) {
  if (!limit.admit(now)) return std::nullopt;
  const std::uint64_t count = limit.take_all_suppressed();
  return count == 0 ? "" : " (and " + std::to_string(count) + " more before)";
}

Answer answer_of_result(const expected<void, Refusal>& result) {
  return result ? names::answer_of(Outcome::kDone)
                : names::answer_of(result.error().outcome, result.error().component);
}

// Upper bounds of FlatBuffers' overhead, so that a page is known to fit before it is written: a
// text has length, terminator and padding; a table has a vtable offset, fields and padding; the
// vector has an offset per entry.
constexpr std::size_t kTextOverheadMax = 4 + 1 + 3;
constexpr std::size_t kEntryOverheadMax = 3 * kTextOverheadMax + (4 + 3 * 4 + 2 * 8 + 16) + 4;
constexpr std::size_t kPageOverheadMax = 112;
// The builder's scratch space at the other end of the memory.
constexpr std::size_t kScratchSizeMax = 128;
constexpr std::size_t kPageSizeMax = wire::kDatagramPayloadSizeMax - kScratchSizeMax;

std::size_t entry_size_max(const Record& record) {
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

/// The generated ids of the methods that change names.
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

/// A change that a shared storage has not made by then is answered with kStoreUnreachable, while
/// the caller still waits.
MonotonicTime answer_by(const rpc::CallContext& context) {
  if (context.deadline == kNever) return context.received + std::chrono::seconds{5};
  return context.deadline - (context.deadline - context.received) / 8;
}

/// Every method allocates: the lane of a registry is not real-time. See make_servant().
class RegistryServant final : public NamesServant {
  using Bind = expected<Granted, Refusal> (Store::*)(const Claim&, MonotonicTime);

 public:
  RegistryServant(RegistryConfig config, StoredContent content)
      : storage_(std::move(config.storage)),
        shared_storage_(std::move(config.shared_storage)),
        policy_(config.policy ? std::move(config.policy) : std::make_unique<const GrantPolicy>()),
        store_(config.limits, content.first_revision, storage_.get()),
        report_(config.report ? std::move(config.report) : [](std::string_view sentence) {
          rt::print_error("rtpm-names", sentence);
        }) {
    if (shared_storage_) store_.share(*shared_storage_, rt::now());
    store_.restore(std::move(content.names), rt::now());
    store_.restore_lapsed(std::move(content.lapsed));
    for (const std::string& fault : content.faults)
      report_(fault);
  }
  RegistryServant(const RegistryServant&) = delete;
  RegistryServant& operator=(const RegistryServant&) = delete;
  ~RegistryServant() override {
    if (!shared_storage_) return;
    shared_storage_->stop();
    queue_.stop();
  }

  /// Begins to receive the changes of other registries.
  expected<void, SetupError> follow() {
    if (auto started = queue_.start(); !started) return started;
    return shared_storage_->follow(replica_);
  }

  /// Changes in a shared storage wait for it on their own thread.
  rpc::DispatchResult dispatch(std::uint16_t method_id, ConstBytes request, MutableBytes reply,
                               const rpc::CallContext& context) override {
    if (!shared_storage_ || context.deferral == nullptr || !is_change(method_id)) {
      return NamesServant::dispatch(method_id, request, reply, context);
    }
    const rt::AllowAllocationScope not_real_time;
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
    return bind(claim_of(request, context.caller), reply, &Store::bind, context);
  }
  rpc::Result<void> rebind(const BindRequest& request, rpc::ReplyBuilder<BindReply>& reply,
                           const rpc::CallContext& context) override {
    return bind(claim_of(request, context.caller), reply, &Store::rebind, context);
  }

  rpc::Result<Answer> renew(const RenewRequest& request, const rpc::CallContext& context) override {
    const rt::AllowAllocationScope not_real_time;
    std::unique_lock lock(mutex_);
    if (!allows(context, Operation::kRenew, view_of(request.name()), owner_of(*request.owner()))) {
      return names::answer_of(Outcome::kDenied);
    }
    if (shared_storage_) {
      lock.unlock();
      return answer_of(writer_->renew(view_of(request.name()), owner_of(*request.owner()),
                                      duration_of(request.lease_ns()), answer_by(context)));
    }
    return answer_of(store_.renew(view_of(request.name()), owner_of(*request.owner()),
                                  duration_of(request.lease_ns()), rt::now()));
  }

  rpc::Result<void> offer(const OfferRequest& request, rpc::ReplyBuilder<BindReply>& reply,
                          const rpc::CallContext& context) override {
    const rt::AllowAllocationScope not_real_time;
    Claim claim = claim_of(request, context.caller);
    const auto properties = properties_of(request.properties());
    if (!properties) return unexpected{rpc::Refusal::kBadRequest};
    claim.properties = *properties;
    claim.is_permanent = request.is_permanent();
    const Bind bind_in_store = request.replaces() ? Bind{&Store::rebind} : Bind{&Store::bind};
    return bind(claim, reply, bind_in_store, context);
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
    const rt::AllowAllocationScope not_real_time;
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
                                 ns_of(store_.stale_for(now))));
    return {};
  }

  void watch(const WatchRequest& request, rpc::TableWriter<WatchItem> items,
             const rpc::CallContext& context) override {
    const rt::AllowAllocationScope not_real_time;
    const std::lock_guard lock(mutex_);
    if (!allows(context, Operation::kList, view_of(request.directory()))) {
      return refuse_watch(items, Outcome::kDenied);
    }
    watches_.add(request, std::move(items), context.caller.number,
                 context.identity == nullptr ? nullptr : context.identity->keep());
  }

  rpc::Result<void> list(const ListRequest& request, rpc::ReplyBuilder<ListReply>& reply,
                         const rpc::CallContext& context) override {
    const rt::AllowAllocationScope not_real_time;
    const std::lock_guard lock(mutex_);
    const MonotonicTime now = rt::now();
    const std::string_view directory = view_of(request.directory());
    const auto page = allows(context, Operation::kList, directory)
                          ? list_shown(directory, view_of(request.after()), now, context.identity)
                          : expected<Page, Refusal>(unexpected{denied()});
    flatbuffers::FlatBufferBuilder& builder = reply.builder();
    if (!page) {
      const Answer answer = names::answer_of(page.error().outcome, page.error().component);
      reply.finish(CreateListReply(builder, &answer, 0, true, ns_of(store_.stale_for(now))));
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
                                 ns_of(store_.stale_for(now))));
    return {};
  }

  rpc::Result<void> lapsed(const ListRequest& request, rpc::ReplyBuilder<LapsedReply>& reply,
                           const rpc::CallContext& context) override {
    const rt::AllowAllocationScope not_real_time;
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
      size_max +=
          record.name.size() + record.url.size() + record.interface.size() + kEntryOverheadMax;
      if (size_max > kPageSizeMax) break;
      const auto name = builder.CreateString(record.name);
      const auto url = builder.CreateString(record.url);
      const auto interface = builder.CreateString(record.interface);
      const std::uint64_t caller = context.caller.number;
      const bool is_of_other_host =
          record.host != 0 && caller != 0 && record.host != own_host_as_one(caller);
      entries.push_back(CreateLapsedEntry(builder, name, url, interface, record.revision,
                                          ns_of(now - record.ended), is_of_other_host));
    }
    const Answer answer = names::answer_of(Outcome::kDone);
    reply.finish(
        CreateLapsedReply(builder, &answer, builder.CreateVector(entries), each == all.end()));
    return {};
  }

  rpc::Result<Answer> unbind(const UnbindRequest& request,
                             const rpc::CallContext& context) override {
    const rt::AllowAllocationScope not_real_time;
    std::unique_lock lock(mutex_);
    if (!allows(context, Operation::kUnbind, view_of(request.name()), owner_of(*request.owner()))) {
      return names::answer_of(Outcome::kDenied);
    }
    if (shared_storage_) {
      lock.unlock();
      return answer_of(writer_->unbind(view_of(request.name()), owner_of(*request.owner()),
                                       request.holder_revision(), answer_by(context)));
    }
    const auto unbound = store_.unbind(view_of(request.name()), owner_of(*request.owner()),
                                       rt::now(), request.holder_revision());
    if (!unbound && is_of_storage(unbound.error().outcome)) report_trouble(rt::now());
    watches_.wake();
    return answer_of(unbound);
  }

  rpc::Result<void> report(rpc::ReplyBuilder<Report>& reply,
                           const rpc::CallContext& context) override {
    const rt::AllowAllocationScope not_real_time;
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
    for (const Store::HostUse& use : store_.hosts(kReportedHostMax)) {
      const auto host = builder.CreateString(to_string(rpc::CallerHost{use.host}));
      hosts.push_back(CreateHostUse(builder, host, static_cast<std::uint32_t>(use.name_count),
                                    static_cast<std::uint32_t>(use.owner_count)));
    }
    const auto refused_list = builder.CreateVector(refused);
    const auto host_list = builder.CreateVector(hosts);
    flatbuffers::Offset<flatbuffers::String> place{};
    flatbuffers::Offset<flatbuffers::String> trouble{};
    if (shared_storage_) {
      place = builder.CreateString(shared_storage_->place());
      const std::string words =
          store_.storage_trouble().empty() ? replica_.trouble() : store_.storage_trouble();
      trouble = builder.CreateString(words.substr(0, kReportedTroubleMax));
    }
    reply.finish(CreateReport(builder, static_cast<std::uint32_t>(store_.size()),
                              static_cast<std::uint32_t>(store_.owner_count()), takeover_count_,
                              refused_list, host_list, static_cast<std::uint32_t>(watches_.count()),
                              watches_.cut_off_count(), place, ns_of(store_.stale_for(rt::now())),
                              trouble, static_cast<std::uint32_t>(queue_.count()),
                              queue_.overload_count()));
    return {};
  }

 private:
  rpc::Result<void> look_up(const ResolveRequest& request, rpc::ReplyBuilder<ResolveReply>& reply,
                            const rpc::CallContext& context, EntryDetail detail) {
    const rt::AllowAllocationScope not_real_time;
    const std::lock_guard lock(mutex_);
    const MonotonicTime now = rt::now();
    auto record = allows(context, Operation::kResolve, view_of(request.name()))
                      ? store_.resolve(view_of(request.name()), now)
                      : expected<const Record*, Refusal>(unexpected{denied()});
    // A name that the caller may not see does not exist for it.
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
    reply.finish(CreateResolveReply(builder, &answer, entry, ns_of(store_.stale_for(now))));
    return {};
  }

  /// The records that the caller may see, of the page or, as long as there are none, of the next
  /// one.
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

  rpc::Result<void> bind(const Claim& claim, rpc::ReplyBuilder<BindReply>& reply,
                         Bind bind_in_store, const rpc::CallContext& context) {
    const rt::AllowAllocationScope not_real_time;
    if (shared_storage_)
      return bind_shared(claim, reply, bind_in_store == Bind{&Store::rebind}, context);
    std::optional<std::string> sentence;
    {
      const std::lock_guard lock(mutex_);
      const MonotonicTime now = rt::now();
      const auto before = store_.resolve(claim.name, now);
      const Record former = before ? **before : Record{};
      const auto bound = allows(context, Operation::kBind, claim.name, claim.owner)
                             ? (store_.*bind_in_store)(claim, now)
                             : expected<Granted, Refusal>(unexpected{denied()});
      if (!bound) {
        sentence = note_refusal(claim, bound.error(), now, context.identity);
        write_refusal(bound.error(), reply, now);
      } else {
        watches_.wake();
        if (bound->is_takeover) sentence = note_takeover(claim, former, now);
        const Answer answer = names::answer_of(Outcome::kDone);
        reply.finish(CreateBindReply(reply.builder(), &answer, 0, 0, 0, ns_of(bound->lease),
                                     bound->revision));
      }
    }
    if (sentence) report_(*sentence);
    return {};
  }

  rpc::Result<void> bind_shared(const Claim& claim, rpc::ReplyBuilder<BindReply>& reply,
                                bool replaces, const rpc::CallContext& context) {
    std::unique_lock lock(mutex_);
    const bool is_allowed = allows(context, Operation::kBind, claim.name, claim.owner);
    lock.unlock();
    const auto bound =
        is_allowed ? writer_->bind(claim, replaces, answer_by(context))
                   : expected<SharedGrant, SharedRefusal>(unexpected{SharedRefusal{denied()}});
    std::optional<std::string> sentence;
    lock.lock();
    const MonotonicTime now = rt::now();
    if (!bound) {
      sentence = note_refusal(claim, bound.error().refusal, now, context.identity);
      write_refusal(bound.error().refusal, reply, now);
    } else {
      if (bound->granted.is_takeover) sentence = note_takeover(claim, *bound->former, now);
      const Answer answer = names::answer_of(Outcome::kDone);
      reply.finish(CreateBindReply(reply.builder(), &answer, 0, 0, 0, ns_of(bound->granted.lease),
                                   bound->granted.revision));
    }
    lock.unlock();
    if (sentence) report_(*sentence);
    return {};
  }

  /// Answers requests that have no result but success or a refusal.
  [[nodiscard]] Answer answer_of(const expected<void, SharedRefusal>& result) {
    if (result) return names::answer_of(Outcome::kDone);
    const Refusal& refusal = result.error().refusal;
    const std::lock_guard lock(mutex_);
    if (is_of_storage(refusal.outcome)) report_trouble(rt::now());
    return names::answer_of(refusal.outcome, refusal.component);
  }
  [[nodiscard]] static Answer answer_of(const expected<void, Refusal>& result) {
    return names::answer_of_result(result);
  }

  static void write_refusal(const Refusal& refusal, rpc::ReplyBuilder<BindReply>& reply,
                            MonotonicTime now) {
    flatbuffers::FlatBufferBuilder& builder = reply.builder();
    const Record* const holder = refusal.holder;
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

  rt::PiMutex mutex_;
  std::unique_ptr<Storage> storage_;
  std::unique_ptr<SharedStorage> shared_storage_;
  std::unique_ptr<const Policy> policy_;
  Store store_;
  Watches watches_{mutex_, store_,
                   shared_storage_ ? shared_storage_->identity() : rt::random_u64()};
  RegistryReport report_;
  Replica replica_{mutex_, store_, watches_, store_.log().revision(),
                   [this](std::string_view text) { report_(text); }};
  std::optional<SharedWriter> writer_{
      shared_storage_
          ? std::optional<SharedWriter>(std::in_place, mutex_, store_, *shared_storage_, replica_)
          : std::nullopt};
  WriteQueue queue_{};
  std::array<std::uint64_t, static_cast<std::size_t>(OutcomeCode::MAX) + 1> refused_counts_{};
  std::uint64_t takeover_count_ = 0;
  LogLimit limit_log_{{.burst = 2}};
  LogLimit takeover_log_{{.burst = 2}};
  LogLimit storage_log_{{.burst = 2}};
};

}  // namespace

std::unique_ptr<rpc::Servant> make_servant(Limits limits, RegistryReport report) {
  // A random first revision, so that revisions of two starts differ.
  return std::make_unique<RegistryServant>(
      RegistryConfig{limits, std::move(report)},
      StoredContent{.first_revision = rt::random_u64() >> 1 | 1});
}

expected<std::unique_ptr<rpc::Servant>, SetupError> make_registry(RegistryConfig config) {
  StoredContent content{.first_revision = rt::random_u64() >> 1 | 1};
  Storage* const storage =
      config.shared_storage ? config.shared_storage.get() : config.storage.get();
  if (storage != nullptr) {
    auto loaded = storage->load();
    if (!loaded) return unexpected{std::move(loaded.error())};
    content = std::move(*loaded);
  }
  const bool is_shared = config.shared_storage != nullptr;
  auto registry = std::make_unique<RegistryServant>(std::move(config), std::move(content));
  if (is_shared) {
    if (auto followed = registry->follow(); !followed) {
      return unexpected{std::move(followed.error())};
    }
  }
  return registry;
}

}  // namespace rtpm::names
