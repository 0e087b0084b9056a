#include "rtpm/names/servant.hpp"

#include <mutex>
#include <vector>

#include "idl.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/memory.hpp"
#include "rtpm/rt/pi_mutex.hpp"
#include "rtpm/wire/limits.hpp"

namespace rtpm::names {
namespace {

/// The store's words for what came in a request.
std::string_view view_of(const flatbuffers::String* text) {
  return text == nullptr ? std::string_view{} : text->string_view();
}

Store::Wish wish_of(const BindRequest& request) {
  return {view_of(request.name()), view_of(request.url()), view_of(request.interface()),
          owner_of(*request.owner()), duration_of(request.lease_ns())};
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
  return CreateEntry(builder, name, url, interface, ns_of(record.expires - now));
}

// What FlatBuffers needs at most, so that a page is known to fit before it is written. Each text
// has a length, an end and padding; a table its offset to the vtable, its fields and padding; and
// the vector one offset for each entry.
constexpr std::size_t kTextOverheadMax = 4 + 1 + 3;
constexpr std::size_t kEntryOverheadMax = 3 * kTextOverheadMax + (4 + 3 * 4 + 8 + 8) + 4;
constexpr std::size_t kPageOverheadMax = 96;
// The builder notes fields and vtables at the other end of the same memory while it writes.
constexpr std::size_t kScratchSizeMax = 128;
constexpr std::size_t kPageSizeMax = wire::kDatagramPayloadSizeMax - kScratchSizeMax;

std::size_t entry_size_max(const Record& record) {
  return record.name.size() + record.url.size() + record.interface.size() + kEntryOverheadMax;
}

constexpr std::size_t kEntrySizeMax =
    kNameSizeMax + kUrlSizeMax + kInterfaceSizeMax + kEntryOverheadMax;
static_assert(kPageOverheadMax + kEntrySizeMax <= kPageSizeMax,
              "a page holds at least one entry, else a list would not come to its end");

/// As many names as any page can hold: those with texts of one byte.
constexpr std::size_t kPageCountMax = kPageSizeMax / kEntryOverheadMax;

/// Every method allocates, on a lane that otherwise never does: the lane of a registry is not
/// real-time, and names are bound and resolved while programs set up. See make_servant().
class RegistryServant final : public NamesServant {
 public:
  explicit RegistryServant(Limits limits) : store_(limits) {}

  rpc::Result<void> bind(const BindRequest& request, rpc::ReplyBuilder<BindReply>& reply,
                         const rpc::CallContext&) override {
    return bind(request, reply, &Store::bind);
  }
  rpc::Result<void> rebind(const BindRequest& request, rpc::ReplyBuilder<BindReply>& reply,
                           const rpc::CallContext&) override {
    return bind(request, reply, &Store::rebind);
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

 private:
  using Bind = expected<void, Refusal> (Store::*)(const Store::Wish&, MonotonicTime);

  rpc::Result<void> bind(const BindRequest& request, rpc::ReplyBuilder<BindReply>& reply,
                         Bind bind_in_store) {
    const rt::AllowAllocationScope not_real_time;
    const std::lock_guard lock(mutex_);
    const MonotonicTime now = rt::now();
    const auto bound = (store_.*bind_in_store)(wish_of(request), now);
    const Record* const holder = bound ? nullptr : bound.error().holder;
    flatbuffers::FlatBufferBuilder& builder = reply.builder();
    flatbuffers::Offset<flatbuffers::String> holder_url;
    if (holder != nullptr) holder_url = builder.CreateString(holder->url);
    const Answer answer = answer_of(bound);
    reply.finish(CreateBindReply(builder, &answer, holder_url,
                                 holder == nullptr ? 0 : ns_of(holder->expires - now)));
    return {};
  }

  rt::PiMutex mutex_;
  Store store_;
};

}  // namespace

std::unique_ptr<rpc::Servant> make_servant(Limits limits) {
  return std::make_unique<RegistryServant>(limits);
}

}  // namespace rtpm::names
