#include "rtpm/names/servant.hpp"

#include <array>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "idl.hpp"
#include "name.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/host.hpp"
#include "rtpm/rt/log.hpp"
#include "rtpm/rt/memory.hpp"
#include "rtpm/rt/pi_mutex.hpp"
#include "rtpm/wire/limits.hpp"

namespace rtpm::names {
namespace {

/// Requests in the store's types.
std::string_view view_of(const flatbuffers::String* text) {
  return text == nullptr ? std::string_view{} : text->string_view();
}

Claim claim_of(const BindRequest& request, rpc::CallerHost caller) {
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
         outcome == Outcome::kHostFull || outcome == Outcome::kHostOwnersFull;
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

flatbuffers::Offset<Entry> write_entry(flatbuffers::FlatBufferBuilder& builder,
                                       const Record& record, MonotonicTime now) {
  const auto name = builder.CreateString(record.name);
  const auto url = builder.CreateString(record.url);
  const auto interface = builder.CreateString(record.interface);
  return CreateEntry(builder, name, url, interface, ns_of(record.expires - now), record.revision);
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

/// Upper bound of names per page.
constexpr std::size_t kPageCountMax = kPageSizeMax / kEntryOverheadMax;

/// Every method allocates: the lane of a registry is not real-time. See make_servant().
class RegistryServant final : public NamesServant {
 public:
  // Random, so that revisions of two starts differ.
  RegistryServant(Limits limits, RegistryReport report)
      : store_(limits, rt::random_u64() >> 1 | 1),
        report_(report ? std::move(report) : [](std::string_view sentence) {
          rt::print_error("rtpm-names", sentence);
        }) {}

  rpc::Result<void> bind(const BindRequest& request, rpc::ReplyBuilder<BindReply>& reply,
                         const rpc::CallContext& context) override {
    return bind(claim_of(request, context.caller), reply, &Store::bind);
  }
  rpc::Result<void> rebind(const BindRequest& request, rpc::ReplyBuilder<BindReply>& reply,
                           const rpc::CallContext& context) override {
    return bind(claim_of(request, context.caller), reply, &Store::rebind);
  }

  rpc::Result<Answer> renew(const RenewRequest& request, const rpc::CallContext&) override {
    const rt::AllowAllocationScope not_real_time;
    const std::lock_guard lock(mutex_);
    return answer_of(store_.renew(view_of(request.name()), owner_of(*request.owner()),
                                  duration_of(request.lease_ns()), rt::now()));
  }

  rpc::Result<void> resolve(const ResolveRequest& request, rpc::ReplyBuilder<ResolveReply>& reply,
                            const rpc::CallContext&) override {
    const rt::AllowAllocationScope not_real_time;
    const std::lock_guard lock(mutex_);
    const MonotonicTime now = rt::now();
    const auto record = store_.resolve(view_of(request.name()), now);
    flatbuffers::FlatBufferBuilder& builder = reply.builder();
    flatbuffers::Offset<Entry> entry;
    Answer answer = names::answer_of(Outcome::kDone);
    if (record) {
      entry = write_entry(builder, **record, now);
    } else {
      answer = names::answer_of(record.error().outcome, record.error().component);
    }
    reply.finish(CreateResolveReply(builder, &answer, entry));
    return {};
  }

  rpc::Result<void> list(const ListRequest& request, rpc::ReplyBuilder<ListReply>& reply,
                         const rpc::CallContext&) override {
    const rt::AllowAllocationScope not_real_time;
    const std::lock_guard lock(mutex_);
    const MonotonicTime now = rt::now();
    const auto page =
        store_.list(view_of(request.directory()), view_of(request.after()), kPageCountMax, now);
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

  rpc::Result<Answer> unbind(const UnbindRequest& request, const rpc::CallContext&) override {
    const rt::AllowAllocationScope not_real_time;
    const std::lock_guard lock(mutex_);
    return answer_of(store_.unbind(view_of(request.name()), owner_of(*request.owner()), rt::now()));
  }

  rpc::Result<void> report(rpc::ReplyBuilder<Report>& reply, const rpc::CallContext&) override {
    const rt::AllowAllocationScope not_real_time;
    const std::lock_guard lock(mutex_);
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
                              refused_list, host_list));
    return {};
  }

 private:
  using Bind = expected<Granted, Refusal> (Store::*)(const Claim&, MonotonicTime);
  /// Fits a datagram together with all outcomes.
  static constexpr std::size_t kReportedHostMax = 8;

  rpc::Result<void> bind(const Claim& claim, rpc::ReplyBuilder<BindReply>& reply,
                         Bind bind_in_store) {
    const rt::AllowAllocationScope not_real_time;
    std::optional<std::string> sentence;
    {
      const std::lock_guard lock(mutex_);
      const MonotonicTime now = rt::now();
      const auto before = store_.resolve(claim.name, now);
      const Record former = before ? **before : Record{};
      const auto bound = (store_.*bind_in_store)(claim, now);
      if (!bound) {
        sentence = note_refusal(claim, bound.error(), now);
        write_refusal(bound.error(), reply, now);
      } else {
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
                                 holder == nullptr ? 0 : ns_of(holder->expires - now),
                                 holder == nullptr ? 0 : holder->revision));
  }

  std::optional<std::string> note_refusal(const Claim& claim, const Refusal& refusal,
                                          MonotonicTime now) {
    ++refused_counts_[static_cast<std::size_t>(refusal.outcome)];
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

  rt::PiMutex mutex_;
  Store store_;
  RegistryReport report_;
  std::array<std::uint64_t, static_cast<std::size_t>(OutcomeCode::MAX) + 1> refused_counts_{};
  std::uint64_t takeover_count_ = 0;
  LogLimit limit_log_{{.burst = 2}};
  LogLimit takeover_log_{{.burst = 2}};
};

}  // namespace

std::unique_ptr<rpc::Servant> make_servant(Limits limits, RegistryReport report) {
  return std::make_unique<RegistryServant>(limits, std::move(report));
}

}  // namespace rtpm::names
