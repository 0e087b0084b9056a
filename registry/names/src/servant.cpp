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
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/host.hpp"
#include "rtpm/rt/log.hpp"
#include "rtpm/rt/memory.hpp"
#include "rtpm/rt/pi_mutex.hpp"
#include "rtpm/wire/limits.hpp"
#include "watches.hpp"

namespace rtpm::names {
namespace {

/// Requests in the store's types.
template <class Request>
Claim claim_of(const Request& request, rpc::CallerHost caller) {
  return {.name = view_of(request.name()),
          .url = view_of(request.url()),
          .interface = view_of(request.interface()),
          .owner = owner_of(*request.owner()),
          .lease = duration_of(request.lease_ns()),
          .holder_revision = request.holder_revision(),
          .allows_takeover = request.allow_takeover(),
          .host = caller.ipv4};
}

bool is_limit(Outcome outcome) noexcept {
  return outcome == Outcome::kFull || outcome == Outcome::kOwnerFull ||
         outcome == Outcome::kHostFull || outcome == Outcome::kHostOwnersFull ||
         outcome == Outcome::kOwnerPropertiesFull || outcome == Outcome::kPropertiesFull;
}

bool is_of_storage(Outcome outcome) noexcept {
  return outcome == Outcome::kReadOnly || outcome == Outcome::kStorageFull ||
         outcome == Outcome::kNotStored;
}

/// One sentence per second: its suffix, which counts those held back; nullopt: it is held back.
std::optional<std::string> admit(LogLimit& limit, MonotonicTime now) {
  if (!limit.admit(now)) return std::nullopt;
  const std::uint64_t count = limit.take_all_suppressed();
  return count == 0 ? "" : " (and " + std::to_string(count) + " more before)";
}

Answer answer_of(const expected<void, Refusal>& result) {
  return result ? names::answer_of(Outcome::kDone)
                : names::answer_of(result.error().outcome, result.error().component);
}

// Upper bounds of FlatBuffers' overhead, so that a page is known to fit before it is written: a
// text has length, terminator and padding; a table has a vtable offset, fields and padding; the
// vector has an offset per entry.
constexpr std::size_t kTextOverheadMax = 4 + 1 + 3;
constexpr std::size_t kEntryOverheadMax = 3 * kTextOverheadMax + (4 + 3 * 4 + 2 * 8 + 8) + 4;
constexpr std::size_t kPageOverheadMax = 96;
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

/// Of a reply to find(): entries, and bytes after which no further entry is added.
constexpr std::size_t kFoundCountMax = 1000;
constexpr std::size_t kFoundSizeMax = std::size_t{256} * 1024;

/// Upper bound of names per page.
constexpr std::size_t kPageCountMax = kPageSizeMax / kEntryOverheadMax;

/// Every method allocates: the lane of a registry is not real-time. See make_servant().
class RegistryServant final : public NamesServant {
  using Bind = expected<Granted, Refusal> (Store::*)(const Claim&, MonotonicTime);

 public:
  RegistryServant(RegistryConfig config, StoredContent content)
      : storage_(std::move(config.storage)),
        policy_(config.policy ? std::move(config.policy) : std::make_unique<const OpenPolicy>()),
        store_(config.limits, content.first_revision, storage_.get()),
        report_(config.report ? std::move(config.report) : [](std::string_view sentence) {
          rt::print_error("rtpm-names", sentence);
        }) {
    store_.restore(std::move(content.names), rt::now());
    for (const std::string& fault : content.faults)
      report_(fault);
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
    const std::lock_guard lock(mutex_);
    if (!allows(context, Operation::kRenew, view_of(request.name()), owner_of(*request.owner()))) {
      return names::answer_of(Outcome::kDenied);
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
    return look_up(request, reply, context, /*has_properties=*/false);
  }
  rpc::Result<void> describe(const ResolveRequest& request, rpc::ReplyBuilder<ResolveReply>& reply,
                             const rpc::CallContext& context) override {
    return look_up(request, reply, context, /*has_properties=*/true);
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
    const auto found = allows(context, Operation::kList, {})
                           ? names::find(store_.index(now), texts, limit, rt::random_u64())
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
      entries.push_back(write_entry(builder, *record, now, /*has_properties=*/true));
    }
    const Answer answer = names::answer_of(Outcome::kDone);
    const auto list = builder.CreateVector(entries);
    flatbuffers::Offset<flatbuffers::String> note{};
    if (!found->note.empty()) note = builder.CreateString(found->note);
    reply.finish(CreateFindReply(builder, &answer, list,
                                 static_cast<std::uint32_t>(found->accepted_count), 0, 0, note));
    return {};
  }

  void watch(const WatchRequest& request, rpc::TableWriter<WatchItem> items,
             const rpc::CallContext& context) override {
    const rt::AllowAllocationScope not_real_time;
    const std::lock_guard lock(mutex_);
    if (!allows(context, Operation::kList, view_of(request.directory()))) {
      return refuse_watch(items, Outcome::kDenied);
    }
    watches_.add(request, std::move(items), context.caller.ipv4);
  }

  rpc::Result<void> list(const ListRequest& request, rpc::ReplyBuilder<ListReply>& reply,
                         const rpc::CallContext& context) override {
    const rt::AllowAllocationScope not_real_time;
    const std::lock_guard lock(mutex_);
    const MonotonicTime now = rt::now();
    const std::string_view directory = view_of(request.directory());
    const auto page = allows(context, Operation::kList, directory)
                          ? store_.list(directory, view_of(request.after()), kPageCountMax, now)
                          : expected<Page, Refusal>(unexpected{denied()});
    flatbuffers::FlatBufferBuilder& builder = reply.builder();
    if (!page) {
      const Answer answer = names::answer_of(page.error().outcome, page.error().component);
      reply.finish(CreateListReply(builder, &answer, 0, true));
      return {};
    }
    std::size_t size_max = kPageOverheadMax;
    std::vector<flatbuffers::Offset<Entry>> entries;
    for (const Record* record : page->records) {
      size_max += entry_size_max(*record);
      if (size_max > kPageSizeMax) break;
      entries.push_back(write_entry(builder, *record, now));
    }
    const bool is_last = page->is_last && entries.size() == page->records.size();
    const Answer answer = names::answer_of(Outcome::kDone);
    reply.finish(CreateListReply(builder, &answer, builder.CreateVector(entries), is_last));
    return {};
  }

  rpc::Result<Answer> unbind(const UnbindRequest& request,
                             const rpc::CallContext& context) override {
    const rt::AllowAllocationScope not_real_time;
    const std::lock_guard lock(mutex_);
    if (!allows(context, Operation::kUnbind, view_of(request.name()), owner_of(*request.owner()))) {
      return names::answer_of(Outcome::kDenied);
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
    if (!allows(context, Operation::kReport, {})) return unexpected{rpc::Refusal::kFailed};
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
    reply.finish(CreateReport(builder, static_cast<std::uint32_t>(store_.size()),
                              static_cast<std::uint32_t>(store_.owner_count()), takeover_count_,
                              refused_list, host_list, static_cast<std::uint32_t>(watches_.count()),
                              watches_.cut_off_count()));
    return {};
  }

 private:
  rpc::Result<void> look_up(const ResolveRequest& request, rpc::ReplyBuilder<ResolveReply>& reply,
                            const rpc::CallContext& context, bool has_properties) {
    const rt::AllowAllocationScope not_real_time;
    const std::lock_guard lock(mutex_);
    const MonotonicTime now = rt::now();
    const auto record = allows(context, Operation::kResolve, view_of(request.name()))
                            ? store_.resolve(view_of(request.name()), now)
                            : expected<const Record*, Refusal>(unexpected{denied()});
    flatbuffers::FlatBufferBuilder& builder = reply.builder();
    flatbuffers::Offset<Entry> entry;
    Answer answer = names::answer_of(Outcome::kDone);
    if (record) {
      entry = write_entry(builder, **record, now, has_properties);
    } else {
      answer = names::answer_of(record.error().outcome, record.error().component);
    }
    reply.finish(CreateResolveReply(builder, &answer, entry));
    return {};
  }

  /// Fits a datagram together with all outcomes.
  static constexpr std::size_t kReportedHostMax = 8;

  rpc::Result<void> bind(const Claim& claim, rpc::ReplyBuilder<BindReply>& reply,
                         Bind bind_in_store, const rpc::CallContext& context) {
    const rt::AllowAllocationScope not_real_time;
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
        sentence = note_refusal(claim, bound.error(), now);
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
                                          MonotonicTime now) {
    ++refused_counts_[static_cast<std::size_t>(refusal.outcome)];
    if (is_of_storage(refusal.outcome)) report_trouble(now);
    if (!is_limit(refusal.outcome)) return std::nullopt;
    const auto more = admit(limit_log_, now);
    if (!more) return std::nullopt;
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
    return policy_->allows({context.caller, context.session, owner}, operation, name);
  }
  [[nodiscard]] static Refusal denied() { return {Outcome::kDenied}; }

  void report_trouble(MonotonicTime now) {
    if (const auto more = admit(storage_log_, now)) report_(store_.storage_trouble() + *more);
  }

  rt::PiMutex mutex_;
  std::unique_ptr<Storage> storage_;
  std::unique_ptr<const Policy> policy_;
  Store store_;
  Watches watches_{mutex_, store_, rt::random_u64()};
  RegistryReport report_;
  std::array<std::uint64_t, static_cast<std::size_t>(OutcomeCode::MAX) + 1> refused_counts_{};
  std::uint64_t takeover_count_ = 0;
  LogLimit limit_log_{{.burst = 2}};
  LogLimit takeover_log_{{.burst = 2}};
  LogLimit storage_log_{{.burst = 2}};
};

}  // namespace

std::unique_ptr<rpc::Servant> make_servant(Limits limits, RegistryReport report) {
  // Random, so that revisions of two starts differ.
  return std::make_unique<RegistryServant>(
      RegistryConfig{limits, std::move(report)},
      StoredContent{.first_revision = rt::random_u64() >> 1 | 1});
}

expected<std::unique_ptr<rpc::Servant>, SetupError> make_registry(RegistryConfig config) {
  StoredContent content{.first_revision = rt::random_u64() >> 1 | 1};
  if (config.storage) {
    auto loaded = config.storage->load();
    if (!loaded) return unexpected{std::move(loaded.error())};
    content = std::move(*loaded);
  }
  return std::make_unique<RegistryServant>(std::move(config), std::move(content));
}

}  // namespace rtpm::names
